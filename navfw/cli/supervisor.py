"""Supervision of ``navfw run``: a child process drives; its parent owns stdout and the result.

The child is forked before anything large is imported. It announces its run, tells every true
position of the robot, shows by the heartbeat which plugin it calls, and hands over its result. The
parent imports no plugin. It judges arrival and contact by what the simulator has told, ends a child
that hangs where no signal reaches it, ends what plugins have left running, prints the result once,
and writes one where the child has none.
"""

from __future__ import annotations

import ctypes
import json
import math
import mmap
import os
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from navfw.cli.output import NOT_SAVED
from navfw.errors import InputError
from navfw.process import supervised
from navfw.process.atomic import write_text
from navfw.process.interruption import INTERRUPTED, ignore_signals
from navfw.process.supervised import SupervisedRun, TextToSupervisor, send
from navfw.process.watchdog import HEARTBEAT_SIZE, HeartbeatMonitor
from navfw.recording.run_folder import RESULT, RunFolder, read_result

if TYPE_CHECKING:
    from navfw.missions.outcome import GoalChecker

PATIENCE = 10.0
"""Wall time [s] for a run to end by itself after a signal, or beyond its wall-clock limit."""

_SAVING = 600.0
"""Wall time [s] to write the files of a finished drive; a signal does not shorten it."""

_LAST_STEPS = 5.0
"""Wall time [s] for a process to end after its last message: threads of plugins may not end."""

_PERIOD = 0.05
"""Period [s] of reading messages and looking at the heartbeat; signals end it early."""

_ORPHAN_GRACE = 0.3
"""Wall time [s] for processes that the child has started to end after it."""

_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
"""``prctl``: the signal to get when the parent dies; orphans of the child become own children."""

_Show = Callable[[Mapping[str, Any], Sequence[str], bool], None]


def supervise(command: Callable[[], object], show: _Show) -> int:
    """Call ``command`` in a child process; its exit code, or 1 if it failed to tell a true one.

    ``show(summary, missing, as_json)`` prints the result of a run.
    """
    if sys.platform != "linux":  # only the watchdog inside the process
        command()
        return 0
    memory = mmap.mmap(-1, HEARTBEAT_SIZE)
    receiving, sending = os.pipe()
    sys.stdout.flush()
    sys.stderr.flush()
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    signals = {s for s in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(s) != signal.SIG_IGN}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {*signals, signal.SIGCHLD})
    parent, child = os.getpid(), os.fork()
    if child == 0:
        os.close(receiving)
        _begin_child(sending, memory, parent)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        _end_child(_exit_code(command))
    os.close(sending)
    return _Supervisor(child, receiving, HeartbeatMonitor(memory), signals, show).wait()


def _prctl(option: int, value: int) -> None:
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(option, value)


# --- in the child --------------------------------------------------------------------------------


def _begin_child(messages: int, memory: mmap.mmap, parent: int) -> None:
    """Connect the child with its supervisor; all that it prints goes to stderr or through it."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:  # it has died meanwhile
        os._exit(1)
    supervised.begin(messages, memory)
    os.dup2(2, 1)
    sys.stdout = TextToSupervisor()


def _exit_code(command: Callable[[], object]) -> int:
    try:
        command()
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            return end.code or 0
        sys.stderr.write(f"{end.code}\n")
        return 1
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


def _end_child(code: int, end: Callable[[int], object] = os._exit) -> None:
    """End the process, whatever threads plugins have left behind."""
    with suppress(BaseException):
        ignore_signals()
        sys.stderr.flush()
    send({"finished": code})
    end(code)


# --- in the parent -------------------------------------------------------------------------------


class _Record:
    """What the simulator tells of a run: the goals visited, the contacts, the last position."""

    def __init__(self, run: SupervisedRun) -> None:
        from navfw.missions.outcome import GoalChecker
        from navfw.signals import Pose, Waypoint

        goals = [Waypoint.goal(x, y, run.radius, place) for x, y, place in run.goals]
        self._goals: GoalChecker = GoalChecker(goals, run.radius)
        self._touched = 0
        self._pose = Pose
        self._last: Pose | None = None

    def take(self, x: float, y: float, touched: int) -> None:
        """Take in a position [m], and the number of bodies in contact there."""
        self._last = self._pose(x, y, 0.0)
        self._touched += touched
        self._goals.update(self._last)

    def contradiction(self, outcome: object) -> str:
        """Why a run with this ``outcome`` was not that by the simulator's record; "" if it was."""
        if outcome != "reached":
            return ""
        if self._touched:
            return "something was touched"
        if self._last is None:
            return "the robot has not moved"
        return self._goals.missed(self._last) or ""


class _Supervisor:
    """Waits for the child; ends it when a call is overdue, after a signal, or at the limit."""

    def __init__(
        self,
        child: int,
        messages: int,
        heartbeat: HeartbeatMonitor,
        signals: set[signal.Signals],
        show: _Show,
    ) -> None:
        self._child = child
        self._messages = messages
        self._heartbeat = heartbeat
        self._signals = signals
        self._show = show
        self._text = b""
        self._run: SupervisedRun | None = None
        self._record: _Record | None = None
        self._result: tuple[dict[str, Any], list[str]] | None = None
        self._code: int | None = None
        self._deadline = math.inf
        self._stopped = False
        self._driven = False
        self._misdeeds: list[str] = []

    def wait(self) -> int:
        """The exit code of the child, or of the result that is written in its place."""
        status = self._watch()
        self._take_signals()
        left = _end_orphans()
        if self._run is None:  # the command has begun none
            if self._code is not None:
                return self._code
            sys.stderr.write(f"navfw: {self._reason(status)}\n")
            return 1
        if left:
            self._misdeeds.append(f"{left} process{'es' * (left != 1)} left running")
        if self._result is None:
            return self._conclude(status)
        return self._judge(*self._result)

    def _watch(self) -> int | str:
        """The status of the ended child, or why it was killed."""
        while True:
            self._take_signals(signal.sigtimedwait({*self._signals, signal.SIGCHLD}, _PERIOD))
            self._receive()
            ended, status = os.waitpid(self._child, os.WNOHANG)
            if ended:
                self._receive()
                return status
            why = self._overdue(time.monotonic())
            if why:
                os.kill(self._child, signal.SIGKILL)
                os.waitpid(self._child, 0)
                return why

    def _overdue(self, now: float) -> str:
        """Why the child is to be killed; "" if it is not."""
        if self._heartbeat.overdue(now):
            return "no result in time, and no signal ended it"
        if now < self._deadline:
            return ""
        if self._code is not None:
            return "finished, but did not end"
        if self._driven:
            return "the files of the run were not written in time"
        if self._stopped:
            return "stopped by the user"
        return "exceeded the wall-clock limit"

    def _take_signals(self, first: Any = None) -> None:
        """Forward the signals that have arrived; note whether the user or a plugin sent them.

        A terminal sends Ctrl-C to the child as well, which takes it once.
        """
        infos = [] if first is None or first.si_signo == signal.SIGCHLD else [first]
        while (info := signal.sigtimedwait(self._signals, 0.0)) is not None:
            infos.append(info)
        for info in infos:
            if _is_within(info.si_pid, self._child):
                self._misdeeds.append(f"sent {signal.Signals(info.si_signo).name} to navfw")
            elif not self._driven:
                self._stopped = True
            with suppress(ProcessLookupError):  # it ends at this moment
                os.kill(self._child, info.si_signo)
            if not self._driven:
                self._deadline = min(self._deadline, time.monotonic() + PATIENCE)

    def _receive(self) -> None:
        """Read what the child has written by now, without waiting."""
        while select.select([self._messages], [], [], 0.0)[0]:
            part = os.read(self._messages, 65536)
            if not part:
                return
            *lines, self._text = (self._text + part).split(b"\n")
            for line in lines:
                self._take(json.loads(line))

    def _take(self, message: dict[str, Any]) -> None:
        now = time.monotonic()
        if "at" in message:
            if self._record is not None:
                self._record.take(*message["at"][1:])
        elif "out" in message:
            if self._run is None:  # later, stdout is for the result
                sys.stdout.write(message["out"])
        elif "run" in message:
            self._run = SupervisedRun(**message["run"])
            self._record = _Record(self._run)
            self._deadline = now + self._run.limit + PATIENCE
        elif "driven" in message:
            self._driven = True
            self._deadline = now + _SAVING
        elif "stays" in message:
            self._deadline = math.inf
        elif "result" in message:
            self._result = tuple(message["result"])
        else:
            self._code = int(message["finished"])
            self._deadline = now + _LAST_STEPS

    def _reason(self, status: int | str) -> str:
        """Why there is no result, with the plugin that was being called."""
        why = status
        if isinstance(status, int):
            how = os.waitstatus_to_exitcode(status)
            what = f"exit code {how}" if how >= 0 else signal.Signals(-how).name
            why = f"the process of the run ended ({what})"
        who = self._heartbeat.plugin or ("" if self._run is None else self._run.plugins)
        return f"{who}: {why}" if who else str(why)

    def _conclude(self, status: int | str) -> int:
        """Print and write the result of a run whose process has ended without one."""
        assert self._run is not None  # noqa: S101 - a run has begun
        run, reason = self._run, self._reason(status)
        faults = self._faults() + ([reason] if ": " in reason else [])
        outcome = "cancelled" if self._stopped else "fault"
        summary = {**run.summary, "outcome": outcome, "reason": reason, "faults": faults}
        # the process that has died has claimed the folder
        folder = RunFolder(run.folder)
        missing = []
        try:
            with folder:
                folder.write_json(RESULT, {**folder.adopt_unfinished(), **summary})
        except InputError as error:
            missing.append(str(error))
        where = None if folder.final is None else str(folder.final)
        self._show({**summary, "run_folder": where}, missing, run.as_json)
        return INTERRUPTED if self._stopped else 1

    def _faults(self) -> list[str]:
        who = (self._run and self._run.plugins) or "a plugin"
        return [f"{who}: {what}" for what in self._misdeeds]

    def _judge(self, summary: dict[str, Any], missing: list[str]) -> int:
        """Print the result of the child, as far as it is true; the exit code."""
        assert self._run is not None and self._record is not None  # noqa: S101 - a run has begun
        outcome = summary["outcome"]
        if why := self._record.contradiction(outcome):
            self._misdeeds.append(f"the run says {outcome}, but by the simulator's record {why}")
        elif outcome == "cancelled" and not self._stopped and not self._misdeeds:
            self._misdeeds.append(why := "sent a signal to the process of the run")
        if faults := self._faults():
            changes: dict[str, Any] = {
                "faults": [*summary["faults"], *faults],
                "objections": [*summary["objections"], *faults],
            }
            if why or (outcome == "cancelled" and not self._stopped):
                changes |= {"outcome": "fault", "reason": faults[-1]}
            summary |= changes
            _correct(summary["run_folder"], changes)
        self._show(summary, missing, self._run.as_json)
        if missing:
            return NOT_SAVED
        failed = summary["outcome"] != "reached" or summary["objections"] or self._code is None
        return self._code or int(failed)


def _correct(folder: str | None, changes: Mapping[str, Any]) -> None:
    """Change the written result of a run."""
    if folder is not None:
        text = json.dumps({**read_result(folder), **changes}, indent=2)
        write_text(Path(folder) / RESULT, text + "\n")


def _is_within(process: int, ancestor: int) -> bool:
    """Whether ``process`` is ``ancestor``, or was started by it, as far as it still runs."""
    while process > 1:
        if process == ancestor:
            return True
        try:
            fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
        except OSError:
            return False
        process = int(fields.rpartition(")")[2].split()[1])
    return False


def _end_orphans() -> int:
    """End what the child has started and left running; the number of these processes."""
    running: set[int] = set()
    deadline = time.monotonic() + _ORPHAN_GRACE
    while children := _children():
        with suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        if time.monotonic() > deadline:
            for process in children & _children():
                running.add(process)
                with suppress(OSError):
                    os.kill(process, signal.SIGKILL)
        time.sleep(0.005)
    return len(running)


def _children() -> set[int]:
    """The child processes of this one; none where the system does not list them."""
    try:
        text = Path(f"/proc/self/task/{os.getpid()}/children").read_text(encoding="ascii")
    except OSError:
        return set()
    return set(map(int, text.split()))
