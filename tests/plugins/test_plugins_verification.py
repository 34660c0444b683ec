"""The problems of a class as a plugin, and their messages."""

import re
import sys
import textwrap
from linecache import getline
from pathlib import Path
from typing import Annotated, Any, ClassVar

import pytest
from processes import run
from pydantic import Field

from navfw.errors import PluginError
from navfw.interfaces import KINDS, Behavior, FeatureRecognizer, Params
from navfw.plugins.verification import find_problems, kind_of, verify

PRELUDE = """
from typing import Annotated, Any, ClassVar
from pydantic import BaseModel, ConfigDict, Field
from navfw.interfaces import Behavior, FeatureRecognizer, Planner
"""


def build(text: str, name: str = "Thing") -> Any:
    """The class ``name`` that this code defines."""
    space: dict[str, Any] = {"__name__": "built"}
    # dont_inherit: else the class would have this file's postponed annotations
    code = compile(PRELUDE + textwrap.dedent(text), "built", "exec", dont_inherit=True)
    exec(code, space)  # noqa: S102 - the tests' own text
    return space[name]


class Good(Behavior):
    """Proposes nothing."""

    name: ClassVar[str] = "good"

    class Params(Behavior.Params):
        gain: Annotated[float, Field(gt=0, description="[1/s]")] = 1.0

    params: Params

    def propose(self, context: Any) -> Any:
        del context


def test_a_valid_plugin_has_no_problems() -> None:
    verify(Good)
    assert find_problems(Good) == []
    assert kind_of(Good) == "behavior"


def body(*lines: str, name: str = 'name = "thing"', base: str = "Behavior") -> Any:
    """A class with a docstring and these lines in it."""
    text = [f"class Thing({base}):", '    "Text."', f"    {name}"]
    return build("\n".join([*text, *(f"    {line}" for line in lines)]))


OK = "def propose(self, context): pass"
PARAMS = "class Params(Behavior.Params):"
PLANS = ("def start(self, topo_map, goals): 0", "def update(self, belief): 0")


@pytest.mark.parametrize(
    "thing",
    [
        body(
            "def __init__(self, robot, params=None, extra=3, *, more=4): pass",
            "def propose(self, context, fast=False, *rest, deep=True, **others): pass",
            "def reset(self, *args, **kwargs): pass",
        ),
        body("path = ()", *PLANS, base="Planner"),
    ],
    ids=["additional parameters with defaults", "an attribute in place of a property"],
)
def test_more_than_the_interface_is_allowed(thing: Any) -> None:
    assert find_problems(thing) == []


@pytest.mark.parametrize(
    ("cls", "message"),
    [
        (3, "expected a class, got 3"),
        (
            build("class Thing: pass"),
            "not derived from a base class of plugins; derive it from one of",
        ),
        (build("class Thing(Behavior, Planner): pass"), "derived from both Behavior and Planner"),
        (Behavior, "this is the base class itself"),
        (body(OK, name="pass"), 'no name; write: name: ClassVar[str] = "thing"'),
        (body(OK, name="name = 3"), "name must be text, got int"),
        (body(OK, name='name = "my thing"'), "name 'my thing' must be an identifier"),
        (body(OK, name='name = "a.b"'), "name 'a.b' must be an identifier"),
        (body(OK, name='name = "class"'), "name 'class' must be an identifier"),
        (body(OK, name='name = ""'), "name '' must be an identifier"),
        (body(OK, "kind = 'flow'"), "kind is set to 'flow'; remove it, the base class sets"),
        (
            build(f"class Thing(Behavior):\n    name = 'thing'\n    {OK}"),
            "no docstring; describe the plugin in a sentence",
        ),
        (body(), "missing propose(self, context); define it"),
        (
            body("def proposal(self, context): pass"),
            "missing propose(self, context); define it instead of 'proposal'",
        ),
        (
            body("def propose(self, ctx): pass"),
            "propose(self, ctx) has the wrong parameters: missing a required argument: 'ctx'; "
            "define propose(self, context)",
        ),
        (body("def propose(self): pass"), "propose(self) has the wrong parameters: too many"),
        (body("def propose(self, *args): pass"), "unexpected keyword argument 'context'"),
        (body("def propose(self, context, /): pass"), "'context' parameter is positional only"),
        (body("def propose(self, context, speed): pass"), "required argument: 'speed'"),
        (body("def propose(self, context, *, speed): pass"), "required argument: 'speed'"),
        (body("async def propose(self, context): pass"), "propose must not be async"),
        (body("def propose(self, context): yield 1"), "propose must return its result"),
        (body("propose = 3"), "propose must be a method, got int; define propose(self, context)"),
        (body("@staticmethod", "def propose(context): pass"), "plain method; remove @staticmethod"),
        (body("@classmethod", OK.replace("self", "cls")), "plain method; remove @classmethod"),
        (body(OK, "def reset(self, hard): pass"), "reset(self, hard) has the wrong parameters"),
        (
            body(OK, "def __init__(self, robot): pass"),
            "__init__(self, robot) has the wrong parameters: too many positional arguments; "
            "define __init__(self, robot, params=None)",
        ),
        (body(OK, "def __init__(self, robot, params): pass"), "required argument: 'params'"),
        (body(*PLANS, base="Planner"), "missing property path; define it"),
        (
            body(*PLANS, "def path(self): 0", base="Planner"),
            "path must be a property; put @property above it",
        ),
        (
            body("landmark_frames = property(len)", base="FeatureRecognizer"),
            "landmark_frames must be a value, not a property; write: landmark_frames = ...",
        ),
        (
            body(OK, "class Params(BaseModel): pass"),
            "Params is not derived from the base's; write: class Params(Behavior.Params)",
        ),
        (body(OK, "Params = 3"), "Params is not derived from the base's"),
        (
            body(OK, "class Parameters(BaseModel): pass"),
            "the nested model 'Parameters' is not used; call it Params",
        ),
        (body(OK, PARAMS, "    model_config = ConfigDict(extra='ignore')"), "accepts unknown keys"),
        (
            body(OK, PARAMS, "    gain: Annotated[float, Field(gt=0)] = -1.0"),
            "the default of Params.gain is invalid: input should be greater than 0, got -1.0;",
        ),
        (
            body(OK, PARAMS, "    a: int", "    gain: int = 'x'"),
            "default of Params.gain is invalid",
        ),
    ],
)
def test_errors_name_the_problem_and_its_remedy(cls: object, message: str) -> None:
    with pytest.raises(PluginError, match=re.escape(message)):
        verify(cls)


def test_an_inherited_name_is_not_enough() -> None:
    class Child(Good):
        """Text."""

    assert find_problems(Child) == [
        "no name of its own (it inherits 'good'); write: name: ClassVar[str] = \"child\""
    ]


def test_one_error_lists_all_problems_with_file_line_and_class() -> None:
    class Bad(FeatureRecognizer):
        name = "bad one"

    with pytest.raises(PluginError) as caught:
        verify(Bad)
    error = caught.value
    assert Path(str(error.file)).name == Path(__file__).name
    assert error.line is not None
    assert getline(__file__, error.line).strip() == "class Bad(FeatureRecognizer):"
    for part in ("class ", "Bad: ", "identifier", "no docstring", "missing recognize(self, frame)"):
        assert part in str(error)


@pytest.mark.parametrize("base", KINDS.values(), ids=str)
def test_every_interface_can_be_implemented_with_its_own_signatures(base: type[Any]) -> None:
    """A class that repeats the base's own signatures passes; one without a method does not."""
    methods = {name: vars(base)[name] for name in base.__abstractmethods__}

    def concrete(value: Any) -> Any:
        if isinstance(value, property):
            return property(lambda self: None)
        space: dict[str, Any] = {}
        code = value.__code__
        names = ", ".join(code.co_varnames[: code.co_argcount])
        exec(f"def method({names}): pass", space)  # noqa: S102
        return space["method"]

    space = {"__doc__": "Text.", "name": "thing"}
    whole = type("Thing", (base,), space | {n: concrete(v) for n, v in methods.items()})
    assert find_problems(whole) == []
    for missing in methods:
        part = {n: concrete(v) for n, v in methods.items() if n != missing}
        (problem,) = find_problems(type("Thing", (base,), space | part))
        assert "missing" in problem and missing in problem


def test_required_parameters_are_allowed() -> None:
    class Params_(Params):  # noqa: N801
        gain: float

    thing = type("Thing", (Good,), {"__doc__": "T.", "name": "thing", "Params": Params_})
    assert find_problems(thing) == []


def test_docstrings_are_not_asked_for_where_python_removes_them() -> None:
    code = (
        "from navfw.locom.unicycle import Unicycle; from navfw.plugins.verification import verify;"
        " print(Unicycle.__doc__); verify(Unicycle)"
    )
    done = run([sys.executable, "-OO", "-c", code])
    assert (done.stdout, done.stderr) == ("None\n", "")
