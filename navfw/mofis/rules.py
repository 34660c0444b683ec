"""Rule bases of behaviours and composites, their outputs over the command grid, and base classes.

A class derived from ``RuledBehavior`` or ``RuledComposite`` reads the YAML file beside it.
"""

from __future__ import annotations

import inspect
import math
import re
from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numba
import numpy as np
from pydantic import Field

from navfw import fuzzy
from navfw.config.input_file import is_file
from navfw.config.lookup import own_project, project_plugin_folders
from navfw.context import CommandGrid, Context
from navfw.errors import InputError, UnknownNameError
from navfw.interfaces import Behavior, Composite, Plugin
from navfw.numerics import Array
from navfw.numerics.products import sum_in_order
from navfw.robot import RobotModel
from navfw.signals import Explain

_CACHE_SIZE = 64  # chosen
"""Number of sets of terms kept for the next call."""


@numba.njit(cache=True)
def _cut_and_joined(terms: Array, cuts: Array) -> Array:
    """Cut each of ``terms`` (t, n) at its cut (t,), and return their maximum (n,)."""
    joined = np.zeros(terms.shape[1])
    for t in range(cuts.size):
        for i in range(joined.size):
            joined[i] = max(joined[i], min(terms[t, i], cuts[t]))
    return joined


def rounded(value: Any) -> float | None:
    """Return a number to six decimals, for explanations; None if it is infinite or NaN."""
    return round(float(value), 6) if math.isfinite(value) else None


class Verdict:
    """The result of a rule base for one set of inputs, or (``evaluate_all``) for many at once."""

    def __init__(
        self,
        rules: BehaviorRules,
        result: fuzzy.Inference,
        shape: tuple[int, ...],
        inputs: Mapping[str, float | Array],
    ) -> None:
        self._rules = rules
        self._result = result
        self._shape = shape
        self._inputs = inputs

    def value(self, output: str) -> float:
        """Return the crisp (defuzzified) value of ``output``."""
        return float(self._result.crisp(output)[0])

    def degree(self, output: str) -> float:
        """Return the mean of the peaks of the terms of ``output``, weighted by their activations.

        Unlike the centroid it reaches the ends of the range: a term ``none`` by itself gives 0.
        """
        peaks = self._rules.peaks(output)
        degrees = self._result.activations(output)
        shared = sum_in_order(degree * peak for degree, peak in zip(degrees, peaks, strict=True))
        return shared / max(sum_in_order(degrees), 1e-9)

    def values(self, output: str) -> Array:
        """Return the crisp (defuzzified) values of ``output``, in the shape of the inputs."""
        return self._result.crisp(output).reshape(self._shape)

    def over(self, output: str, values: Array) -> Array:
        """Evaluate the fuzzy set of ``output`` at ``values`` (n,): terms cut at their strength."""
        cut = np.array(self._result.activations(output))
        result: Array = _cut_and_joined(self._rules.terms(output, values), cut)
        return result

    def command(self, commands: CommandGrid, *, crisp_turn: bool = False) -> Array:
        """Multiply the sets of the outputs ``speed`` and ``turn`` to desirability (n_v, n_w).

        It is scaled to a maximum of 1: only the applicability weighs against other behaviours.
        Between two terms both sets are cut low; without the scaling a behaviour would there be
        outweighed by behaviours without a preference.

        With ``crisp_turn`` a triangle about the crisp turn is joined to the set of turns: between
        two terms the turn then changes with the inputs, where the set by itself keeps to the
        stronger term's peak. (The triangle by itself leaves other behaviours too little choice.)
        """
        speed = self.over("speed", commands.relative_v)
        turn = self.over("turn", commands.relative_w)
        if crisp_turn:
            turn = np.maximum(turn, commands.turning(self.value("turn")))
        desired = commands.product(speed, turn)
        return desired / max(float(desired.max()), 1e-3)

    def explain(self, row: int = 0, column: int = 0) -> list[dict[str, Any]]:
        """Return the rules that fired, strongest first, at (row, column) of ``evaluate_all``.

        Each has its ``inputs``: the values of those that it names, None for infinite ones.
        """
        single = self._shape == (1,)
        index = 0 if single else int(np.ravel_multi_index((row, column), self._shape))
        values = {
            name: rounded(value if single else np.asarray(value)[row, column])
            for name, value in self._inputs.items()
        }
        named = self._rules.named_inputs
        return [
            {
                "rule": rule["rule"],
                "strength": round(rule["strength"], 6),
                "inputs": {name: values[name] for name in named[rule["rule"]]},
            }
            for rule in self._rules.fis.explain(self._result, index)
        ]


class BehaviorRules:
    """A rule base of a behaviour or composite, loaded from a YAML file or text.

    Outputs called ``speed`` and ``turn`` are relative: 1 is the command grid's top speed (negative:
    backwards) and top turning rate (positive: left).
    """

    def __init__(self, base: fuzzy.RuleBase | str | Path) -> None:
        self.base = base if isinstance(base, fuzzy.RuleBase) else fuzzy.load_rule_base(Path(base))
        self.fis = fuzzy.CompiledFis(self.base)
        self._terms: dict[tuple[str, bytes], Array] = {}
        self._peaks: dict[str, tuple[float, ...]] = {}
        self.named_inputs: Mapping[str, Sequence[str]] = {
            rule.sentence: [
                name for name in self.base.inputs if re.search(rf"\b{name} IS ", rule.sentence)
            ]
            for rule in self.base.rules
        }

    @classmethod
    def beside(cls, module_file: str, terms: fuzzy.TermCorners | None = None) -> BehaviorRules:
        """Load the YAML file beside a module, as ``BehaviorRules.beside(__file__)``.

        ``terms`` are corners of terms of inputs that replace those in the file.
        """
        return cls(fuzzy.load_rule_base(cls.file_beside(module_file), terms))

    @staticmethod
    def file_beside(module_file: str) -> Path:
        """Return the path of the YAML file beside a module; it need not exist."""
        return Path(module_file).with_suffix(".yaml")

    @classmethod
    def parse(cls, text: str, source: str | None = None) -> BehaviorRules:
        """Parse the rule base written as YAML in ``text``; ``source`` is its name in errors."""
        return cls(fuzzy.parse_rule_base(text, source))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of all outputs, in the order of the file."""
        return tuple(self.base.outputs)

    def evaluate(self, **inputs: float) -> Verdict:
        """Apply the rules to one set of inputs, each clipped to the range of its variable."""
        return Verdict(self, self.fis.evaluate_one(inputs), (1,), inputs)

    def evaluate_all(self, **inputs: Array) -> Verdict:
        """Apply the rules elementwise to arrays of one shape; inputs are clipped as well."""
        shape = next(iter(inputs.values())).shape
        result = self.fis.evaluate({name: value.ravel() for name, value in inputs.items()})
        return Verdict(self, result, shape, inputs)

    def peaks(self, output: str) -> tuple[float, ...]:
        """Return the position of the peak of each term of ``output``, within its range."""
        if output not in self._peaks:
            universe = self.base.outputs[output].universe
            self._peaks[output] = tuple(
                float(universe[degrees >= degrees.max() - 1e-9].mean())
                for degrees in self.terms(output, universe)
            )
        return self._peaks[output]

    def terms(self, output: str, values: Array) -> Array:
        """Evaluate all terms of ``output`` at ``values`` (n,): degrees (terms, n), cached."""
        key = (output, values.tobytes())
        if key not in self._terms:
            if len(self._terms) >= _CACHE_SIZE:  # the values differ at every call
                self._terms.clear()
            terms = self.base.outputs[output].terms.values()
            self._terms[key] = np.array([term(values) for term in terms], dtype=np.float64)
        return self._terms[key]


Corners = Annotated[
    tuple[Annotated[float, Field(ge=-1e6, le=1e6)], ...], Field(min_length=2, max_length=4)
]


class _Ruled(Plugin):
    """Loads the rule base from the YAML file beside the class' file, then resets."""

    class Params(Plugin.Params):
        """Changes of the rule base."""

        terms: Mapping[str, Mapping[str, Corners]] | None = Field(
            None,
            max_length=100,
            exclude_if=lambda terms: terms is None,
            description="corners of terms of inputs, instead of those of the rule base: "
            "{reserve: {short: [0, 0, 0.8, 1.2]}}",
        )

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
            fuzzy.load_rule_base(cls.rules_file())

    @classmethod
    def rules_file(cls) -> Path:
        """Return the YAML file of the rules, which need not exist: that beside the class' file.

        Of a class outside the project it is the project's ``behaviors/NAME.yaml``, if there is one
        without a plugin of its own beside it.
        """
        file, project = BehaviorRules.file_beside(inspect.getfile(cls)), own_project()
        if project is not None and file.parent not in project_plugin_folders():
            own = project / "behaviors" / file.name
            if is_file(own) and not is_file(own.with_suffix(".py")):
                return own
        return file

    def load_rules(self) -> BehaviorRules:
        """Load the rules; override it if they are not in the ``rules_file``.

        Raises:
            InputError: they cannot be read, do not cover their inputs, or have no such terms.

        """
        return BehaviorRules(fuzzy.load_rule_base(self.rules_file(), self.params.terms or {}))


class RuledBehavior(_Ruled, Behavior):
    """Base class of behaviours whose ``rules`` are in the YAML file beside the class' own file."""


class RuledComposite(_Ruled, Composite):
    """Base class of composites whose rules weigh the primitives; a subclass defines ``inputs``.

    The rule base is the YAML file beside the class' own file. Each output is named after a
    primitive, ranges over [0, 1], and its degree (``Verdict.degree``) is that primitive's weight.
    """

    def reset(self) -> None:
        """Return to the state before the first ``weigh``; overrides must call it."""
        self._fired: Explain | None = None

    @abstractmethod
    def inputs(self, context: Context) -> Mapping[str, float]:
        """Return a value for each input of the rules; called once per camera frame.

        A value beyond an input's range, an infinite one too, is clipped to the range.
        """

    def weigh(self, context: Context) -> Mapping[str, float]:
        """Return the weight in [0, 1] of each primitive that is an output of the rules."""
        values = {name: float(value) for name, value in self.inputs(context).items()}
        verdict = self.rules.evaluate(**values)
        self._fired = verdict.explain
        return {name: verdict.degree(name) for name in self.rules.outputs}

    def explain(self) -> Sequence[Mapping[str, Any]]:
        """Return the rules that fired for the last weights, strongest first."""
        return () if self._fired is None else self._fired(0, 0)


def replace_rules(
    plugins: Iterable[Plugin | None], rules: BehaviorRules, file: Path | None = None
) -> None:
    """Give that of ``plugins`` whose rule base has the name of ``rules`` these instead.

    ``file`` is that of the rules, in errors.

    Raises:
        InputError: no rule base has that name, or it has other inputs or outputs.

    """
    ruled = {
        plugin.rules.base.name: plugin
        for plugin in plugins
        if isinstance(plugin, RuledBehavior | RuledComposite)
    }
    name = rules.base.name
    if name not in ruled:
        raise UnknownNameError("rule base of the stack", name, ruled, file=file, key="name")
    now = ruled[name].rules.base
    for kind, names, expected in (
        ("inputs", rules.base.inputs, now.inputs),
        ("outputs", rules.base.outputs, now.outputs),
    ):
        if set(names) != set(expected):
            wanted = ", ".join(expected)
            raise InputError(f"expected {wanted}; got {', '.join(names)}", file=file, key=kind)
    ruled[name].rules = rules
