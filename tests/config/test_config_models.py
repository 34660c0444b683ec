from __future__ import annotations

import enum
from typing import Annotated, Any, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from navfw.config.document import parse_yaml
from navfw.config.error_location import parameters_of
from navfw.config.overrides import apply_overrides
from navfw.config.yamlfile import MAX_LISTED, check, validate
from navfw.errors import ConfigError
from navfw.robot import RobotModel


class Spec(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Box(Spec):
    kind: Literal["box"]
    size: tuple[float, float]


class Cylinder(Spec):
    kind: Literal["cylinder"]
    radius: Annotated[float, Field(gt=0, description="of the body [m]")]


class Light(enum.Enum):
    DIM = "dim"
    BRIGHT = "bright"


class Room(Spec):
    name: str
    wall: Box | str = "plaster"
    doors: Annotated[int, Field(ge=0, le=4)] = 1
    tags: Annotated[tuple[str, ...], Field(min_length=1)] = ("room",)


class World(Spec):
    rooms: Annotated[list[Room], Field(min_length=1)]
    shapes: list[Box | Cylinder] = []
    one: Box | Cylinder | None = None
    places: dict[str, Room] = {}
    light: Light = Light.BRIGHT
    floor: Literal["carpet", "tiles"] = "carpet"
    open: bool = False
    height: float | None = None
    either: int | list[float] | Box = 1
    title: Annotated[str, Field(min_length=1)] = "x"
    from_: Annotated[str, Field(alias="from")] = ""
    anything: Any = None
    low: float = 0.0
    high: float = 1.0

    @field_validator("height")
    @classmethod
    def _no_cellar(cls, value: float | None) -> float | None:
        if value is not None and value < 0:
            raise ValueError("a room is not upside down")
        return value

    @model_validator(mode="after")
    def _ordered(self) -> World:
        if self.low > self.high:
            raise ValueError(f"low {self.low:g} is above high {self.high:g}")
        return self


GOOD = "rooms: [{name: lobby}]\n"


def error(text: str, *overrides: str) -> str:
    """The message for this text as a World, which is expected to fail."""
    with pytest.raises(ConfigError) as caught:
        validate(apply_overrides(parse_yaml(text, "w.yaml"), overrides), World)
    return str(caught.value)


def rows(table: str) -> list[list[str]]:
    r"""The rows of a table of texts (with \n between lines) and messages."""
    return [row.replace(r"\n", "\n").split(" | ") for row in table.strip().splitlines()]


ERRORS = r"""
ligth: dim | w.yaml:2: ligth: unknown key; did you mean 'light'?
shapes: [{kind: box, size: [1, 2], sice: 3}] | shapes[0].sice: unknown key; did you mean 'size'?
places:\n  lab: {nam: x, name: y} | w.yaml:3: places.lab.nam: unknown key; did you mean 'name'?
shapes: [7] | shapes[0]: expected a mapping, got 7
one: {kind: cylinder, radius: 0} | one.radius: expected a number > 0 (of the body [m]), got 0
one: {kind: cylinder, radios: 1} | one.radius: missing; expected a number > 0
shapes: [{kind: box, size: [1]}] | shapes[0].size[1]: missing; expected a number
shapes: [{kind: box, size: [1, 2, 3]}] | shapes[0].size: expected a list of 2 numbers, got 3 items
shapes: [{kind: box, size: [1, wide]}] | size[1]: expected a number, got the text 'wide'
floor: tile | floor: expected one of carpet, tiles, got the text 'tile'; did you mean 'tiles'?
light: bride | light: expected one of dim, bright, got the text 'bride'; did you mean 'bright'?
light: 3 | light: expected one of dim, bright, got 3
open: yes | open: expected true or false, got the text 'yes'
open: 1 | open: expected true or false, got 1
height: '3' | height: expected a number or null, got the text '3'
height: true | height: expected a number or null, got true
height: .inf | height: expected a number or null, got inf
height: .nan | height: expected a number or null, got nan
height: -1 | height: a room is not upside down
either: {a: 1} | either.a: unknown key; known: kind, size
either: {kind: box, size: [1, x]} | either.size[1]: expected a number, got the text 'x'
either: [1, x] | either[1]: expected a number, got the text 'x'
either: wide | either: expected a whole number or a list of numbers or a mapping, got the text
title: 3 | title: expected text with length >= 1, got 3; quote it to make it text
title: '' | title: expected text with length >= 1, got the text ''
from: [a] | from: expected text, got the list ['a']
form: a | form: unknown key; did you mean 'from'?
places: [a] | places: expected a mapping to mappings, got the list ['a']
places: {a: 3} | places.a: expected a mapping, got 3
low: 3 | w.yaml:1: low 3 is above high 1
"""


@pytest.mark.parametrize(("text", "message"), rows(ERRORS))
def test_errors_name_key_expected_and_actual_value(text: str, message: str) -> None:
    assert message in error(GOOD + text)


ERRORS_IN_LISTS = r"""
rooms: [] | w.yaml:1: rooms: expected a list of mappings with length >= 1, got 0 items
rooms:\n- nam: lobby | w.yaml:2: rooms[0].name: missing; expected text
rooms:\n- name: 101 | rooms[0].name: expected text, got 101; quote it to make it text
rooms: [{name: a, doors: 5}] | rooms[0].doors: expected a whole number >= 0 and <= 4, got 5
rooms: [{name: a, doors: 1.5}] | rooms[0].doors: expected a whole number >= 0 and <= 4, got 1.5
rooms: [{name: a, tags: []}] | rooms[0].tags: expected a list of texts with length >= 1
rooms: [{name: a, wall: {kind: box, size: x}}] | rooms[0].wall.size: expected a list of 2 numbers
rooms: [{name: a, wall: 3}] | rooms[0].wall: expected a mapping or text, got 3
rooms: [null] | rooms[0]: expected a mapping, got nothing
{} | w.yaml:1: rooms: missing; expected a list of mappings
"""


@pytest.mark.parametrize(("text", "message"), rows(ERRORS_IN_LISTS))
def test_errors_in_lists_name_the_item(text: str, message: str) -> None:
    assert message in error(text)


def test_problems_are_listed_in_the_order_of_the_file() -> None:
    lines = error("low: x\nrooms:\n- {name: a, doors: 9}\n- {}\nfloor: mud\nhigh: y\n").splitlines()
    keys = {1: "low", 3: "rooms[0].doors", 4: "rooms[1].name", 5: "floor", 6: "high"}
    places = [f"w.yaml:{line}: {key}" for line, key in keys.items()]
    assert [": ".join(line.split(": ")[:2]) for line in lines] == places


def test_a_union_and_an_invalid_item_of_a_short_list_are_one_problem() -> None:
    assert len(error(GOOD + "either: wide").splitlines()) == 1
    assert len(error(GOOD + "either: [a, 1]").splitlines()) == 1
    (line,) = error(GOOD + "places: {a: {name: a, tags: [1]}}").splitlines()
    assert "places.a.tags[0]: expected text, got 1" in line


def test_a_valid_file_becomes_the_model() -> None:
    text = GOOD + "one: {kind: box, size: [1, 2]}\nlight: dim\nheight: 3\nfrom: a\n"
    world = validate(parse_yaml(text), World)
    assert world.one == Box(kind="box", size=(1.0, 2.0))
    assert (world.light, world.height, world.from_) == (Light.DIM, 3.0, "a")


def test_a_part_is_validated_with_its_whole_path_and_counts_as_empty_where_absent() -> None:
    document = parse_yaml("stages:\n  flow:\n    rows: x\n", "s.yaml")
    with pytest.raises(ConfigError, match=r"s\.yaml:3: stages\.flow\.rows: unknown key"):
        validate(document, Box, at=("stages", "flow"))
    document = parse_yaml("robot:\n")
    assert validate(document, RobotModel, at=("robot",)) == RobotModel()
    assert validate(document, RobotModel, at=("nothing", "here")) == RobotModel()


def test_check_returns_the_problems() -> None:
    result, problems = check(parse_yaml("kind: box", "w.yaml"), Box)
    assert result is None
    assert [(p.path, p.origin.line) for p in problems] == [(("size",), 1)]
    result, problems = check(parse_yaml("{kind: box, size: [1, 2]}"), Box)
    assert result is not None and problems == []


def test_overrides_change_add_and_index() -> None:
    document = parse_yaml(GOOD + "shapes:\n- {kind: box, size: [1, 2]}\n")
    overrides = (
        "rooms.0.name=lab",
        "rooms.lab.doors=3",
        "shapes.0.size.1=5",
        "height=2.5",
        "one={kind: cylinder, radius: 2}",
        "places.lab.name='7'",
        "from=a=b",
    )
    world = validate(apply_overrides(document, overrides), World)
    assert (world.rooms[0].name, world.rooms[0].doors) == ("lab", 3)
    assert world.shapes[0] == Box(kind="box", size=(1.0, 5.0))
    assert world.one == Cylinder(kind="cylinder", radius=2)
    assert (world.height, world.places["lab"].name, world.from_) == (2.5, "7", "a=b")


ERRORS_OF_OVERRIDES = r"""
high=x | --set high=x: expected a number, got the text 'x'
rooms.0.doors=9 | --set rooms.0.doors=9: rooms[0].doors: expected a whole number >= 0
hihg=2 | --set hihg=2: unknown key; did you mean 'high'?
places.lab.nam=x | --set places.lab.nam=x: unknown key; did you mean 'name'?
one={kind: box, size: [1, x]} | --set one={kind: box, size: [1, x]}: one.size[1]: expected a number
foo.bar.baz=1 | --set foo.bar.baz=1: foo: unknown key; did you mean
rooms.3.name=x | --set rooms.3.name=x: rooms has 1 items, counted from 0
rooms.loby.doors=1 | rooms is a list: expected an index or a name, got 'loby'; did you mean 'lobby'?
rooms.0.name.x=1 | --set rooms.0.name.x=1: rooms[0].name is 'lobby' and contains no 'x'
high | --set high: expected key=value
=3 | --set =3: expected key=value
a..b=3 | --set a..b=3: expected key=value
high=[1 | --set high=[1: expected a YAML value after '='
low=5 | w.yaml:1: low 5 is above high 1 (with --set low=5)
"""


@pytest.mark.parametrize(("override", "message"), rows(ERRORS_OF_OVERRIDES))
def test_errors_name_the_override(override: str, message: str) -> None:
    assert message in error(GOOD, override)


def test_errors_of_the_file_do_not_name_a_valid_override() -> None:
    assert error(GOOD + "floor: mud", "high=3").startswith("w.yaml:2: floor: ")


def test_an_override_can_replace_an_invalid_value() -> None:
    document = parse_yaml(GOOD + "floor: mud\n", "w.yaml")
    mended = apply_overrides(document, ["floor=mud", "floor=tiles"])
    assert validate(mended, World).floor == "tiles"
    assert document.data["floor"] == "mud"  # the original stays as it was


def test_parameters_of_a_model() -> None:
    class Params(Spec):
        rows: Annotated[int, Field(ge=2, le=120, description="rows of the grid")] = 12
        gain: Annotated[float, Field(gt=0, description="[1/s]")]
        mode: Literal["fast", "good"] = "good"
        window: tuple[float, float] | None = (1.0, 2.0)
        names: list[str] = Field(default_factory=list, max_length=3)
        box: Box = Box(kind="box", size=(1, 2))

    rows = {p.name: p._asdict() for p in parameters_of(Params)}
    expected: dict[str, dict[str, Any]] = {
        "rows": {
            "name": "rows",
            "type": "int",
            "default": 12,
            "required": False,
            "bounds": ">= 2 and <= 120",
            "description": "rows of the grid",
        },
        "gain": {"required": True, "default": None, "bounds": "> 0"},
        "mode": {"type": "fast | good"},
        "window": {"type": "tuple[float, float] | None", "default": [1.0, 2.0]},
        "names": {"type": "list[str]", "default": [], "bounds": "with length <= 3"},
        "box": {"default": {"kind": "box", "size": [1.0, 2.0]}},
    }
    assert {name: rows[name] | part for name, part in expected.items()} == rows


def test_problems_are_listed_up_to_a_bound() -> None:
    keys = "".join(f"key-{number}: 1\n" for number in range(60))
    lines = error(f"{GOOD}{keys}").splitlines()
    assert len(lines) == MAX_LISTED + 1
    assert "key-49: unknown key" in lines[-2]
    assert lines[-1] == f"and {60 - MAX_LISTED} more"
