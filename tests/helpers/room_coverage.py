"""The coverage of every room by the tests that ``make coverage`` has run: percent, a line each.

The robot's rooms, which have a floor, are those of ``[tool.coverage.report]``. Compiled kernels run
outside the tracer, and so do commands that tests start in processes of their own.
"""

import io
import sys
from pathlib import Path

from coverage import Coverage
from coverage.exceptions import NoDataError

NAVFW = Path(__file__).parents[2] / "navfw"


def rooms(navfw: Path = NAVFW) -> list[Path]:
    """The folders of navfw that have modules."""
    return sorted(path.parent for path in navfw.glob("*/__init__.py"))


def main() -> None:
    """Print the table."""
    measured = Coverage()
    measured.load()
    total = len(NAVFW.parts)
    for room in (*rooms(), NAVFW):
        try:
            share = measured.report(include=f"{room}/*", skip_covered=False, file=io.StringIO())
        except NoDataError:
            share = 0.0
        name = "/".join(room.parts[total:]) or "all of navfw"
        sys.stdout.write(f"{share:6.1f} %  {name}\n")


if __name__ == "__main__":
    main()
