"""Both ends of every number of a mission's robot and sensors, of the stack and of its plugins.

Each is either driven for some frames without a fault, or refused when it is read.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Annotated, Any, get_args, get_origin

import pytest
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from navfw.errors import InputError
from navfw.fuzzy.rulespec import InputSpec, OutputSpec
from navfw.missions import prepare
from navfw.missions.missionspec import MissionSpec
from navfw.missions.outcome import Outcome
from navfw.plugins import default_registry
from navfw.sim import WorldSpec
from navfw.stack.stack_document import STAGES
from navfw.stack.stackfile import StackSettings
from navfw.suite.suitefile import SuiteSpec
from navfw.topomap.mapspec import EdgeSpec, MapSpec


@dataclass(frozen=True)
class BoundedNumber:
    """A number of a model: where it is, and its least and largest value (None: unbounded).

    ``path`` leads to it from the outermost model; ``[]`` stands for an item of a list or mapping.
    """

    model: type[BaseModel]
    path: tuple[str, ...]
    whole: bool
    least: float | None
    most: float | None
    open_least: bool = False
    open_most: bool = False

    @property
    def key(self) -> str:
        return ".".join(self.path)

    @property
    def field(self) -> str:
        return next(step for step in reversed(self.path) if step != "[]")

    @property
    def ends(self) -> tuple[float, float]:
        """The least and largest values inside; just inside of ends that are excluded."""
        assert self.least is not None, f"{self.key} has no lower bound"
        assert self.most is not None, f"{self.key} has no upper bound"
        inset = 1e-6 * (self.most - self.least)
        ends = self.least + self.open_least * inset, self.most - self.open_most * inset
        return (round(ends[0]), round(ends[1])) if self.whole else ends


def numbers_of(model: type[BaseModel], path: tuple[str, ...] = ()) -> Iterator[BoundedNumber]:
    """All numbers of ``model`` and of the models in it."""
    for name, info in model.model_fields.items():
        yield from _numbers(model, (*path, info.alias or name), info.annotation, info.metadata)


def _numbers(
    model: type[BaseModel], path: tuple[str, ...], annotation: Any, metadata: Iterable[Any]
) -> Iterator[BoundedNumber]:
    origin, args = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        fields = (item.metadata if isinstance(item, FieldInfo) else [item] for item in args[1:])
        yield from _numbers(model, path, args[0], (*chain.from_iterable(fields), *metadata))
    elif annotation in (int, float):
        keys = ("ge", "gt", "le", "lt")
        limits = {k: getattr(item, k) for item in metadata for k in keys if hasattr(item, k)}
        ends = limits.get("ge", limits.get("gt")), limits.get("le", limits.get("lt"))
        whole = annotation is int
        yield BoundedNumber(model, path, whole, *ends, "gt" in limits, "lt" in limits)
    elif isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield from numbers_of(annotation, path)
    else:
        collection = isinstance(origin, type)  # a list, tuple or mapping, not a union
        for arg in args:
            yield from _numbers(model, (*path, "[]") if collection else path, arg, metadata)


SHORT = "mission.timeout=1.3"
"""Long enough for the standstill at the start and three frames."""

CHECKED_ELSEWHERE: dict[type[BaseModel], set[str]] = {
    EdgeSpec: {"length", "width"},  # against the places; a passage may be wide without bound
    InputSpec: {"range", "terms"},  # against each other
    OutputSpec: {"range", "terms", "default"},
}


def plugins() -> Iterator[tuple[str, str, type[BaseModel]]]:
    registry = default_registry()
    for row in registry.listing(None):
        yield row["kind"], row["name"], registry.get(row["kind"], row["name"]).Params


def every_number() -> Iterator[BoundedNumber]:
    files = (MissionSpec, WorldSpec, StackSettings, SuiteSpec, MapSpec)
    yield from chain.from_iterable(numbers_of(model) for model in files)
    yield from chain.from_iterable(numbers_of(params, (name,)) for _, name, params in plugins())


def test_every_number_of_every_file_has_bounds() -> None:
    without = {
        f"{number.model.__qualname__}.{number.field}"
        for number in every_number()
        if number.least is None or number.most is None
        if number.field not in CHECKED_ELSEWHERE.get(number.model, set())
    }
    assert not without


def driven() -> Iterator[tuple[str, tuple[str, ...], BoundedNumber]]:
    """Name of an override, the overrides that it needs, and the number."""
    for number in numbers_of(MissionSpec):
        if number.path[0] in ("robot", "sensors") and "[]" not in number.path:
            needs = ("mission.robot.side_views={}",) if "side_views" in number.path else ()
            yield f"mission.{number.key}", needs, number
    for number in numbers_of(StackSettings):
        if "[]" not in number.path:
            yield number.key, ("movers.detect=true", "stixels=true"), number
    for kind, name, params in plugins():
        for number in numbers_of(params):
            if "[]" in number.path:
                continue
            if kind in STAGES:
                yield f"{kind}.{name}.{number.key}", (f"{kind}={{{name}: {{}}}}",), number
            elif kind == "behavior":
                yield f"behaviors.{name}.{number.key}", (), number


def outcome(overrides: Sequence[str]) -> str:
    """How a short run with ``overrides`` ends; ``refused`` if one of them is."""
    try:
        session = prepare("paper-room", "through-the-door", overrides=[SHORT, *overrides])
    except InputError:
        return "refused"
    result = session.run()
    assert not result.summary()["faults"], overrides
    return str(result.outcome)


ENDS = [
    pytest.param(name, needs, value, id=f"{name}={value:g}")
    for name, needs, number in driven()
    for value in number.ends
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "needs", "value"), ENDS)
def test_each_end_is_driven_or_refused(name: str, needs: tuple[str, ...], value: float) -> None:
    assert outcome([*needs, f"{name}={value!r}"]) != Outcome.FAULT


PACKS: dict[str, Callable[[str], bool]] = {
    "sensors": lambda name: name.startswith("mission.sensors.") and "supersample" not in name,
    "odometry": lambda name: name.startswith("mission.robot.odometry."),
    "drive": lambda name: name.startswith("mission.robot.max_") or "ticks_per_turn" in name,
    "tracking": lambda name: name.startswith("movers.tracking."),
}
"""Numbers that can be at the same end together, by their names."""


@pytest.mark.parametrize("end", [0, 1], ids=["least", "most"])
@pytest.mark.parametrize("pack", PACKS)
def test_ends_that_do_not_interact_are_driven_together(pack: str, end: int) -> None:
    chosen = [(name, needs, number.ends[end]) for name, needs, number in driven()]
    chosen = [item for item in chosen if PACKS[pack](item[0])]
    assert len(chosen) > 3
    needed = dict.fromkeys(chain.from_iterable(needs for _, needs, _ in chosen))
    changes = [f"{name}={value!r}" for name, _, value in chosen]
    assert outcome([*needed, *changes]) == Outcome.TIMEOUT


def test_the_largest_camera_image_is_driven() -> None:
    camera = "mission.robot.camera"
    size = [f"{camera}.width=1920", f"{camera}.height=1080", f"{camera}.rate=1"]
    assert outcome(size) == Outcome.TIMEOUT
