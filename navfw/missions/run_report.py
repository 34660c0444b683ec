"""The files of a run folder: ``result.json``, the picture, and the inputs of a replay."""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from importlib import metadata
from pathlib import Path
from typing import Any

from navfw.config.extras import pybullet_version
from navfw.missions.mission_events import EventRecord
from navfw.missions.run_drawing import outline_of
from navfw.missions.session import MissionResult, Session
from navfw.process.atomic import writing
from navfw.process.interruption import deferred, interruptible
from navfw.recording.provenance import code_revision, machine_kind
from navfw.recording.run_folder import MAP, PICTURE, RECORDING, RESULT, RunFolder
from navfw.recording.run_observers import RunRecorder
from navfw.recording.trajectory_picture import TrajectoryPicture, draw_trajectory

_LIBRARIES = ("numpy", "numba", "opencv-python-headless", "scikit-fuzzy", "networkx")
"""Libraries whose versions are recorded."""


def default_folder(session: Session) -> Path:
    """The default run folder: ``runs/<world>-<mission>-<seed>``."""
    return Path("runs") / f"{session.world_name}-{session.mission_name}-{session.seed}"


UNFINISHED = "unfinished"
"""Outcome of a run that goes on, or whose process was killed."""


class RecordedFolder:
    """The files that a recorded run has from its start, in the folder of ``target``.

    With them and the recording so far a run can be looked at and replayed while it goes on, and
    after its process was killed.

    Raises:
        InputError: they cannot be written.

    """

    def __init__(self, session: Session, target: RunFolder) -> None:
        self._target = target
        self._result = {
            "outcome": UNFINISHED,
            "reason": "the run goes on, or its process was killed",
            **{name: session.description[name] for name in ("world", "mission", "seed")},
            **_origin(session),
        }
        with writing(target.target):
            self._write(())
            target.write_inputs(session.stack.config, session.mission.topo_map)
            target.show_unfinished()
            self.recorder = RunRecorder(
                session.description, session.seen, path=target.path / RECORDING
            )

    def told(self, events: Sequence[EventRecord]) -> None:
        """Keep the mission's ``events`` so far: a replay repeats those of behaviours."""
        with suppress(OSError):  # of a full disk, which costs no run
            self._write(events)

    def _write(self, events: Sequence[EventRecord]) -> None:
        self._target.write_json(RESULT, {**self._result, "events": [e.as_data() for e in events]})


def write_run(result: MissionResult, target: RunFolder) -> tuple[str, ...]:
    """Write all files of the run into the (temporary) folder of ``target``, the result first.

    Returns why files are missing, if any are: a picture or a recording that cannot be written, or
    that the user interrupts, does not cost the result.

    Raises:
        InputError: the result cannot be written.

    """
    with deferred(), writing(target.target / RESULT):
        trace = result.verdict.trace
        target.write_json(RESULT, {**result.summary(), "trace": trace, **_origin(result.session)})
    writers: dict[str, Callable[[Path], object]] = {}
    if result.recorder is not None:
        if not (target.path / MAP).exists():
            inputs = result.session.stack.config, result.session.mission.topo_map
            writers[MAP] = lambda _: target.write_inputs(*inputs)
        writers[RECORDING] = result.recorder.save
    writers[PICTURE] = lambda path: draw(result, path)
    with deferred():  # a recording without its inputs could not be replayed
        missing = [
            (name, _why_missing(target.path / name, write)) for name, write in writers.items()
        ]
    said = [f"{name} is missing: {why}" for name, why in missing if why]
    error = None if result.recorder is None else result.recorder.error
    if error is not None and (target.path / RECORDING).exists():
        said.append(f"{RECORDING} ends before the run: {error.strerror or error}")
    return tuple(said)


def _origin(session: Session) -> dict[str, Any]:
    """What a run was made of, and where."""
    return {
        "config": session.config,
        "overrides": session.overrides,
        "versions": versions(),
        "stack": session.stack_file.stem,
        "revision": code_revision(),
        "machine": machine_kind(),
    }


def _why_missing(path: Path, write: Callable[[Path], object]) -> str:
    """Write a file of the run; returns why it is missing, "" if it is not."""
    try:
        with interruptible() if path.name in {RECORDING, PICTURE} else nullcontext():
            write(path)
    except KeyboardInterrupt:
        why = "interrupted"
    except OSError as error:
        why = error.strerror or str(error)
    except Exception as error:  # of a drawing or compressing library
        why = f"{type(error).__name__}: {error}"
    else:
        return ""
    path.unlink(missing_ok=True)
    return why


def draw(result: MissionResult, path: Path) -> None:
    """Write the run's picture as PNG."""
    mission, movers = result.session.mission, result.movers
    numbers = [
        f"{result.path_length_m:.1f} m in {result.sim_time_s:.1f} s",
        f"shortest {result.shortest_path_m:.1f} m, SPL {result.spl:.2f}",
        f"smallest clearance {result.min_clearance_m:.2f} m",
        f"final estimate error {result.estimate_error_m:.2f} m",
    ]
    picture = TrajectoryPicture(
        title=f"{result.world} / {result.mission}, seed {result.seed}: {result.outcome}",
        reason=result.reason,
        numbers="  ·  ".join(numbers),
        good=result.outcome.succeeded,
        outline=outline_of(result.session.plan),
        start=mission.start,
        goals=[(goal.x, goal.y) for goal in mission.goals],
        zone=mission.spec.success.within,
        robot_radius=mission.spec.robot.radius,
        places={p.name: (p.x, p.y) for p in mission.topo_map.places.values()},
        tracks=() if movers is None else list(movers.points.swapaxes(0, 1)),
        track_radii=() if movers is None else movers.radii.tolist(),
    )
    draw_trajectory(path, result.log, picture)


def versions() -> dict[str, str]:
    """Versions of Python and of the libraries that a result depends on."""
    by_name = {"python": platform.python_version(), "machine": platform.machine()}
    for library in ("navfw", *_LIBRARIES):
        try:
            by_name[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            by_name[library] = "not installed"
    return {**by_name, "pybullet": pybullet_version()}
