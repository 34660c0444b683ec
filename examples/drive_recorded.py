"""Drive the stack on the readings of a recorded run, as a robot of your own would: no simulator.

It prints a line whenever the leading behaviour changes, and whether the commands are the recorded
ones. Without a simulator the robot's half and the reader of recordings are enough::

    pip install 'navfw[record]'
    python examples/drive_recorded.py runs/office-lobby-to-lab-0

A folder with a recording is written by ``navfw run WORLD MISSION --record``.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from navfw import (
    InputError,
    Pose,
    RobotModel,
    SensorRecording,
    Stack,
    Waypoint,
    compile_kernels,
    default_registry,
    load_map,
    load_recording,
)


def load_stack(folder: Path) -> Stack:
    """Load the stack of the run, for its robot and on its map, and start it with its goals."""
    mission = json.loads((folder / "result.json").read_text(encoding="utf-8"))["config"]["mission"]
    robot = RobotModel.model_validate(mission["robot"])
    stack = Stack.load(
        folder / "stack.yaml", robot, load_map(folder / "map.yaml"), default_registry()
    )
    goals = [
        Waypoint(goal["x"], goal["y"], mission["tolerance"], goal["place"], "goal", final=True)
        for goal in mission["goals"]
    ]
    stack.start(Pose(*mission["start"]) if mission["start_known"] else None, goals)
    return stack


def drive(stack: Stack, recording: SensorRecording) -> int:
    """Step through all readings; return how many commands differ from the recorded ones."""
    leader, different = "", 0
    for reading, (v, w) in zip(recording.readings, recording.commands, strict=True):
        twist = stack.step(reading)
        different += (twist.v, twist.w) != (v, w)
        command = stack.state.command
        if command is not None and command.leader != leader:
            leader = command.leader
            driven = f"{twist.v:+.2f} m/s  {twist.w:+.2f} rad/s"
            print(f"{reading.time:6.2f} s  {driven}  {leader}: {command.reason}")
    return different


def main(arguments: list[str] | None = None) -> int:
    """Load, drive and compare; return 0 if all commands are the recorded ones."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="of a run that was recorded")
    options = parser.parse_args(arguments)
    try:
        recording = load_recording(options.folder / "run.mcap")
        compile_kernels()
        different = drive(load_stack(options.folder), recording)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{different} of {len(recording)} commands differ from the recorded ones")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
