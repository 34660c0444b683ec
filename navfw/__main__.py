"""The console script ``navfw``, which ``python -m navfw`` is as well."""

from __future__ import annotations

import gc
import sys

_ALLOCATIONS = 50_000  # measured
"""Objects after which Python looks for garbage: with its own 700, this is a tenth of a start."""


def main() -> None:
    """Import and call the command; Ctrl-C during the import ends it without a traceback."""
    gc.set_threshold(_ALLOCATIONS)
    try:
        from navfw.cli import main as command

        command()
    except KeyboardInterrupt:
        sys.stderr.write("navfw: interrupted\n")
        sys.exit(130)


if __name__ == "__main__":
    main()
