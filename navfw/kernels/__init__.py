"""The compiled functions of navfw, and their compilation ahead of need on all cores."""

from __future__ import annotations

from navfw.kernels.kernel_list import Kernel, groups_of, listed_kernels, parse_types
from navfw.kernels.parallel_compilation import CompilationState, compile_kernels

__all__ = [
    "CompilationState",
    "Kernel",
    "compile_kernels",
    "groups_of",
    "listed_kernels",
    "parse_types",
]
