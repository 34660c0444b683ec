from .monitor import PersistentFailure as PersistentFailure
from .monitor import SafetyMonitor as SafetyMonitor
from .monitor import SafetyParams as SafetyParams
from .monitor import SafetyVerdict as SafetyVerdict
