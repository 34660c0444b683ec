"""Expand xacro files to URDF, by xacrodoc, in a process with bounded time and memory.

Xacro evaluates expressions of the file by Python's ``eval``, whose ban on builtins is known not to
protect. Here an expression may calculate, compare, choose and call the functions that xacro offers:
generators, names with an underscore, formatting and the namespace ``python`` are refused.
"""

from __future__ import annotations

import ast
import contextlib
import json
import re
import subprocess
import sys
from io import StringIO
from pathlib import Path
from typing import Any, NoReturn

from navfw.config.extras import require_extra
from navfw.config.input_file import (
    MAX_TEXT,
    cached_by_files,
    read_input,
    read_input_text,
    shown_path,
    trace_input,
)
from navfw.config.lookup import package_folders
from navfw.errors import ConfigError, did_you_mean

_SECONDS = 20  # measured
"""Longest time [s] of an expansion; a big robot takes 2 s."""
_MEMORY = 2_000_000_000  # chosen
"""Largest memory [bytes] of an expansion."""
_ALLOWED = (
    *(ast.Expression, ast.Constant, ast.Name, ast.Load, ast.Attribute, ast.Subscript, ast.Slice),
    *(ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp, ast.Call, ast.keyword),
    *(ast.List, ast.Tuple, ast.Dict, ast.operator, ast.unaryop, ast.boolop, ast.cmpop),
)
_ARG = r"(?:\$\(arg\s+|\barg\([\"'])([\w.-]+)"
"""Matches the use of an argument in a file."""
_UNDEFINED = "Undefined substitution argument"
"""Xacro's message on an argument without a value."""
_REFUSED = {"format", "format_map"}
"""Methods that reach any attribute by its name."""


@cached_by_files(16)
def expand_xacro(path: Path, packages: tuple[str, ...], args: tuple[str, ...] = ()) -> bytes:
    """Expand the xacro file at ``path`` to a URDF; ``packages`` are folders with packages of ROS.

    ``args`` are its arguments, each ``name:=value``. It is expanded again only when one of its
    files has changed.

    Raises:
        ConfigError: the file cannot be read or expanded, or has an expression that is refused.
        MissingExtraError: xacrodoc is not installed.

    """
    read_input(path)
    values = {}
    for arg in args:
        name, is_one, value = arg.partition(":=")
        if not is_one:
            raise ConfigError(
                f"expected an argument NAME:=VALUE, got {arg!r}", file=shown_path(path)
            )
        values[name.strip()] = value.strip()
    require_extra("xacro", "xacrodoc", key=path.name)
    # -P: no module of the working folder
    words = [sys.executable, "-P", "-m", __name__, str(path.absolute())]
    words += [json.dumps(values), *packages]
    try:
        # S603: fixed words and paths, no shell
        done = subprocess.run(words, capture_output=True, timeout=_SECONDS, check=False)  # noqa: S603
        answer = json.loads(done.stdout or b"{}")
    except (OSError, subprocess.SubprocessError, ValueError):
        answer = {}
    if "text" not in answer or len(answer["text"]) > MAX_TEXT:
        reason = answer.get("error", f"takes more than {_SECONDS} s, or too much memory")
        if _UNDEFINED in reason:
            reason += "; give --xacro-arg NAME:=VALUE, or urdf.args in a robot file"
        raise ConfigError(f"xacro: {reason}", file=shown_path(path))
    trace_input(*answer["files"])
    return str(answer["text"]).encode()


def _check_expression(text: str) -> None:
    """Check that an expression of a xacro file does nothing but calculate.

    Raises:
        ValueError: it has a part that is refused; SyntaxError where it is no expression.

    """
    for node in ast.walk(ast.parse(text.strip(), mode="eval")):
        name = getattr(node, "attr", getattr(node, "id", ""))
        if not isinstance(node, _ALLOWED) or name.startswith("_") or name in _REFUSED:
            raise ValueError(f"{name or type(node).__name__} is not allowed in {text.strip()!r}")


def _expanded(path: str, args: dict[str, str], packages: list[str]) -> dict[str, Any]:
    """Return the answer of the process: the text and the files read, or the error."""
    import xacro
    from xacro import substitution_args
    from xacrodoc import XacroDoc

    evaluate = xacro.safe_eval

    def checked(text: str, *names: Any) -> Any:
        _check_expression(text)
        return evaluate(text, *names)

    def refuse(*_: Any) -> NoReturn:
        raise ValueError("$(eval ...) is not allowed: use ${...}")

    def folder_of(package: str) -> str:
        for folder in package_folders(package, map(Path, packages)):
            if folder.is_dir():
                return str(folder)
        raise ValueError(
            f"package {package!r} not found: name its folder in urdf.packages or ROS_PACKAGE_PATH"
        )

    xacro.open = lambda name: StringIO(read_input_text(name))
    xacro.init_stacks(path)  # what is named without folder lies beside the file
    xacro.safe_eval = checked
    substitution_args._eval = refuse
    substitution_args._eval_find = folder_of
    xacro._global_symbols.pop("python")
    try:
        document = XacroDoc.from_file(path, subargs=args, walk_up=False, resolve_packages=False)
        files = [str(file) for file in xacro.all_includes]
        known = re.findall(_ARG, "".join(read_input_text(file) for file in {path, *files}))
        for name in sorted(args.keys() - set(known)):
            raise ValueError(f"it uses no argument {name!r}; {did_you_mean(name, known)}")
        return {"text": document.dom.toxml(), "files": files}
    except (Exception, RecursionError) as error:  # of a library: all that it raises
        cause, text = str(getattr(error, "exc", "")), str(error)
        text = cause if cause and text.count(cause) > 1 else text  # xacro says it twice
        return {"error": " ".join(text.split())[:300] or type(error).__name__}


def main() -> None:
    """Expand a file; words: its path, its arguments as JSON, folders with packages."""
    with contextlib.suppress(ImportError):  # Windows: the time alone is bounded
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    with contextlib.redirect_stdout(sys.stderr):
        answer = _expanded(sys.argv[1], json.loads(sys.argv[2]), sys.argv[3:])
    sys.stdout.write(json.dumps(answer))


if __name__ == "__main__":
    main()
