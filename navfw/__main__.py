"""The console script ``navfw``, which ``python -m navfw`` is as well."""

from __future__ import annotations

import sys


def main() -> None:
    """Import and call the command; Ctrl-C during the import ends it without a traceback."""
    try:
        from navfw.cli import main as command

        command()
    except KeyboardInterrupt:
        sys.stderr.write("navfw: interrupted\n")
        sys.exit(130)


if __name__ == "__main__":
    main()
