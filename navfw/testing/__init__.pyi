from .behavior_check import check_behavior as check_behavior
from .behavior_check import check_composite as check_composite
from .behavior_scenes import SCENES as SCENES
from .behavior_scenes import contexts_of as contexts_of
from .mission_run import MissionRun as MissionRun
from .mission_run import assert_behavior_led as assert_behavior_led
from .mission_run import assert_clearance as assert_clearance
from .mission_run import assert_no_collision as assert_no_collision
from .mission_run import assert_reached as assert_reached
from .mission_run import assert_visited as assert_visited

__all__: list[str]
