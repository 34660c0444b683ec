"""Commands that are killed at seeded moments: their start, the signals, and what is left."""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

TINY = "entries: [{world: empty, missions: [straight], set: {mission.timeout: 1}}]\n"
"""A suite of one run of a second for each seed."""

MANY = int(os.environ.get("NAVFW_KILLS", "5"))
"""Moments for each signal in the slow tests."""

WAIT = 300.0
"""Longest time [s] to wait for an end: machines of CI are slow."""

_START = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # even if pytest's starter ignores it
{code}
"""


@dataclass(frozen=True)
class Ended:
    """How a process ended: exit code (negative: the signal), and what it printed."""

    code: int
    stdout: str
    stderr: str


class Started:
    """A process of this Python, in ``folder``, with its temporary files in ``folder/tmp``."""

    def __init__(self, code: str, words: Sequence[str], folder: Path) -> None:
        (folder / "tmp").mkdir(exist_ok=True)
        self._files = [(folder / name).open("w+") for name in ("stdout", "stderr")]
        self._process = subprocess.Popen(  # noqa: S603 - this Python, words of our own
            [sys.executable, "-c", _START.format(code=code), *words],
            cwd=folder,
            stdout=self._files[0],
            stderr=self._files[1],
            env={**os.environ, "TMPDIR": str(folder / "tmp")},
            start_new_session=True,
        )
        self.pid = self._process.pid

    def running(self) -> bool:
        return self._process.poll() is None

    def after(self, delay: float) -> bool:
        """Wait ``delay`` [s]; whether the process still runs."""
        try:
            self._process.wait(delay)
        except subprocess.TimeoutExpired:
            return True
        return False

    def send(self, number: signal.Signals, *, group: bool | None = None) -> None:
        """Send the signal to the process, or to its group, as a terminal sends Ctrl-C."""
        if number is signal.SIGINT if group is None else group:
            os.killpg(self.pid, number)
        else:
            self._process.send_signal(number)

    def ended(self) -> Ended:
        """Wait until the process and all that it started have ended."""
        code = self._process.wait(WAIT)
        deadline = time.monotonic() + WAIT
        while _group_exists(self.pid):
            assert time.monotonic() < deadline, "a process of the group is still there"
            time.sleep(0.05)
        texts = []
        for file in self._files:
            file.seek(0)
            texts.append(file.read())
            file.close()
        return Ended(code, *texts)

    def children(self) -> list[int]:
        """The process ids of its child processes."""
        return [int(pid) for pid in _text_of(f"{self.pid}/task/{self.pid}/children").split()]

    def workers(self) -> list[int]:
        """The process ids of worker processes."""
        return [pid for pid in self.children() if "spawn_main" in _text_of(f"{pid}/cmdline")]


def moments(seed: int, count: int, longest: float) -> Iterator[float]:
    """Seeded moments [s] from the start up to ``longest``."""
    generator = random.Random(seed)  # noqa: S311 - no cryptography
    for part in range(count):  # one in each of equal parts: a few moments cover all phases
        yield longest * (part + generator.random()) / count


def _group_exists(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def _text_of(file: str) -> str:
    """The text of a file of /proc; "" once its process has ended."""
    try:
        return Path("/proc", file).read_text()
    except (FileNotFoundError, ProcessLookupError):
        return ""
