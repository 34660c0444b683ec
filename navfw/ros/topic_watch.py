"""Watch whether a node's sensors send, and each topic has one publisher; warn people."""

from __future__ import annotations

from navfw.ros.connection import RosNode

_LOST = 0.7
"""Time [s] without a message of a sensor after which it is reported as missing."""


class TopicWatch:
    """Watches topics of ``node``; while all are silent the warning ends with ``stands``."""

    def __init__(self, node: RosNode, stands: str) -> None:
        self._node, self._stands = node, stands
        self._heard: dict[str, float] = {}
        self._missing = list[str]()

    def expect(self, topic: str) -> None:
        """Expect messages on ``topic`` from now on."""
        self._heard[topic] = self._node.seconds()

    def hear(self, topic: str) -> None:
        """Note that a message of ``topic`` has come."""
        if topic in self._heard:
            self._heard[topic] = self._node.seconds()

    def tell_missing(self, now: float) -> None:
        """Report the silent topics at ``now`` [s] if they have changed since the last call."""
        self._heard = {topic: min(at, now) for topic, at in self._heard.items()}
        missing = [topic for topic, at in self._heard.items() if now - at > _LOST]
        if missing == self._missing:
            return
        self._missing = missing
        stands = self._stands if missing == list(self._heard) else ""
        silent = f"nothing comes on {', '.join(missing)}{stands}"
        self._node.say(silent if missing else "all topics are heard again")

    def tell_rivals(self) -> None:
        """Report topics that more than one node publishes."""
        for topic in self._heard:
            if (count := self._node.publishers(topic)) > 1:
                what = f"{count} nodes publish {topic}, and are taken for one robot"
                self._node.note(f"{what}: give each its own namespace, or remap topics")
