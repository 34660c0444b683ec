from .built_in import BUILT_IN as BUILT_IN
from .plugin_import import plugin as plugin
from .registry import Registry as Registry
from .registry import default_registry as default_registry
