"""The registry of plugins by kind and name; broken ones are kept with their errors."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from navfw.config.error_location import parameters_of
from navfw.config.input_file import real_path, shown_path
from navfw.config.installed_packages import points_of, source_of
from navfw.config.lookup import plugin_files, plugin_folders, shipped_folder
from navfw.config.project_trust import require_trust
from navfw.errors import InputError, PluginError, UnknownNameError
from navfw.plugins.built_in import (
    BUILT_IN,
    DECORATED,
    GROUPS,
    outlined_summary,
    outlines,
    summary_of,
)

if TYPE_CHECKING:
    from navfw.interfaces import Plugin
    from navfw.plugins import plugin_import, simulator_access, verification
else:  # imported when a plugin is: they need numpy, which a list of plugins does not
    import lazy_loader

    plugin_import, simulator_access, verification = (
        lazy_loader.load(f"navfw.plugins.{module}", suppress_warning=True)
        for module in ("plugin_import", "simulator_access", "verification")
    )


@dataclass
class _RegistryEntry:
    """One plugin: its class once loaded, or the error that makes it unusable.

    Until then it is known by its ``target``, or by the ``file`` that defines it.
    """

    kind: str
    name: str
    source: str
    target: str = ""
    file: Path | None = None
    summary: str = ""
    cls: type[Plugin] | None = None
    error: InputError | None = None


class Registry:
    """Plugins by kind and name.

    A plugin is verified when it is registered. Entry points and shipped plugins are imported and
    verified when they are first used, or listed with parameters. A broken plugin is listed with its
    error and does not affect the others.
    """

    def __init__(self) -> None:
        self._entries: list[_RegistryEntry] = []
        self._files: set[Path] = set()
        self._unread: list[PluginError] = []

    def register(self, cls: type[Plugin], source: str | None = None) -> None:
        """Verify and add a plugin class; ``source`` is its origin in listings.

        Raises:
            PluginError: the class is not a valid plugin, or its name is taken. The registry is
                unchanged then.

        """
        verification.verify(cls)
        self._add(
            _RegistryEntry(
                str(verification.kind_of(cls)), cls.name, source or _source(cls), cls=cls
            )
        )

    def register_lazily(self, kind: str, name: str, target: str, source: str) -> None:
        """Add the plugin at ``target``, written ``module:Class``; it is imported on first use.

        Raises:
            UnknownNameError: there is no such kind.
            PluginError: the name is taken.

        """
        check_kind(kind)
        self._add(_RegistryEntry(kind, name, source, target))

    def discover_folder(self, folder: str | Path, *, lazily: bool = False) -> None:
        """Import every ``*.py`` in ``folder``, except ``_*.py``, and register its plugins.

        Broken plugins are kept with their errors, as behaviours if the kind is not known. If
        ``lazily``, a file is imported on first use of a behaviour that its source names.

        Raises:
            PluginError: ``folder`` is not a readable folder.

        """
        folder = Path(folder)
        try:
            files = plugin_files(folder)
        except OSError as error:
            raise PluginError(
                f"expected a folder of plugins: {error.strerror}", file=shown_path(folder)
            ) from None
        for file in files:
            if real_path(file) not in self._files:
                self._files.add(real_path(file))
                outlined = outlines(file) if lazily else []
                for kind, name, summary in outlined:
                    entry = _RegistryEntry(kind, name, shown_path(file), "", file, summary)
                    self._attempt(entry, partial(self._add, entry))
                if not outlined:
                    self._discover_file(file)

    def discover_entry_points(self, points: Iterable[EntryPoint] | None = None) -> None:
        """Add plugins of entry ``points`` (None: all installed), to be imported on first use."""
        installed = (point for group in GROUPS for point in points_of(group))
        for point in installed if points is None else points:
            source, target = source_of(point), point.value.replace(" ", "")
            entry = _RegistryEntry(GROUPS[point.group], point.name, source, target)
            self._attempt(entry, partial(self._add, entry))

    def get(self, kind: str, name: str) -> type[Plugin]:
        """Return the class of a plugin; import and verify it first if it is not loaded yet.

        Raises:
            UnknownNameError: there is no such kind, or no such plugin of it.
            PluginError: the plugin is broken, and the message lists the problems; a file has
                another one of its name; or it is not known, but a file could not be imported.

        """
        check_kind(kind)
        entry = self._first(kind, name)
        if entry is None:
            unknown = UnknownNameError(f"{kind} plugin", name, self.names(kind))
            if not self._unread:
                raise unknown
            error = self._unread[0]
            raise PluginError(f"{unknown}; it may be in a file that fails: {error}")
        of_name = self._of(kind, name)
        for later in of_name[of_name.index(entry) + 1 :]:  # nor is ``entry`` used in its place
            if later.error and not later.target and later.source != entry.source:
                raise later.error
        entry = self._loaded(entry)
        if entry.cls is None:
            raise entry.error or PluginError("broken", key=name)
        return entry.cls

    def names(self, kind: str) -> list[str]:
        """Return the sorted names of all plugins of a kind, broken ones included."""
        check_kind(kind)
        return sorted({entry.name for entry in self._entries if entry.kind == kind})

    def listing(self, kind: str | None = None, *, parameters: bool = True) -> list[dict[str, Any]]:
        """Every plugin (of ``kind``) as plain data: description and parameters, or its error.

        Keys: name, kind, status (``ok`` or ``broken``), source, summary, parameters (each with
        name, type, default, required, bounds, description), notes (how its source uses the
        simulator, or could), error (None when ok). All plugins are imported, and the files that
        they read, such as rule bases, are checked. Without ``parameters``, plugins that are not
        imported yet are listed from their source if it is found, with only name, kind, source,
        summary and error.
        """
        if kind is not None:
            check_kind(kind)
        order = list(BUILT_IN)
        entries = [entry for entry in self._entries if kind in {None, entry.kind}]
        entries.sort(key=lambda e: (order.index(e.kind), e.name, e.error is not None))
        return [self._row(entry, parameters=parameters) for entry in entries]

    def _discover_file(self, file: Path) -> None:
        source, kind = shown_path(file), "behavior"
        try:
            module, decorated = plugin_import.import_file(file)
        except PluginError as error:
            self._entries.append(_RegistryEntry(kind, file.stem, source, error=error))
            self._unread.append(error)
            return
        classes = plugin_import.candidates_of(module, decorated)
        if not classes:
            nothing = plugin_import.nothing_found(module, file)
            self._entries.append(_RegistryEntry(kind, file.stem, source, error=nothing))
        for cls in classes:
            self._register_class(cls, source, file.stem)

    def _register_class(self, cls: type[Any], source: str, otherwise: str) -> None:
        """Register a class, or record it as broken, under the name ``otherwise`` if it has none."""
        own = cls.__dict__.get("name")
        name = own if isinstance(own, str) else otherwise
        entry = _RegistryEntry(verification.kind_of(cls) or "behavior", name, source)
        self._attempt(entry, partial(self.register, cls, source))

    def _attempt(self, entry: _RegistryEntry, register: Callable[[], None]) -> None:
        try:
            register()
        except InputError as error:
            self._entries.append(replace(entry, error=error))

    def _of(self, kind: str, name: str) -> list[_RegistryEntry]:
        return [entry for entry in self._entries if (entry.kind, entry.name) == (kind, name)]

    def _first(self, kind: str, name: str) -> _RegistryEntry | None:
        """Return the entry of this name: one that is not broken, if there is one."""
        return min(self._of(kind, name), key=lambda entry: entry.error is not None, default=None)

    def _add(self, entry: _RegistryEntry) -> None:
        """Add an entry.

        Raises:
            PluginError: another plugin that is not broken has the name.

        """
        other = self._first(entry.kind, entry.name)
        if other is None or other.error is not None:
            self._entries.append(entry)
        elif entry.cls is None or other.cls is not entry.cls:
            raise PluginError(
                f"the {entry.kind} name {entry.name!r} is already taken by {other.source}; "
                "rename one of them",
                file=entry.source,
                key=None if entry.cls is None else f"class {entry.cls.__qualname__}",
            )

    def _loaded(self, entry: _RegistryEntry) -> _RegistryEntry:
        """Return ``entry``, or the one that takes its place, with its class or an error."""
        if entry.cls is not None or entry.error is not None:
            return entry
        if entry.file is not None:
            if entry in self._entries:  # else another plugin of its file was needed before
                self._entries = [other for other in self._entries if other.file != entry.file]
                self._discover_file(entry.file)
            return self._first(entry.kind, entry.name) or entry
        try:
            cls = plugin_import.import_object(entry.target)
            verification.verify(cls)
            kind, name = verification.kind_of(cls), getattr(cls, "name", None)
            if (kind, name) != (entry.kind, entry.name):
                raise PluginError(
                    f"registered as {entry.kind} {entry.name!r}, but the class is {kind} {name!r}; "
                    "make both agree",
                    file=entry.source,
                    key=getattr(cls, "__qualname__", None),
                )
        except InputError as error:
            entry.error = error
        else:
            entry.cls = cast("type[Plugin]", cls)
        return entry

    def _row(self, entry: _RegistryEntry, *, parameters: bool) -> dict[str, Any]:
        """The row of an entry; the files that the plugin reads when it is made are checked."""
        about = {"name": entry.name, "kind": entry.kind, "source": entry.source}
        if not (parameters or entry.cls or entry.error):
            summary = entry.summary or outlined_summary(entry.target)
            if summary:
                return about | {"summary": summary, "error": None}
        entry = self._loaded(entry)
        cls = entry.cls
        if cls is not None and entry.error is None:
            try:
                cls.check_files()
            except InputError as error:
                entry.error = error
        return about | {
            "status": "ok" if entry.error is None else "broken",
            "summary": "" if cls is None else summary_of(cls.__doc__),
            "parameters": [p._asdict() for p in parameters_of(cls.Params)] if cls else [],
            "notes": simulator_access.access_notes(cls) if cls else [],
            "error": None if entry.error is None else str(entry.error),
        }


def default_registry(folders: Iterable[str | Path] = ()) -> Registry:
    """Make a registry of all available plugins.

    These are the shipped ones, those in the project's ``behaviors/`` and ``plugins/`` and in
    ``folders``, the entry points of installed packages, and classes decorated with ``plugin``. Of
    two plugins with the same name, the one earlier in this order is kept; if the other is in a
    file, ``get`` refuses both. The project's are imported only if the user trusts the project, see
    ``navfw.config.project_trust``; ``folders`` are named by the caller, so they need no trust.

    Raises:
        UntrustedCodeError: the project has plugins, and the user has not agreed to execute them.
        PluginError: one of ``folders`` is not a folder.

    """
    require_trust()
    registry = Registry()
    for kind, plugins in BUILT_IN.items():
        for name, target in plugins.items():
            registry.register_lazily(kind, name, target, "navfw")
    shipped = shipped_folder() / "behaviors"
    for folder in (*plugin_folders(), *folders):
        registry.discover_folder(folder, lazily=folder == shipped)
    registry.discover_entry_points()
    for cls in DECORATED.values():
        registry._register_class(cls, _source(cls), cls.__name__)
    return registry


def check_kind(kind: str) -> None:
    """Raise UnknownNameError, with the nearest kind, unless ``kind`` is a kind of plugin."""
    if kind not in BUILT_IN:
        raise UnknownNameError("kind of plugin", kind, BUILT_IN)


def _source(cls: object) -> str:
    file = verification.source_file(cls)
    return getattr(cls, "__module__", "code") if file is None else shown_path(file)
