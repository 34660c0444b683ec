"""String pulling: the farthest point of the route that a straight line reaches, and the tour."""

from dataclasses import replace

import numpy as np
import pytest
from papfis_maps import belief, goal, line, planner

from navfw.localmap import LocalMap
from navfw.numerics import Array, Mask
from navfw.papfis.papfis import Papfis
from navfw.papfis.string_pulling import SURE_SIGHT
from navfw.robot import RobotModel
from navfw.signals import Odometry, PassageReport, Pose, SightLines, Twist, Waypoint
from navfw.topomap import Place, TopoMap
from navfw.topomap.occupancy_map import FREE, OCCUPIED, OccupancyMap

RADIUS = RobotModel().radius
HALL, CORNER, DOOR, ROOM = (
    Place("hall", 0.0, 0.0),
    Place("corner", 3.0, 0.0),
    Place("door", 3.0, 2.0, "door"),
    Place("room", 3.0, 4.0),
)


def bend(width: float, gap: float = 1.0, plan: OccupancyMap | None = None) -> TopoMap:
    """A corner, and beyond it a door into a room; passages are ``width`` wide, the door ``gap``."""
    passages = [*line(HALL, CORNER, width=width), *line(CORNER, DOOR, ROOM, width=gap)]
    return TopoMap("bend", [HALL, CORNER, DOOR, ROOM], passages, floor_plan=plan)


def lines_from(
    papfis: Papfis, at: tuple[float, float], clearance: float = 1.0, observed: bool = True
) -> SightLines:
    """The lines that a local map reports in which everything is that free."""
    robot = RobotModel()
    local = LocalMap(robot)
    odometry = Odometry(0.0, Pose(*at, 0.0), Twist(0.0, 0.0), 0.0, still=True)
    local.update(odometry, (), None, odometry.pose)
    report = local.passage_report(lambda: papfis.queries, odometry, belief(*at))
    assert report is not None and report.lines is not None
    shape = report.lines.clearance.shape
    rooms: Array = np.full(shape, clearance)
    seen: Mask = np.full(shape, observed)
    return replace(report.lines, clearance=rooms, observed=seen)


def headed(papfis: Papfis, at: tuple[float, float], lines: SightLines | None) -> Waypoint:
    papfis.observe(PassageReport(1.0, (), (), (), lines))
    waypoint = papfis.update(belief(*at))
    assert waypoint is not None
    return waypoint


def started(topo_map: TopoMap, at: tuple[float, float] = (0.5, 0.0)) -> Papfis:
    papfis = planner(topo_map, goal(3.0, 4.0, "room"))
    assert papfis.update(belief(*at)) is not None
    return papfis


def test_over_floor_observed_free_the_robot_heads_past_the_corner() -> None:
    papfis = started(bend(1.0))
    assert papfis.update(belief(0.5, 0.0)).place == "corner"  # type: ignore[union-attr]
    waypoint = headed(papfis, (0.5, 0.0), lines_from(papfis, (0.5, 0.0)))
    assert (waypoint.x, waypoint.y, waypoint.place) == (3.0, 4.0, "room")
    assert waypoint.final


@pytest.mark.parametrize(
    ("clearance", "place"), [(0.09, "corner"), (-0.1, "corner"), (0.4, "room")]
)
def test_a_line_needs_clearance(clearance: float, place: str) -> None:
    papfis = started(bend(1.0))
    lines = lines_from(papfis, (0.5, 0.0), clearance)
    assert headed(papfis, (0.5, 0.0), lines).place == place


def test_unobserved_floor_is_free_within_the_passages_only() -> None:
    papfis = started(bend(1.0))
    lines = lines_from(papfis, (0.5, 0.0), observed=False)
    near = headed(papfis, (0.5, 0.0), lines)
    # 0.5 m half width less the body's radius, and 0.1 m: the line leaves one strip in the other
    room = 0.5 - RADIUS - 0.1
    assert near.place == "door"
    assert near.y == pytest.approx(room * 2.5 / (2.5 - room), abs=0.1)
    wide = started(bend(2.0, 2.0))
    lines = lines_from(wide, (0.5, 0.0), observed=False)
    assert headed(wide, (0.5, 0.0), lines).y > near.y


def test_no_line_leads_past_a_door_in_which_the_body_must_be_straight() -> None:
    papfis = started(bend(1.0, gap=2.0 * RADIUS + 0.3))
    waypoint = headed(papfis, (0.5, 0.0), lines_from(papfis, (0.5, 0.0)))
    assert waypoint.place == "corner"


def plan_with(wall: bool) -> OccupancyMap:
    cells = np.full((80, 80), FREE, dtype=np.int8)
    if wall:
        cells[38:42, 30:50] = OCCUPIED  # x 0.5 to 2.5, y 1.4 to 1.6
    return OccupancyMap(cells, 0.1, Pose(-2.0, -2.4, 0.0))


def test_the_floor_plan_bars_a_line_through_its_walls() -> None:
    for wall, place in ((False, "room"), (True, "door")):
        papfis = started(bend(1.0, plan=plan_with(wall)))
        lines = lines_from(papfis, (0.5, 0.0), observed=False)
        assert headed(papfis, (0.5, 0.0), lines).place == place, wall


def test_near_the_robot_what_it_sees_counts_and_far_away_the_map() -> None:
    for away, place in ((SURE_SIGHT - 0.5, "corner"), (SURE_SIGHT + 0.5, "room")):
        papfis = started(bend(1.0, plan=plan_with(wall=False)))
        lines = lines_from(papfis, (0.5, 0.0), observed=False)
        lengths = np.hypot(*(lines.ends - (0.5, 0.0)).T)[:, None]
        along = lengths * np.linspace(0.0, 1.0, lines.clearance.shape[1] + 1)[1:]
        blurred = np.where(np.abs(along - away) < 0.2, -0.1, 1.0)
        waypoint = headed(papfis, (0.5, 0.0), replace(lines, clearance=blurred))
        assert waypoint.place == place, away


def test_the_places_cut_off_count_as_passed_and_the_door_within_its_gap() -> None:
    papfis = started(bend(1.0))
    headed(papfis, (0.5, 0.0), lines_from(papfis, (0.5, 0.0)))
    for share in np.linspace(0.0, 1.0, 60):
        x, y = 0.5 + 2.5 * share, 4.0 * share
        if (waypoint := papfis.update(belief(x, y))) is None:
            break
        assert waypoint.place == "room"
    assert papfis.update(belief(3.0, 4.0)) is None
    assert papfis.replans == 0


def test_a_line_lasts_for_a_while_when_it_is_lost() -> None:
    papfis = started(bend(1.0))
    headed(papfis, (0.5, 0.0), lines_from(papfis, (0.5, 0.0)))
    places = [headed(papfis, (0.5, 0.0), None).place for _ in range(5)]
    assert places == ["room", "room", "room", "corner", "corner"]


def test_a_corner_is_cut_only_as_far_as_it_saves_way() -> None:
    """A line that is narrow all along must be shorter than the route by its price."""
    papfis = started(bend(1.0))
    roomy = headed(papfis, (0.5, 0.0), lines_from(papfis, (0.5, 0.0), clearance=0.35))
    papfis = started(bend(1.0), (2.6, 0.0))
    tight = headed(papfis, (2.6, 0.0), lines_from(papfis, (2.6, 0.0), clearance=0.11))
    assert (roomy.place, tight.place) == ("room", "corner")


def test_the_local_map_reports_lines_to_all_legs_but_the_first() -> None:
    papfis = started(bend(1.0))
    lines = lines_from(papfis, (0.5, 0.0))
    assert set(lines.legs.tolist()) == {1, 2}
    assert lines.ends[-1] == pytest.approx((3.0, 4.0))
    assert np.all(np.hypot(*(lines.ends - (0.5, 0.0)).T) <= 6.0)
