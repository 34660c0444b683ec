"""Wait at a door: stand before one that is closed, until a path leads through."""

from typing import ClassVar

from navfw import Behavior, Context, Proposal


class WaitAtDoor(Behavior):
    """Wants to stand within 1 m of the next door while the local map knows no path there."""

    name: ClassVar[str] = "wait_at_door"

    def propose(self, context: Context) -> Proposal:
        """Desire to stand; applicability 0 elsewhere."""
        commands = context.commands
        waits = context.door_distance < 1.0 and context.barred
        return Proposal(
            applicability=float(waits),
            desirability=commands.around(0.0, 0.0),
            prohibition=commands.zeros(),
            reason="waits for the door" if waits else "at no closed door",
        )
