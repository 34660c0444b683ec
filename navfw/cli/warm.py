"""``navfw warm``: compile navfw's kernels ahead of need, for images of machines and CI caches."""

from __future__ import annotations

from navfw.cli.output import echo
from navfw.cli.progress_bar import ProgressBar, Quiet


def warm(quiet: Quiet = False) -> None:
    """Compile all kernels that are not compiled yet, on all cores."""
    compiled = compile_with_progress(quiet=quiet)
    echo(f"{compiled} kernels compiled" if compiled else "all kernels are compiled")


def compile_with_progress(*, loaded: bool = False, quiet: bool = False) -> int:
    """Compile what is missing, with ``loaded`` for imported modules only; returns the number.

    The bar appears only when something is compiled.
    """
    from navfw.process import compile_kernels

    with ProgressBar("compiling", "kernels", quiet=quiet, moving=True) as bar:
        return compile_kernels(bar.update, loaded=loaded)
