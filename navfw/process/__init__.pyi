from .kernel_compilation import compile_kernels as compile_kernels
from .kernel_compilation import listed_kernels as listed_kernels
from .watchdog import PluginTimeout as PluginTimeout
