"""Rows and cases for the suite's tests; quick to import in worker processes."""

import dataclasses
import os
import signal
import threading
import time
from pathlib import Path
from typing import Any

from navfw.process.atomic import atomic_file
from navfw.process.last_trace import name_plugins
from navfw.suite.case import Case
from navfw.suite.run_row import RunRow
from navfw.suite.worker_pool import stop_requested


def row(seed: int = 0, outcome: str = "reached", **values: Any) -> RunRow:
    """A row with plausible numbers as defaults."""
    good = outcome == "reached"
    numbers: dict[str, Any] = {
        "entry": "rooms",
        "world": f"rooms-{seed}",
        "mission": "cross",
        "stack": "default",
        "spl": 0.9 if good else 0.0,
        "sct": 0.6 if good else 0.0,
        "barn_score": 0.2 if good else 0.0,
        "sim_time_s": 20.0,
        "min_clearance_m": 0.2,
        "collisions": int(outcome == "collided"),
        "collision_cause": "robot" if outcome == "collided" else "",
        "cause": "" if good else "slow",
    }
    return RunRow(seed=seed, outcome=outcome, **{**numbers, **values})


def case(seed: int, index: int | None = None, **values: Any) -> Case:
    """A case of a family; its world is not generated."""
    parts: dict[str, Any] = {
        "entry": "rooms",
        "stack": "default.yaml",
        "family": "rooms",
    }
    return Case(index=seed if index is None else index, seed=seed, **{**parts, **values})


# --- the workers' functions: at module level, since they are pickled by name ----------------------


def square(number: int) -> int:
    return number * number


def napping(seconds: float) -> int:
    time.sleep(seconds)
    return os.getpid()


def meet(folder: str) -> bool:
    """Whether another process runs at the same time."""
    here = Path(folder)
    (here / str(os.getpid())).touch()
    end = time.monotonic() + 60.0
    while len(list(here.iterdir())) < 2 and time.monotonic() < end:
        time.sleep(0.02)
    return len(list(here.iterdir())) == 2


def crash_on_13(number: int) -> int:
    if number == 13:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def sleep_on_13(number: int) -> int:
    if number == 13:
        time.sleep(60.0)
    return number


def raise_on_13(number: int) -> int:
    if number == 13:
        raise ValueError("thirteen is refused")
    return number


def die(number: int) -> int:
    os._exit(3)


def environment(name: str) -> str | None:
    return os.environ.get(name)


def fake_run(case: Case) -> RunRow:
    """Reached for even seeds, timeout for odd ones."""
    good = case.seed % 2 == 0
    outcome, cause = ("reached", "") if good else ("timeout", "slow")
    return RunRow(
        **case.columns,
        outcome=outcome,
        cause=cause,
        spl=float(good),
        sim_time_s=10.0,
        collisions=0,
        command_hash=f"{case.seed:064x}",
    )


def fake_run_that_dies_on_3(case: Case) -> RunRow:
    if case.seed == 3:
        os._exit(1)
    return fake_run(case)


def fake_run_that_dies_once_on_3(case: Case) -> RunRow:
    """``fake_run`` whose process dies with seed 3, but not a second time."""
    mark = case.pictures / "died.png"
    if case.seed == 3 and not mark.exists():
        mark.touch()
        os._exit(1)
    return fake_run(case)


def fake_run_that_dies_on_3_once_more(case: Case) -> RunRow:
    """``fake_run`` whose process dies with seed 3; each death leaves a file."""
    if case.seed == 3:
        (case.pictures / f"died-{os.getpid()}.png").touch()
        os._exit(1)
    return fake_run(case)


def fake_run_that_swells_on_3(case: Case) -> RunRow:
    """``fake_run`` whose process takes 1 GB with seed 3."""
    if case.seed == 3:
        swollen = b"x" * 1_000_000_000
        time.sleep(60.0)
        assert swollen
    return fake_run(case)


def fake_run_by_hand(case: Case) -> RunRow:
    """Creates a file, so that a test can list the runs."""
    Path(case.pictures, f"{case.seed}.png").touch()
    return fake_run(case)


def slow_fake_run(case: Case) -> RunRow:
    """A fake run of 0.15 s with a picture; it ends early when the suite is stopped."""
    for _ in range(15):
        time.sleep(0.01)
        if stop_requested():
            return RunRow(**case.columns, outcome="cancelled")
    with atomic_file(case.pictures / f"{case.seed}.png") as part:
        part.write_bytes(b"picture")
    return fake_run(case)


def fake_run_with_plugin_faults(case: Case) -> RunRow:
    """``fake_run`` of a run in which plugins failed in two ways."""
    return dataclasses.replace(fake_run(case), plugin_faults=2)


def hang_in_plugin_on_13(number: int) -> int:
    """The number; on 13 a plugin's call that no signal ends."""
    if number == 13:
        name_plugins({"flow mine": Path(__file__)})
        time.sleep(1000.0)
    return number


def leave_a_thread(number: int) -> int:
    """Square, and a thread that does not end."""
    threading.Thread(target=time.sleep, args=(1000.0,)).start()
    return square(number)
