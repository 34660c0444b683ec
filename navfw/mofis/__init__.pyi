from .fusion import FuzzyFusion as FuzzyFusion
from .mofis import DecisionInputs as DecisionInputs
from .mofis import Mofis as Mofis
from .mofis import explain_command as explain_command
from .rules import BehaviorRules as BehaviorRules
