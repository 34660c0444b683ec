from .behavior_check import check_behavior as check_behavior
from .behavior_check import check_composite as check_composite
from .behavior_scenes import SCENES as SCENES
from .behavior_scenes import contexts_of as contexts_of
from .mission_assertions import assert_behavior_led as assert_behavior_led
from .mission_assertions import assert_clearance as assert_clearance
from .mission_assertions import assert_no_collision as assert_no_collision
from .mission_assertions import assert_reached as assert_reached
from .mission_assertions import assert_visited as assert_visited
from .mission_run import MissionRun as MissionRun

__all__: list[str]
