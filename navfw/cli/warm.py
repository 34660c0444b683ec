"""``navfw warm``: compile navfw's kernels ahead of need, for images of machines and CI caches."""

from __future__ import annotations

from navfw.cli.output import echo
from navfw.cli.progress_bar import ProgressBar, Quiet


def warm(quiet: Quiet = False) -> None:
    """Compile what the first runs would compile, on all cores."""
    compiled = compile_with_progress(quiet=quiet)
    echo(f"{compiled} routines compiled" if compiled else "all routines are compiled")


def compile_with_progress(*, loaded: bool = False, quiet: bool = False) -> int:
    """Compile what is missing, with ``loaded`` for imported modules only; returns the number.

    The bar appears only when something is compiled.
    """
    from navfw.process.kernel_compilation import COMPILING, Compiled, compile_kernels

    notice = COMPILING
    with ProgressBar("compiling", quiet=quiet) as bar:

        def show(state: Compiled) -> None:
            nonlocal notice
            if notice and not quiet:
                bar.note(notice)
                notice = ""
            bar.show_share(state.share, str(state))

        return compile_kernels(show, loaded=loaded)
