from .conflict_prediction import ConflictPredictor as ConflictPredictor
from .conflict_prediction import MoverParams as MoverParams
from .multi_view import MultiViewDetector as MultiViewDetector
from .tracking import Tracker as Tracker
