from .compiled_fis import CompiledFis as CompiledFis
from .compiled_fis import Inference as Inference
from .rulebase import RuleBase as RuleBase
from .rulebase import Variable as Variable
from .rulefile import TermCorners as TermCorners
from .rulefile import load_rule_base as load_rule_base
from .rulefile import parse_rule_base as parse_rule_base
