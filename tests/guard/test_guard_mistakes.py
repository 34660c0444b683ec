"""Honest mistakes in plugins: each is reported with the plugin's name, without a traceback."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from cli_calls import PROGRAM, invoke, put_files
from processes import python

from navfw.guard import PluginGuard, plugin_guard
from navfw.plugins import plugin_import

BASES = {
    "flow": ("navfw.flow.block_matching", "BlockMatching", "compute(self, pair)"),
    "perception": ("navfw.offis.offis", "Offis", "perceive(self, flow, twist)"),
    "features": ("navfw.features.recognizers", "NoFeatures", "recognize(self, frame)"),
    "localizer": (
        "navfw.localization.motion_model",
        "DeadReckoning",
        "update(self, odometry, percept, detections)",
    ),
    "planner": ("navfw.papfis.papfis", "Papfis", "update(self, belief)"),
    "behavior": ("navfw.interfaces", "Behavior", "propose(self, context)"),
    "composite": ("navfw.interfaces", "Composite", "weigh(self, context)"),
    "fusion": ("navfw.mofis.fusion", "FuzzyFusion", "fuse(self, context, proposals)"),
    "controller": ("navfw.locom.unicycle", "Unicycle", "control(self, command, odometry, dt)"),
}
"""Module, class and main method of the plugin derived from, by kind of stage."""

VITAL = ("flow", "perception", "localizer", "planner", "fusion", "controller")

HEAD = '''"""A plugin with a mistake."""
import os
import sys
from dataclasses import replace

import numpy as np

from navfw.context import Context
from navfw.interfaces import Behavior, Composite
from navfw.signals import Proposal
from {module} import {base}


class Wrong({base}):
    """Makes a mistake."""

    name = "wrong"

'''
NOTHING = "Proposal(0.0, *np.zeros((2, *context.commands.shape)), 'nothing')"
METHODS = {
    "behavior": f"    def propose(self, context):\n        return {NOTHING}\n",
    "composite": "    def weigh(self, context):\n        return {}\n",
}
"""The main method of kinds whose base class has none, for mistakes in other methods."""


@dataclass(frozen=True)
class Mistake:
    """A ``kind`` of plugin, the ``body`` of its class, and what is ``said`` of it."""

    kind: str
    body: str
    said: str


def main(kind: str, code: str, said: str) -> Mistake:
    """A mistake in the main method; ``answer`` in ``code`` is a right answer."""
    _, _, signature = BASES[kind]
    name, _, rest = signature.partition("(self, ")
    answer = {"behavior": NOTHING, "composite": "{}"}.get(kind, f"super().{name}({rest}")
    return Mistake(kind, f"def {signature}:\n    answer = {answer}\n    {code}", said)


def method(kind: str, signature: str, code: str, said: str, *, after: str = "") -> Mistake:
    """A mistake in a method beside the main one; ``after`` a decorator."""
    return Mistake(kind, f"{after}def {signature}:\n    {code}", said)


def raising(kind: str, signature: str, *, after: str = "") -> Mistake:
    """A method that divides by zero, with the place of the error in what is said."""
    name = signature.partition("(")[0]
    said = f"ZeroDivisionError: division by zero (plugins/wrong.py:LINE, in {name}: 1 / 0)"
    return method(kind, signature, "1 / 0", said, after=after)


PROPERTY = "@property\n"
MAIN = {kind: signature for kind, (_, _, signature) in BASES.items()}

DRIVES: dict[str, Mistake] = {
    **{f"{kind} raises": raising(kind, MAIN[kind]) for kind in BASES},
    **{
        f"{kind} fails to reset": raising(kind, "reset(self)")
        for kind in BASES
        if kind != "controller"  # its constructor resets it
    },
    "localizer fails to start": raising("localizer", "start(self, topo_map, pose, odometry)"),
    "planner fails to start": raising("planner", "start(self, topo_map, goals)"),
    "features fail at the map": raising("features", "set_map(self, topo_map)"),
    "planner's path raises": raising("planner", "path(self)", after=PROPERTY),
    "planner's queries raise": raising("planner", "queries(self)", after=PROPERTY),
    "planner's reason raises": raising("planner", "no_route_reason(self)", after=PROPERTY),
    "planner's notes raise": raising("planner", "notes(self)", after=PROPERTY),
    "planner's closed raises": raising("planner", "closed(self)", after=PROPERTY),
    "planner's found raises": raising("planner", "found(self)", after=PROPERTY),
    "planner's map raises": raising("planner", "topo_map(self)", after=PROPERTY),
    "planner fails to observe": raising("planner", "observe(self, report)"),
    **{
        f"{kind} returns None": main(kind, "return None", "returned NoneType")
        for kind in ("flow", "perception", "localizer", "behavior", "fusion")
    },
    "features return None": main("features", "return None", "is a NoneType, expected a sequence"),
    "composite returns None": main("composite", "return None", "expected a mapping"),
    "controller returns None": main("controller", "return None", "returned NoneType"),
    "behavior returns a text": main("behavior", "return 'forward'", "propose returned str"),
    "planner returns a place": main("planner", "return 'kitchen'", "update returned str"),
    "composite returns a list": main("composite", "return [1.0]", "is a list, expected a mapping"),
    "controller returns a tuple": main("controller", "return (1.0, 0.0)", "returned tuple"),
    "flow is NaN": main(
        "flow", "return replace(answer, vectors=answer.vectors * np.nan)", "vectors has values"
    ),
    "flow has another shape": main(
        "flow", "return replace(answer, vectors=answer.vectors[1:])", "vectors has shape"
    ),
    "behavior is NaN": main(
        "behavior", "return replace(answer, desirability=answer.desirability + np.nan)", "finite"
    ),
    "fusion is NaN": main(
        "fusion", "return replace(answer, twist=replace(answer.twist, v=np.nan))", "v is nan"
    ),
    "behavior exits": main("behavior", "sys.exit('done')", "SystemExit: done"),
    "controller exits": main("controller", "sys.exit(0)", "SystemExit: 0"),
    "behavior asserts": main("behavior", "assert context is None, 'odd'", "AssertionError: odd"),
    "behavior misses a key": main("behavior", "return {}['speed']", "KeyError: 'speed'"),
    "behavior misspells": main("behavior", "return contxt", "name 'contxt' is not defined"),
    "behavior has no attribute": main("behavior", "context.speed", "no attribute 'speed'"),
    "behavior calls wrongly": main("behavior", "return Proposal()", "TypeError: "),
    "behavior stops an iteration": main("behavior", "return next(iter(()))", "StopIteration"),
    "behavior recurses": main("behavior", "return self.propose(context)", "RecursionError"),
    "behavior asks for much memory": main("behavior", "np.zeros(10**15)", "MemoryError"),
    "behavior reads a missing file": main("behavior", "open('none.txt')", "FileNotFoundError"),
    "behavior raises an odd error": main(
        "behavior",
        "raise type('Odd', (Exception,), {'__str__': lambda self: 1 / 0})()",
        "Odd: its message raises ZeroDivisionError",
    ),
    "behavior changes the percept": main(
        "behavior", "context.twist.v = 0.0", "cannot assign to field"
    ),
    "behavior changes the commands": main("behavior", "context.commands.v[:] = 0", "read-only"),
    "fusion changes the proposals": main("fusion", "proposals.clear()", "no attribute 'clear'"),
    "flow changes the image": main("flow", "pair.now.image[:] = 0", "read-only"),
    "localizer changes the odometry": main(
        "localizer", "odometry.pose.x = 0.0", "cannot assign to field"
    ),
    "behavior loops": main("behavior", "while True: pass", "took too long: no result within"),
    "behavior loops in numpy": main(
        "behavior", "while True: np.linalg.inv(np.eye(50))", "took too long: no result within"
    ),
    "behavior sleeps": main("behavior", "__import__('time').sleep(1000)", "took too long"),
    "flow loops": main("flow", "while True: pass", "took too long: no result within"),
    "behavior loops in reset": method(
        "behavior", "reset(self)", "while True: pass", "took too long: no result within"
    ),
}
"""Mistakes that are found while the robot drives: the run has a result, and names the plugin."""

REFUSED: dict[str, Mistake] = {
    **{
        f"{kind} cannot be constructed": raising(kind, "__init__(self, robot, params=None)")
        for kind in BASES
    },
    "controller fails to reset": raising("controller", "reset(self)"),
    "behavior exits when constructed": method(
        "behavior", "__init__(self, robot, params=None)", "sys.exit(0)", "SystemExit: 0"
    ),
    "behavior loops when constructed": method(
        "behavior", "__init__(self, robot, params=None)", "while True: pass", "took too long"
    ),
    "behavior generates": main("behavior", "yield answer", "replace yield by return"),
}
"""Mistakes that are found before the robot drives: the command is refused."""

FILES = {
    "a syntax error": ("def f(:\n", "plugins/wrong.py:1: cannot be imported: SyntaxError"),
    "a missing library": ("import no_such_thing\n", "No module named 'no_such_thing'; install it"),
    "a loop at import": ("while True: pass\n", "cannot be imported: PluginTimeout"),
}
"""Files that cannot be imported, or have no plugin in them."""


def write(folder: Path, mistake: Mistake) -> str:
    """Write a project with the mistake, and the stack ``wrong``; what is said, with its line."""
    module, base, _ = BASES[mistake.kind]
    own = METHODS.get(mistake.kind, "")
    signature = own.strip().partition(":")[0]
    head = HEAD.format(module=module, base=base)
    body = "".join(f"    {line}\n" for line in mistake.body.splitlines())
    keeps = own and signature not in body and mistake not in REFUSED.values()
    code = head + body + (f"\n{own}" if keeps or "__init__" in body else "")
    lines = code.splitlines()
    at = next((i for i, line in enumerate(lines, 1) if line.strip() == "1 / 0"), 0)
    plugin = "behaviors" if mistake.kind == "behavior" else mistake.kind
    stack = f"base: default\n{plugin}:\n  wrong:\nsafety: {{give_up: 1}}\n"
    texts = {"navfw.toml": "", "plugins/wrong.py": code, "stacks/wrong.yaml": stack}
    put_files(folder, texts)
    return mistake.said.replace("LINE", str(at))


@pytest.fixture
def project(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> Path:
    """The working folder; with short time limits for plugins that loop or sleep."""
    monkeypatch.chdir(tmp_path)
    if "loop" in request.node.name or "sleep" in request.node.name:
        monkeypatch.setattr(PluginGuard.__init__, "__defaults__", (3.0, 6.0))
        monkeypatch.setattr(plugin_guard, "FIRST_LIMIT", 3.0)
        monkeypatch.setattr(plugin_import, "IMPORT_LIMIT", 3.0)
    return tmp_path


def run(*words: str) -> Any:
    """``navfw run`` of a short mission with the stack ``wrong``; no traceback is shown."""
    drive = ["run", "empty", "straight", "--stack", "wrong", "--quiet", "--out", "result"]
    ended = invoke(*drive, "--set", "mission.timeout=3", *words)
    assert "Traceback" not in ended.output, ended.output
    assert ended.exception is None or isinstance(ended.exception, SystemExit)
    return ended


LONG = "behavior loops in numpy", "behavior loops in reset", "flow loops"
"""Mistakes that cost most time, and are like another one."""


def some(names: list[str], *quick: str) -> list[Any]:
    """Parameters: the ``quick`` ones by default, those in ``LONG`` on request, the others in CI."""
    assert {*quick} <= {*names}
    marks = {n: pytest.mark.slow if n in LONG else pytest.mark.thorough for n in names}
    return [pytest.param(n, marks=() if n in quick else marks[n]) for n in names]


@pytest.mark.parametrize(
    "name",
    some(
        list(DRIVES),
        "behavior raises",
        "behavior fails to reset",
        "behavior is NaN",
        "controller returns None",
        "planner's path raises",
        "flow has another shape",
        "behavior exits",
    ),
)
def test_a_mistake_costs_the_plugin_s_calls_and_is_reported(name: str, project: Path) -> None:
    mistake = DRIVES[name]
    said = write(project, mistake)
    ended = run("--json")
    assert ended.exit_code == 1, ended.output
    result = json.loads(ended.stdout)
    assert (
        json.loads((project / "result" / "result.json").read_text())["faults"] == result["faults"]
    )
    reported = [*result["faults"], result["reason"]]
    assert any(f"{mistake.kind} wrong: " in text and said in text for text in reported), reported
    if (
        mistake.kind in VITAL
        and "def reset" not in mistake.body
        and "@property" not in mistake.body
    ):
        assert result["outcome"] == "fault" or "observe" in mistake.body


@pytest.mark.parametrize(
    "name", some(list(REFUSED), "behavior cannot be constructed", "behavior generates")
)
def test_a_mistake_in_a_class_or_constructor_is_refused(name: str, project: Path) -> None:
    said = write(project, REFUSED[name])
    ended = run("--json")
    assert (ended.exit_code, ended.stdout) == (2, ""), ended.output
    assert "wrong" in ended.stderr
    assert said in ended.stderr


@pytest.mark.parametrize("name", some(list(FILES), "a syntax error", "a missing library"))
def test_a_file_that_cannot_be_imported_is_named(name: str, project: Path) -> None:
    code, said = FILES[name]
    stack = "base: default\nbehaviors:\n  wrong:\n"
    texts = {"navfw.toml": "", "plugins/wrong.py": code, "stacks/wrong.yaml": stack}
    put_files(project, texts)
    ended = run("--json")
    assert (ended.exit_code, ended.stdout) == (2, ""), ended.output
    assert "plugins/wrong.py" in ended.stderr
    assert said in ended.stderr


@pytest.mark.parametrize(
    ("kind", "body", "said"),
    [
        (
            "behavior",
            "def propose(self, context):\n    answer = " + NOTHING + "\n"
            "    return replace(answer, explain=lambda row=0, column=0: 1 / 0)",
            "behavior wrong: ZeroDivisionError",
        ),
        (
            "behavior",
            "def propose(self, context):\n    answer = " + NOTHING + "\n"
            "    return replace(answer, explain=lambda row=0, column=0: [{'why': 1}])",
            "behavior wrong: AnswerError: rule is a NoneType, expected a text",
        ),
        ("composite", "def explain(self):\n    1 / 0", "composite wrong: ZeroDivisionError"),
    ],
)
@pytest.mark.thorough
def test_an_explanation_that_fails_is_reported_in_its_place(
    kind: str, body: str, said: str, project: Path
) -> None:
    write(project, Mistake(kind, body, said))
    ended = run("--record")
    assert ended.exit_code == 1, ended.output  # of the time limit: the run is not affected
    assert "wrong" not in ended.stdout
    explained = invoke("explain", "result", "--at", "2")
    assert explained.exit_code == 0, explained.output
    assert said in explained.stdout


@pytest.mark.parametrize("code", ["print('{noise')", "os.chdir('/')", "answer.desirability.sum()"])
@pytest.mark.thorough
def test_what_does_no_harm_is_no_fault(code: str, project: Path) -> None:
    write(project, main("behavior", f"{code}; return answer", ""))
    ended = run("--json")
    result = json.loads(ended.stdout)
    assert (result["outcome"], result["faults"]) == ("timeout", [])
    assert (project / "result" / "result.json").is_file()


HANGS = (
    "import numba\n"
    + """
@numba.njit
def endless(x):
    while x > 0.0:
        x = x + 1.0 if x < 1e9 else 1.0
    return x
"""
)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("endless(1.0)", "exceeded the wall-clock limit"),
        ("__import__('ctypes').string_at(0)", "the process of the run ended (SIGSEGV)"),
    ],
)
def test_a_run_that_hangs_or_crashes_beyond_any_signal_has_a_result(
    code: str, said: str, project: Path
) -> None:
    write(project, main("behavior", code, ""))
    file = project / "plugins" / "wrong.py"
    file.write_text(file.read_text().replace("\n\nclass ", f"\n{HANGS}\n\nclass "))
    words = ("run", "empty", "straight", "--stack", "wrong", "--quiet", "--out", "result")
    patience = "import navfw.cli.supervisor as s, navfw.cli.run as r; s.PATIENCE = r.PATIENCE = 1\n"
    done = python(patience + PROGRAM, *words, "--json", "--limit", "20", cwd=project, timeout=200)
    assert done.returncode == 1, done.stderr
    result = json.loads(done.stdout)
    assert result["outcome"] == "fault"
    assert result["reason"].startswith("behavior wrong: wrong.py:")
    assert result["reason"].endswith(f", in propose: {said}")
    assert (
        json.loads((project / "result" / "result.json").read_text())["reason"] == result["reason"]
    )
