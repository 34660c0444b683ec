from .answers import number as number
from .plugin_guard import FailingStage as FailingStage
from .plugin_guard import PluginCallError as PluginCallError
from .plugin_guard import PluginGuard as PluginGuard
from .plugin_guard import construct as construct
from .plugin_guard import contained as contained
from .plugin_guard import label_of as label_of
