"""Where a plugin raised an exception: file, line, function and the text of the line."""

from __future__ import annotations

import sysconfig
import traceback
from pathlib import Path

from navfw.config.input_file import shown_path

_FRAMES = 50
"""Number of calls, from the innermost outwards, in which the plugin's own code is looked for."""

_MAX_LINE = 100
"""Length of the text of a line [characters]."""

_GUARD, _PACKAGE = Path(__file__).parents[:2]
_LIBRARIES = tuple(
    f"{Path(sysconfig.get_path(name))}/" for name in ("stdlib", "platstdlib", "purelib", "platlib")
)


def fault_origin(error: BaseException) -> str:
    """The innermost call in the plugin's own code, as in ``hover.py:12, in propose: 1 / 0``.

    If all code on the way is that of navfw and of libraries, the innermost call outside of this
    room; "" if there is none, as when an answer is refused by its check.
    """
    frames = traceback.extract_tb(error.__traceback__, limit=-_FRAMES)
    outside = [frame for frame in frames if not Path(frame.filename).is_relative_to(_GUARD)]
    own = [frame for frame in outside if _is_own(frame.filename)]
    if not outside:
        return ""
    frame = (own or outside)[-1]
    line = (frame.line or "").strip()
    text = f": {line[:_MAX_LINE]}" if line else ""
    return f"{shown_path(Path(frame.filename))}:{frame.lineno}, in {frame.name}{text}"


def _is_own(file: str) -> bool:
    """Whether a file is neither navfw's package nor a library; what ships as a plugin is own."""
    path = Path(file)
    if path.is_relative_to(_PACKAGE):
        return path.is_relative_to(_PACKAGE / "shipped")
    return not file.startswith(_LIBRARIES) and not file.startswith("<")
