"""Every kind of plugin with every misdeed: the run ends with a result that names the plugin."""

import json
from pathlib import Path
from typing import Any

import pytest
from cli_calls import put_files
from processes import python

MISDEEDS = {
    "raises": "raise ValueError('on purpose')",
    "exits": "import sys; sys.exit(0)",
    "exits at once": "import os; os._exit(0)",
    "interrupts": "raise KeyboardInterrupt",
    "raises a bare exception": "raise BaseException('bare')",
    "none": "return 7",
    "list": "return [1.0, 2.0]",
    "nan": "return spoilt(answer, float('nan'))",
    "complex": "return spoilt(answer, 1j)",
    "wrong shape": "return spoilt(answer, None)",
    "mutates": "mutate(arguments); return answer",
    "sleeps": "import time; time.sleep(1000)",
    "loops": "\n        while True:\n            pass",
    "loops in compiled code": "\n        endless(1.0)",
    "disables the timer": "import signal, time; signal.setitimer(signal.ITIMER_REAL, 0)"
    "\n        while True:\n            time.sleep(0.01)",
    "threads": "import threading, time"
    "\n        if not hasattr(type(self), 'thread'):"
    "\n            type(self).thread = threading.Thread(target=time.sleep, args=(1000,))"
    "\n            type(self).thread.start()"
    "\n        return answer",
    "changes the folder": "import os; os.chdir('/'); return answer",
    "prints": "print('{noise'); return answer",
    "draws global random numbers": "import random; random.random(); return answer",
    "raises without end": "raise endless_error()",
    "raises a class without a name": "raise nameless_error()",
    "looks alive": "return Odd()",
    "forks": "import os; os.fork(); return answer",
    "leaves a process": "import subprocess"
    "\n        if self.calls == 3:"
    "\n            subprocess.Popen(['sleep', '1000'], stdin=subprocess.DEVNULL)"
    "\n        return answer",
    "signals itself": "import os, signal; os.kill(os.getpid(), signal.SIGTERM); return answer",
    "signals its parent": "import os, signal; os.kill(os.getppid(), signal.SIGTERM); return answer",
    "replaces math.hypot": "import math; math.hypot = lambda *x: 0.0; return answer",
    "replaces max": "import builtins; builtins.max = None; return answer",
    "replaces json.dumps": "import json; json.dumps = None; return answer",
    "replaces sha256": "import hashlib; hashlib.sha256 = None; return answer",
    "takes stdout away": "import sys; sys.stdout = None; return answer",
    "uses up the stack": "return spoilt(self.propose_deeply(), 1.0)",
    "replaces the safety monitor": "from navfw.safety import SafetyMonitor, SafetyVerdict"
    "\n        SafetyMonitor.limit = lambda self, twist, time, pose: SafetyVerdict(twist)"
    "\n        return answer",
}
"""Source of each misdeed, to stand in a method with ``answer`` and ``arguments``."""

HARMLESS = ("mutates", "prints", "forks")
"""Misdeeds after which the answer is right: nothing may happen."""

BASES = {
    "flow": ("navfw.flow.block_matching", "BlockMatching", "compute(pair)"),
    "perception": ("navfw.offis.offis", "Offis", "perceive(flow, twist)"),
    "features": ("navfw.features.recognizers", "NoFeatures", "recognize(frame)"),
    "localizer": (
        "navfw.localization.motion_model",
        "DeadReckoning",
        "update(odometry, percept, detections)",
    ),
    "planner": ("navfw.papfis.papfis", "Papfis", "update(belief)"),
    "behavior": ("navfw.interfaces", "Behavior", "propose(context)"),
    "composite": ("navfw.interfaces", "Composite", "weigh(context)"),
    "fusion": ("navfw.mofis.fusion", "FuzzyFusion", "fuse(context, proposals)"),
    "controller": ("navfw.locom.unicycle", "Unicycle", "control(command, odometry, dt)"),
}
"""Module, class and method with its parameters of the plugin derived from, by kind."""

_ANSWERS = {
    "behavior": "Proposal(0.0, *np.zeros((2, *context.commands.shape)), 'nothing')",
    "composite": "{}",
}

_FILE = '''
"""A plugin that does wrong."""
import dataclasses
import numba
import numpy as np
from navfw.signals import Proposal
from {module} import {base}


@numba.njit
def endless(x):
    while x > 0.0:
        x = x + 1.0 if x < 1e9 else 1.0
    return x


def spoilt(answer, value):
    """The answer with its first array or number replaced; (1, 1) zeros for None."""
    if isinstance(answer, dict):
        return {{**answer, "go_to_xy": value}}
    if not dataclasses.is_dataclass(answer):
        return [value]
    for field in dataclasses.fields(answer):
        old = getattr(answer, field.name)
        if isinstance(old, np.ndarray):
            new = np.zeros((1, 1)) if value is None else np.full(old.shape, value)
            return dataclasses.replace(answer, **{{field.name: new}})
    for field in dataclasses.fields(answer):
        if isinstance(getattr(answer, field.name), float | int):
            return dataclasses.replace(answer, **{{field.name: value}})
    twist = dataclasses.replace(answer.twist, v=value)
    return dataclasses.replace(answer, twist=twist)


def mutate(things, depth=0):
    """Try to change every array that is reachable."""
    for thing in things:
        if isinstance(thing, np.ndarray) and thing.dtype != object:
            try:
                thing[...] = 0
            except ValueError:
                pass
        elif dataclasses.is_dataclass(thing) and depth < 3:
            mutate([getattr(thing, f.name) for f in dataclasses.fields(thing)], depth + 1)


def endless_error():
    class Endless(Exception):
        def __str__(self):
            while True:
                pass
    return Endless()


def nameless_error():
    class Meta(type):
        @property
        def __name__(cls):
            raise SystemExit(0)
    class Nameless(Exception, metaclass=Meta):
        @property
        def __class__(self):
            raise SystemExit(0)
    return Nameless()


class Odd:
    """Raises whatever is asked of it."""

    def __getattribute__(self, name):
        raise SystemExit(0)

    def __repr__(self):
        raise SystemExit(0)

    __reduce__ = __eq__ = __bool__ = __len__ = __iter__ = __float__ = __repr__


class Wrongdoer({base}):
    """Does wrong from the third call on."""

    name = "wrongdoer"
    calls = 0

    def propose_deeply(self):
        return self.propose_deeply()

    def {method}(self, {parameters}):
        arguments = ({parameters},)
        answer = {answer}
        self.calls += 1
        if self.calls < 3:
            return answer
        {misdeed}
'''


def write_wrongdoer(folder: Path, kind: str, misdeed: str) -> None:
    """Write the project folder of a plugin ``wrongdoer`` of that kind."""
    module, base, call = BASES[kind]
    method, _, parameters = call.rstrip(")").partition("(")
    code = _FILE.format(
        module=module,
        base=base,
        method=method,
        parameters=parameters,
        answer=_ANSWERS.get(kind, f"super().{call}"),
        misdeed=MISDEEDS[misdeed],
    )
    plugin = "behaviors" if kind == "behavior" else kind
    stack = f"base: default\n{plugin}:\n  wrongdoer:\nsafety: {{give_up: 3}}\n"
    texts = {"navfw.toml": "", "plugins/wrongdoer.py": code, "stacks/wrong.yaml": stack}
    put_files(folder, texts)


SHORT_LIMITS = """
import navfw.cli
import navfw.process.watchdog
from navfw.guard import PluginGuard

PluginGuard.__init__.__defaults__ = (6.0, 20.0)
navfw.process.watchdog.GRACE = 1.0
navfw.cli.main()
"""
"""The ``navfw`` command with short time limits for plugins."""
ENDED = ("exits at once", "loops in compiled code", "disables the timer")
"""Misdeeds that end the process of the run; its supervisor writes the result."""
TOLD = (
    *("threads", "changes the folder", "draws global random numbers", "leaves a process"),
    "takes stdout away",
)
"""Misdeeds with a correct answer that are found when the run is over."""
ALTERS = tuple(name for name in MISDEEDS if name.startswith(("replaces", "signals")))
"""Misdeeds after which no result of the run is believed."""
VITAL = ("flow", "perception", "localizer", "planner", "fusion", "controller")
QUICK = {
    ("behavior", "exits"),
    ("fusion", "exits at once"),
    ("flow", "loops in compiled code"),
    ("controller", "threads"),
    ("behavior", "replaces max"),
    ("behavior", "leaves a process"),
}
"""Pairs that are tried by default; the others are slow in their sum."""
PAIRS = [
    pytest.param(kind, deed, marks=[] if (kind, deed) in QUICK else pytest.mark.slow)
    for kind in BASES
    for deed in MISDEEDS
]


def drive(folder: Path) -> dict[str, Any]:
    """The result of a short mission with the stack ``wrong`` of a project, as a process."""
    words = ["run", "paper-room", "through-the-door", "--json", "--stack", "wrong"]
    words += ["--set", "mission.timeout=8", "--out", "result"]
    done = python(SHORT_LIMITS, *words, cwd=folder, env={"NAVFW_TRUST": "1"}, timeout=120)
    assert done.returncode == 1, done.stderr
    assert "Traceback" not in done.stderr
    result: dict[str, Any] = json.loads(done.stdout)
    written = json.loads((folder / "result" / "result.json").read_text(encoding="utf-8"))
    assert written["outcome"] == result["outcome"]
    assert written["faults"] == result["faults"]
    return result


@pytest.mark.thorough
@pytest.mark.parametrize(("kind", "misdeed"), PAIRS)
def test_a_plugin_costs_its_own_calls_and_is_told(tmp_path: Path, kind: str, misdeed: str) -> None:
    write_wrongdoer(tmp_path, kind, misdeed)
    result = drive(tmp_path)
    told = " ".join([*result["faults"], result["reason"]])
    assert result.get("collisions", 0) == 0
    if misdeed in HARMLESS:
        assert (result["outcome"], result["faults"]) == ("timeout", [])
        return
    assert f"{kind} wrongdoer: " in told
    if misdeed in (*ENDED, *ALTERS) or (kind in VITAL and misdeed not in TOLD):
        assert result["outcome"] == "fault"
        assert f"{kind} wrongdoer: " in result["reason"]
    else:
        assert result["outcome"] == "timeout"
