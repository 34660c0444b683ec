"""``navfw warm``: compiles navfw's kernels before they are needed, for images and CI caches."""

from __future__ import annotations

from navfw.cli.output import echo
from navfw.cli.progress_bar import ProgressBar, Quiet


def warm(quiet: Quiet = False) -> None:
    """Compile the routines that the first runs need, on all cores."""
    compiled = compile_with_progress(quiet=quiet)
    echo(f"{compiled} routines compiled" if compiled else "all routines are compiled")


def compile_with_progress(*, loaded: bool = False, quiet: bool = False) -> int:
    """Compile missing kernels (``loaded``: of imported modules only); return their number.

    The bar appears only if something is compiled.
    """
    from navfw.process.kernel_compilation import COMPILING, Compiled, compile_kernels

    notice = COMPILING
    with ProgressBar("compiling", quiet=quiet) as bar:

        def show(state: Compiled) -> None:
            nonlocal notice
            if notice and not quiet:
                echo(notice, err=True)
                notice = ""
            bar.show_share(state.share, str(state))

        return compile_kernels(show, loaded=loaded)
