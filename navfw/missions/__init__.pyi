from .oracle import SimulatorTruth as SimulatorTruth
from .pilot import Simulator as Simulator
from .runner import MissionLoop as MissionLoop
from .session import MissionResult as MissionResult
from .session_setup import prepare as prepare
