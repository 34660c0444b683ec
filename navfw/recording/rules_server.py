"""Serve the page that edits rules: check them as the robot does, save, drive and test them."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from navfw.config.extras import extra_imports
from navfw.config.input_file import read_input, shown_path
from navfw.config.lookup import list_missions
from navfw.errors import InputError
from navfw.mofis.rules import BehaviorRules
from navfw.process.printable_text import printable
from navfw.recording.page_server import PageServer, tell
from navfw.recording.rules_file import ChangedFileError, RulesFile
from navfw.recording.rules_run import RulesRun
from navfw.recording.rules_view import read_rules, view_of
from navfw.recording.run_folder import REPORT, read_result

with extra_imports("record"):
    from websockets.asyncio.server import ServerConnection
    from websockets.exceptions import ConnectionClosed
    from websockets.typing import Subprotocol

_SETTLED = 0.25
"""Wall time [s] without another request after which all commands of a run are computed."""
_SLICE = 0.01
"""Wall time [s] for which they are computed before other requests are answered."""
_COMPARED = {
    "outcome": "outcome",
    "time [s]": "sim_time_s",
    "path [m]": "path_length_m",
    "smallest clearance [m]": "min_clearance_m",
    "mean speed [m/s]": "mean_speed_m_s",
    "collisions": "collisions",
    "emergencies": "emergencies",
}
"""Quantities that are compared between old and new run, with their keys in results."""


class RulesServer(PageServer):
    """Serves ``page`` (HTML) for the rules in ``file``, at decisions of ``run`` if there is one.

    Raises:
        InputError: the file cannot be read; the port is in use, or must not be used.

    """

    command = "navfw rules"
    protocols = (Subprotocol("navfw.rules.v1"),)
    max_request = 1 << 20

    def __init__(
        self, file: RulesFile, port: int = 0, *, page: str = "", run: RulesRun | None = None
    ) -> None:
        self._file, self._run = file, run
        self._newest: dict[ServerConnection, int] = {}
        self._marking: set[asyncio.Task[None]] = set()
        self._job: asyncio.Task[None] | None = None
        first = {"text": file.read(), "time": 0.0, "shown": -1, "values": {}, "surface": {}}
        self._seen(first)  # what is loaded for it is not waited for by the first page
        super().__init__(port, page)

    @property
    def unsaved(self) -> str:
        """The reason why the file cannot be saved; "" if it can."""
        try:
            self._file.target()
        except InputError as error:
            return f"nothing can be saved: {error}"
        return ""

    async def _view(self, client: ServerConnection) -> None:
        """Take the messages of a page; close the connection at one that cannot be read."""
        try:
            name, text = shown_path(self._file.path), self._file.read()
            about = {} if self._run is None else self._run.about()
            tell(client, op="file", name=name, text=text, run=about, unsaved=self.unsaved)
            async for message in client:
                self._take(client, json.loads(message))
        except InputError as error:  # of the file
            await client.close(1011, str(error).encode()[:120].decode(errors="ignore"))
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
            await client.close(1003)
        except ConnectionClosed:
            pass
        finally:
            self._newest.pop(client, None)

    def _take(self, client: ServerConnection, message: Mapping[str, Any]) -> None:
        """Handle a page's message; raises errors of many kinds if it cannot be read."""
        if message["op"] == "look":
            number = self._newest[client] = int(message["number"])
            sound, answer = self._seen(message)
            tell(client, op="view", number=number, **answer)
            if self._run is not None and sound is not None:
                task = self._loop.create_task(self._mark(client, number, sound, self._run))
                self._marking.add(task)
                task.add_done_callback(self._marking.discard)
        elif message["op"] == "save":
            tell(client, **self._save(str(message["text"]), str(message["read"])))
        elif message["op"] == "stop" and self._job is not None:
            self._job.cancel()
        elif message["op"] in {"drive", "test"} and self._job is None:
            self._job = self._loop.create_task(self._work(client, message["op"]))
        elif message["op"] in {"drive", "test"}:
            tell(client, op="done", message="another page drives or tests at present")

    def _seen(self, message: Mapping[str, Any]) -> tuple[BehaviorRules | None, dict[str, Any]]:
        """Return the rules in the text, None if they have a fault, and what the page draws."""
        text = str(message["text"])
        rules, problem, lines = read_rules(text, shown_path(self._file.path))
        sound, values = None if problem else rules, dict[str, float]()
        answer: dict[str, Any] = {"problem": problem, "lines": lines}
        if self._run is not None and rules is not None:
            moment, shown = float(message["time"]), int(message["shown"])
            try:
                answer["moment"], values = self._run.moment(moment, sound, shown)
            except Exception as error:  # a plugin may raise anything
                answer["note"] = str(error) or type(error).__name__
        if rules is not None:
            values |= {str(name): float(value) for name, value in message["values"].items()}
            answer["view"] = view_of(rules, text, values, message["surface"])
        return sound, answer

    async def _mark(
        self, client: ServerConnection, number: int, rules: BehaviorRules, run: RulesRun
    ) -> None:
        """Send all commands of the run with these rules, unless there is a newer request.

        They are computed a few at a time, between answers: a thread would slow these down.
        """
        await asyncio.sleep(_SETTLED)
        commands, begun = [], time.monotonic()
        try:
            for command in run.replaced(rules):
                commands.append(command)
                if time.monotonic() > begun + _SLICE:
                    await asyncio.sleep(0.0)
                    begun = time.monotonic()
                if self._newest.get(client) != number:
                    return
            tell(client, op="marks", number=number, **run.differences(commands))
        except InputError as error:
            tell(client, op="marks", number=number, note=str(error), where=[])

    def _save(self, text: str, read: str) -> dict[str, Any]:
        """Save the text; return the answer to the page."""
        problem = read_rules(text, shown_path(self._file.path)).problem
        if problem:
            return {"op": "refused", "message": f"what navfw refuses is not saved:\n{problem}"}
        try:
            saved = self._file.save(text, read)
        except ChangedFileError as error:
            now = {"difference": error.difference, "now": error.now}
            return {"op": "refused", "message": str(error), **now}
        except InputError as error:
            return {"op": "refused", "message": str(error)}
        return {"op": "saved", "message": saved, "name": shown_path(self._file.path), "text": text}

    # --- other processes -------------------------------------------------------------------------

    async def _work(self, client: ServerConnection, kind: str) -> None:
        """Drive or test by navfw's own command line, and send its output."""
        result: dict[str, Any] = {}
        try:
            if kind == "test":
                code = await self._navfw(client, "check", self._file.plugin or self._file.path)
                result["message"] = "all is well" if code == 0 else "something is wrong"
            elif self._run is not None:
                self._run.check_drivable(self._file.path)
                result = await self._drive(client, self._run.folder)
        except (InputError, LookupError, OSError) as error:
            result["message"] = str(error)
        except asyncio.CancelledError:
            result["message"] = "stopped"
        finally:
            self._job = None
            tell(client, op="done", **result)

    async def _drive(self, client: ServerConnection, old: Path) -> dict[str, Any]:
        """Repeat a run's mission beside it; return both results, and the pages of both reports."""
        beside = (old.with_name(f"{old.name}-edited-{n}") for n in itertools.count(1))
        new = next(folder for folder in beside if not folder.exists())
        code = await self._navfw(client, *drive_words(old), "--record", "--out", new)
        if not new.is_dir():
            return {"message": f"the drive left nothing (exit code {code})"}
        for path, folder in (("/old", old), ("/new", new)):
            await self._navfw(client, "report", folder, "--quiet")
            self.pages[path] = read_input(folder / REPORT)
        results = read_result(old), read_result(new)
        rows = [(name, *(one.get(key) for one in results)) for name, key in _COMPARED.items()]
        return {"message": f"the new run is in {new}", "rows": rows, "reports": ["/old", "/new"]}

    async def _navfw(self, client: ServerConnection, *words: str | Path) -> int:
        """Run a command of navfw, and send each line that it prints; return its exit code."""
        tell(client, op="line", text=f"$ navfw {' '.join(map(str, words))}")
        pipe = asyncio.subprocess.PIPE
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", "navfw", *words),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=pipe,
            stderr=asyncio.subprocess.STDOUT,
        )
        try:
            while process.stdout is not None and (line := await process.stdout.readline()):
                tell(client, op="line", text=printable(line.decode(errors="replace").rstrip()))
            return await process.wait()
        finally:
            with contextlib.suppress(ProcessLookupError):
                process.terminate()


def drive_words(folder: Path) -> Sequence[str]:
    """Return the words after ``navfw`` of the command that drives a recorded mission again.

    Raises:
        InputError: its result cannot be read, or its world is not found.

    """
    result = read_result(folder)
    world, mission = str(result["world"]), str(result["mission"])
    words = ["--explore"]
    if mission in {one.name for one in list_missions(world)}:
        words = [mission]
    elif mission.startswith("to-"):
        words = ["--goal", mission.removeprefix("to-")]
    stack = "--stack", str(folder / "stack.yaml")
    changes = [word for text in result["overrides"] for word in ("--set", str(text))]
    return ["run", world, *words, "--seed", str(result["seed"]), *stack, *changes]
