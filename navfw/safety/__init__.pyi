from .monitor import MOVED as MOVED
from .monitor import MOVED_SLIGHTLY as MOVED_SLIGHTLY
from .monitor import PersistentFailure as PersistentFailure
from .monitor import SafetyMonitor as SafetyMonitor
from .monitor import SafetyParams as SafetyParams
from .monitor import SafetyVerdict as SafetyVerdict
from .monitor import Senses as Senses
