"""Maps and robots for the tests of PAPFIS."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from navfw.papfis.papfis import Papfis
from navfw.robot import RobotModel
from navfw.signals import Belief, Pose, Waypoint
from navfw.topomap import Passage, Place, TopoMap, load_map

MAPS = Path(__file__).parents[2] / "maps"


def office() -> TopoMap:
    """The shipped map of the office."""
    return load_map(MAPS / "office.yaml")


def joined(a: Place, b: Place, length: float | None = None, **values: float) -> Passage:
    """A passage between two places, straight unless it has a length."""
    return Passage(a.name, b.name, a.distance(b.x, b.y) if length is None else length, **values)


def line(*places: Place, **values: float) -> list[Passage]:
    """Passages from each place to the next."""
    return [joined(a, b, **values) for a, b in pairwise(places)]


def row(*places: Place, **values: float) -> TopoMap:
    """A map of places, each joined to the next."""
    return TopoMap("row", places, line(*places, **values))


def goal(x: float, y: float, place: str = "goal", tolerance: float = 0.3) -> Waypoint:
    """A final waypoint at (x, y) [m]."""
    return Waypoint(x, y, tolerance, place, "goal", final=True)


def belief(x: float, y: float, sigma: float = 0.0) -> Belief:
    """A position estimate with standard deviation ``sigma`` [m], an exact one by default."""
    return Belief(0.0, Pose(x, y, 0.0), np.diag([sigma**2, sigma**2, 0.0]))


def next_waypoint(papfis: Papfis, x: float, y: float) -> Waypoint:
    """The planner's waypoint from (x, y) [m], where the last goal is still ahead."""
    waypoint = papfis.update(belief(x, y))
    assert waypoint is not None
    return waypoint


@st.composite
def random_maps(draw: st.DrawFn) -> TopoMap:
    """Up to 12 distinct places with random passages, some longer than straight, some dangerous."""
    tens = st.integers(-100, 100)
    points = draw(st.lists(st.tuples(tens, tens), min_size=2, max_size=12, unique=True))
    places = [Place(f"p{i}", x / 10, y / 10) for i, (x, y) in enumerate(points)]
    pairs = [(a, b) for i, a in enumerate(places) for b in places[:i]]
    chosen = draw(st.lists(st.sampled_from(pairs), min_size=1, max_size=25, unique=True))
    share = st.floats(0.0, 1.0)
    passages = [
        joined(
            a,
            b,
            length=math.dist((a.x, a.y), (b.x, b.y)) * draw(st.sampled_from([1.0, 1.0, 1.5, 4.0])),
            width=draw(st.sampled_from([0.5, 0.8, 1.2, 3.0])),
            danger=draw(st.sampled_from([0.0, 0.0, 0.4, 1.0])),
            uncertainty=draw(share),
        )
        for a, b in chosen
    ]
    return TopoMap("random", places, passages)


def planner(topo_map: TopoMap, *goals: Waypoint, **params: float) -> Papfis:
    """A planner that has begun to drive to ``goals``."""
    papfis = Papfis(RobotModel(), Papfis.Params(**params))
    papfis.reset()
    papfis.start(topo_map, goals)
    return papfis
