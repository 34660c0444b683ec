"""Check a plugin class against the interface of its kind: name, methods, signatures, parameters."""

from __future__ import annotations

import difflib
import inspect
import keyword
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from navfw import interfaces
from navfw.config.input_file import shown_path
from navfw.config.yamlfile import shown
from navfw.errors import PluginError


def verify(cls: object) -> None:
    """Raise unless ``cls`` is a plugin class that implements the interface of its kind.

    Raises:
        PluginError: the message has file, line and class, and each problem with its remedy.

    """
    problems = find_problems(cls)
    if not problems:
        return
    name = getattr(cls, "__qualname__", repr(cls))
    file = source_file(cls)
    shown_file = None if file is None else shown_path(file)
    raise PluginError("; ".join(problems), file=shown_file, line=_line(cls), key=f"class {name}")


def find_problems(cls: object) -> list[str]:
    """List the problems of ``cls`` as a plugin class, each with its remedy; empty if valid."""
    return list(_problems(cls))


def kind_of(cls: object) -> str | None:
    """Return the kind of plugin that ``cls`` is a subclass of; None if of none or of several."""
    if not inspect.isclass(cls):
        return None
    kinds = [kind for kind, base in interfaces.KINDS.items() if issubclass(cls, base)]
    return kinds[0] if len(kinds) == 1 else None


def source_file(cls: object) -> Path | None:
    """Return the file that defines ``cls``; None if there is none."""
    try:
        return Path(inspect.getfile(cls))  # type: ignore[arg-type]
    except (TypeError, OSError):
        return None


def _problems(cls: object) -> Iterator[str]:
    if not inspect.isclass(cls):
        yield f"expected a class, got {shown(cls)}"
        return
    base_names = ", ".join(sorted(base.__name__ for base in interfaces.KINDS.values()))
    bases = [base for base in interfaces.KINDS.values() if issubclass(cls, base)]
    if not bases:
        yield (
            "not derived from a base class of plugins; "
            f"derive it from one of navfw.interfaces: {base_names}"
        )
        return
    if len(bases) > 1:
        names = " and ".join(base.__name__ for base in bases)
        yield f"derived from both {names}; make one plugin of each"
        return
    base = bases[0]
    if cls is base:
        yield "this is the base class itself; derive a class from it"
        return
    yield from _name_problems(cls, base)
    documented = (cls.__dict__.get("__doc__") or "").strip()
    if not documented and sys.flags.optimize < 2:  # python -OO removes docstrings
        yield "no docstring; describe the plugin in a sentence (listings show it)"
    yield from _method_problems(cls, base)
    yield from _params_problems(cls)


def _name_problems(cls: type[Any], base: type[Any]) -> Iterator[str]:
    if cls.__dict__.get("kind", base.kind) != base.kind:
        yield f"kind is set to {cls.kind!r}; remove it, the base class sets {base.kind!r}"
    words = "".join(f"_{c.lower()}" if c.isupper() else c for c in cls.__name__).strip("_")
    remedy = f'write: name: ClassVar[str] = "{words.replace("__", "_")}"'
    if "name" not in cls.__dict__:
        inherited = getattr(cls, "name", None)
        because = "" if inherited is None else f" of its own (it inherits {inherited!r})"
        yield f"no name{because}; {remedy}"
        return
    name = cls.__dict__["name"]
    if not isinstance(name, str):
        yield f"name must be text, got {type(name).__name__}; {remedy}"
    elif not (name.isascii() and name.isidentifier()) or keyword.iskeyword(name):
        yield f"name {name!r} must be an identifier (letters, digits, _); {remedy}"


def _method_problems(cls: type[Any], base: type[Any]) -> Iterator[str]:
    own = [n for n, v in vars(cls).items() if callable(v) and not n.startswith("_")]
    names = [n for n in dir(base) if not n.startswith("_") or n == "__init__"]
    interface = {name: inspect.getattr_static(base, name) for name in names}
    for parent in reversed(cls.__mro__[1:]):  # a class in between may add abstract methods
        for name in sorted(getattr(parent, "__abstractmethods__", ())):
            interface.setdefault(name, inspect.getattr_static(parent, name))
    for name, wanted in interface.items():
        actual = inspect.getattr_static(cls, name)
        if actual is wanted:
            if name in cls.__abstractmethods__:
                additional = [n for n in own if not hasattr(base, n)]
                near = difflib.get_close_matches(name, additional, n=1, cutoff=0.5)
                hint = f" instead of {near[0]!r}" if near else ""
                yield f"missing {_headline(name, wanted)}; define it{hint}"
        elif isinstance(wanted, property):
            if callable(actual):
                yield f"{name} must be a property; put @property above it"
        elif inspect.isfunction(wanted):
            yield from _signature_problems(name, wanted, actual)
        elif isinstance(actual, property):
            yield f"{name} must be a value, not a property; write: {name} = ..."


def _signature_problems(name: str, wanted: Callable[..., Any], actual: object) -> Iterator[str]:
    if isinstance(actual, staticmethod | classmethod):
        yield f"{name} must be a plain method; remove @{type(actual).__name__}"
        return
    if not callable(actual):
        got = type(actual).__name__
        yield f"{name} must be a method, got {got}; define {_headline(name, wanted)}"
        return
    inner = inspect.unwrap(actual)
    if inspect.iscoroutinefunction(inner) or inspect.isasyncgenfunction(inner):
        yield f"{name} must not be async; remove async"
        return
    if inspect.isgeneratorfunction(inner):
        yield f"{name} must return its result; replace yield by return"
        return
    signature = inspect.signature(actual)
    mismatch = _mismatch(inspect.signature(wanted), signature)
    if mismatch:
        yield (
            f"{name}{_bare(signature)} has the wrong parameters: {mismatch}; "
            f"define {_headline(name, wanted)}"
        )


def _mismatch(wanted: inspect.Signature, actual: inspect.Signature) -> str:
    """Why ``actual`` cannot be called like ``wanted``, by position or by name; empty if it can."""
    own, *names = wanted.parameters
    needed = [n for n in names if wanted.parameters[n].default is inspect.Parameter.empty]
    try:
        actual.bind(own, *names)
        actual.bind(own, **dict.fromkeys(names))
        actual.bind(own, *needed)
    except TypeError as error:
        return str(error)
    return ""


def _bare(signature: inspect.Signature) -> str:
    """Return a signature without types: ``(self, context)``."""
    empty = inspect.Parameter.empty
    parameters = [p.replace(annotation=empty) for p in signature.parameters.values()]
    return str(signature.replace(parameters=parameters, return_annotation=inspect.Signature.empty))


def _headline(name: str, wanted: object) -> str:
    if isinstance(wanted, property):
        return f"property {name}"
    return f"{name}{_bare(inspect.signature(wanted))}" if callable(wanted) else name


def _params_problems(cls: type[Any]) -> Iterator[str]:
    model = cls.Params
    if not (inspect.isclass(model) and issubclass(model, interfaces.Params)):
        parent = cls.__mro__[1].__name__
        yield f"Params is not derived from the base's; write: class Params({parent}.Params)"
        return
    if "Params" not in cls.__dict__:
        unused = [
            n for n, v in vars(cls).items() if inspect.isclass(v) and issubclass(v, BaseModel)
        ]
        if unused:
            yield f"the nested model {unused[0]!r} is not used; call it Params"
    if model.model_config.get("extra") != "forbid":
        yield "Params accepts unknown keys; keep extra='forbid' of the base class"
    for name, info in model.model_fields.items():
        if info.is_required() or info.default_factory is not None:
            continue
        problem = _default_problem(model, name, info.default)
        if problem:
            yield f"the default of Params.{name} is invalid: {problem}; change it or the bounds"


def _default_problem(model: type[BaseModel], name: str, default: object) -> str:
    key = model.model_fields[name].alias or name
    try:
        model.model_validate({key: default})
    except ValidationError as error:
        for detail in error.errors(include_url=False):
            # required fields are missing here, which is not a problem of this one
            if detail["loc"][:1] == (key,) and detail["type"] != "missing":
                return f"{detail['msg'][:1].lower()}{detail['msg'][1:]}, got {shown(default)}"
    return ""


def _line(cls: object) -> int | None:
    try:
        return inspect.getsourcelines(cls)[1]  # type: ignore[arg-type]
    except (TypeError, OSError, SyntaxError, IndexError):
        return None
