"""Offer parameters of MOFIS' plugins as those of a node, which may change while it drives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from navfw.config.yamlfile import rewording
from navfw.errors import NavfwError
from navfw.ros.connection import RosNode
from navfw.stack import Stack
from navfw.stack.sensing_stack import SensingStack
from navfw.stack.stackfile import Choice, mofis_of

_STAGES = frozenset(("composite", "fusion"))


class LiveParameters:
    """Declares on ``node`` the parameters of behaviours, composite, fusion: ``PLUGIN.PARAMETER``.

    These stages keep nothing but earlier decisions, so they can begin anew: ``ros2 param set``
    changes them from the next decision on, and is refused for the node's other parameters. Values
    that the node was started with hold from its start. A stack that only perceives has none.

    Raises:
        NavfwError: one of these values is wrong.

    """

    def __init__(self, node: RosNode, stack: Stack) -> None:
        self._node, self._stack = node, stack
        self._fixed = frozenset(node.declared)
        config, deciding = stack.resolved, list[Choice]()
        if not isinstance(stack, SensingStack):
            deciding += config.behaviors.values()
            deciding += [choice for name, choice in config.stages.items() if name in _STAGES]
        values = {
            name: node.parameter(name, value)
            for choice in deciding
            for key, value in choice.params.model_dump(mode="json").items()
            if isinstance(value, (bool, int, float, str))
            for name in [f"{choice.name}.{key}"]
        }
        self._take(values)
        node.serve_parameters(self.change)

    def change(self, values: Mapping[str, Any]) -> str:
        """Apply ``values`` by name; return why they are refused, "" if they are applied."""
        for name in self._fixed & values.keys():
            return f"{name} is read when the node starts: restart it with -p {name}:=VALUE"
        try:
            self._take(values)
        except NavfwError as error:
            return str(error)
        self._node.say(", ".join(f"{name} is now {value}" for name, value in values.items()))
        return ""

    def _take(self, values: Mapping[str, Any]) -> None:
        """Begin MOFIS anew with those of ``values`` that are other than before."""
        stack, config = self._stack, self._stack.resolved

        def changed(choice: Choice) -> Choice:
            now = choice.params.model_dump()
            new = {key: values.get(f"{choice.name}.{key}", value) for key, value in now.items()}
            if new == now:
                return choice
            with rewording(prefix=f"{choice.name}."):
                return replace(choice, params=choice.plugin.Params.model_validate(new))

        behaviors = {name: changed(choice) for name, choice in config.behaviors.items()}
        stages = {
            stage: changed(choice) if stage in _STAGES else choice
            for stage, choice in config.stages.items()
        }
        if (behaviors, stages) == (config.behaviors, config.stages):
            return
        config = replace(config, behaviors=behaviors, stages=stages)
        mofis = mofis_of(config, stack.robot, stack.guard, stack.local_map)
        mofis.reset()
        stack.mofis, stack.resolved = mofis, config
