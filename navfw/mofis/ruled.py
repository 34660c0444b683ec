"""Base classes of behaviours and composites that decide by a rule base in a file."""

from __future__ import annotations

import inspect
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import Field

from navfw.context import Context
from navfw.fuzzy import load_rule_base
from navfw.interfaces import Behavior, Composite, Plugin
from navfw.mofis.rules import BehaviorRules
from navfw.robot import RobotModel
from navfw.signals import Explain

Corners = Annotated[
    tuple[Annotated[float, Field(ge=-1e6, le=1e6)], ...], Field(min_length=2, max_length=4)
]


class _Ruled(Plugin):
    """Loads the rule base from the YAML file beside the class' file, then resets."""

    class Params(Plugin.Params):
        """Changes of the rule base."""

        terms: Annotated[
            Mapping[str, Mapping[str, Corners]] | None,
            Field(
                max_length=100,
                exclude_if=lambda terms: terms is None,
                description="corners of terms of inputs, instead of those of the rule base: "
                "{reserve: {short: [0, 0, 0.8, 1.2]}}",
            ),
        ] = None

    params: Params

    def __init__(self, robot: RobotModel, params: Plugin.Params | None = None) -> None:
        super().__init__(robot, params)
        self.rules = self.load_rules()
        self.reset()

    @classmethod
    def check_files(cls) -> None:
        """Read and check the rule base beside the class; not one that ``load_rules`` overrides.

        Raises:
            RuleBaseError: it cannot be read, or does not cover its inputs.

        """
        if cls.load_rules is _Ruled.load_rules:
            load_rule_base(BehaviorRules.file_beside(inspect.getfile(cls)))

    def load_rules(self) -> BehaviorRules:
        """The rules; override it if they are not in the YAML file beside the class.

        Raises:
            InputError: they cannot be read, do not cover their inputs, or have no such terms.

        """
        return BehaviorRules.beside(inspect.getfile(type(self)), self.params.terms or {})


class RuledBehavior(_Ruled, Behavior):
    """A behaviour with ``rules``, those in the YAML file beside the class' own file."""


class RuledComposite(_Ruled, Composite):
    """A composite whose rules weigh the primitives; a subclass gives their ``inputs``.

    The rule base is the YAML file beside the class' own file. Each output is named after a
    primitive, ranges over [0, 1], and its degree (``Verdict.degree``) is that primitive's weight.
    """

    def reset(self) -> None:
        """Back to the state before the first ``weigh``; overrides must call it."""
        self._fired: Explain | None = None

    @abstractmethod
    def inputs(self, context: Context) -> Mapping[str, float]:
        """A value for each input of the rules; called once per camera frame.

        A value beyond an input's range, an infinite one too, is clipped to the range.
        """

    def weigh(self, context: Context) -> Mapping[str, float]:
        """The degree of applicability of each primitive named in the rules."""
        values = {name: float(value) for name, value in self.inputs(context).items()}
        verdict = self.rules.evaluate(**values)
        self._fired = verdict.explain
        return {name: verdict.degree(name) for name in self.rules.outputs}

    def explain(self) -> Sequence[Mapping[str, Any]]:
        """The rules that fired for the last weights, strongest first."""
        return () if self._fired is None else self._fired(0, 0)
