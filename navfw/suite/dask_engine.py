"""The runs of a suite on the workers of a Dask scheduler: a cluster, or this machine.

The files that runs need are sent to each worker once, as an archive: the project's files, and the
suite's worlds, missions and stacks. Files that ship with navfw are not sent: workers need the same
version. A run needs a main thread, may hang or leak memory, and has limits; so each thread of Dask
hands its runs to a process of a ``WorkerPool``, and only this process imports the simulator.
"""

from __future__ import annotations

import contextlib
import io
import multiprocessing
import os
import tempfile
import time
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from importlib import metadata
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, Self

from navfw.config.extras import extra_imports
from navfw.config.input_file import read_input, real_path
from navfw.config.lookup import project_folder, shipped_folder
from navfw.config.project_trust import TRUST_VARIABLE
from navfw.errors import InputError, SimulationError
from navfw.plugins.built_in import GROUPS
from navfw.process.atomic import atomic_file
from navfw.process.interruption import check_interrupted, interruptible
from navfw.recording.provenance import code_fingerprint, files_of, library_versions
from navfw.suite.case import Case
from navfw.suite.run_row import RunRow
from navfw.suite.worker_pool import WorkerFailure, WorkerPool

with extra_imports("dask", key="--engine"):
    import distributed

_PERIOD = 0.25
"""Period [s] of checking for runs that have ended and for an interruption."""

CONNECT_TIME = 15.0
"""Longest time [s] to wait for the scheduler's answer."""

_WORKER_TIME = 60.0
"""Longest time [s] to wait for a worker, at the start and after all workers are lost."""

_PARTS = ("worlds", "maps", "stacks", "robots", "behaviors", "plugins")
"""Folders of the project that are sent to the workers."""
_MAX_BYTES = 200_000_000
"""Largest total size of the files that are sent [byte]."""
_RESUME = "--resume drives the rest"


@dataclass
class DaskEngine:
    """Drives cases on the workers of the Dask scheduler at ``address``; a context manager.

    Dask repeats a run on another worker if its worker is lost. ``work``, ``module:name`` of the
    function that drives a case, is imported only by the process of a run. ``limit`` [s] and
    ``memory`` [MB] bound a run. Entering the context raises InputError if the scheduler cannot be
    reached or has no workers, if a worker has another version of navfw, Python or a library, or
    lacks a plugin, or if the project's files are too large.
    """

    address: str
    cases: Sequence[Case]
    limit: float
    memory: float
    work: str = "navfw.suite.suite_run:run_case"
    _client: Any = field(init=False, default=None)  # the library has no types
    _files: FilesOnWorker = field(init=False)

    def __enter__(self) -> Self:
        self._files = FilesOnWorker(self.cases, self.work, self.limit, self.memory)
        connect: Any = distributed.Client
        help_ = "start one with dask scheduler, or correct the address"
        with _refusing(f"no scheduler of Dask answers at {self.address}", help_):
            self._client = connect(self.address, timeout=CONNECT_TIME, set_as_default=False)
        try:
            help_ = f"start some with dask worker {self.address}"
            with _refusing(f"{self.address} has no workers", help_):
                self._client.wait_for_workers(1, timeout=_WORKER_TIME)
            help_ = "install the same version there"
            with _refusing(f"a worker of {self.address} cannot import this navfw", help_):
                self._client.register_plugin(self._files)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *exception: object) -> None:
        with contextlib.suppress(Exception):  # the scheduler may be gone
            self._client.unregister_worker_plugin(self._files.name)
        self._client.close()

    @property
    def capacity(self) -> int:
        """Number of threads of all present workers; 1 while there are none."""
        threads: dict[str, int] = self._client.nthreads()
        return max(1, sum(threads.values()))

    def run(self, cases: Iterable[Case]) -> Iterator[tuple[Case, RunRow | WorkerFailure]]:
        """Run all cases and yield each with its result, in the order of completion.

        Raises:
            SimulationError: scheduler or workers are gone, or a worker has another version.
            KeyboardInterrupt: the user interrupted; runs that had not ended are cancelled.

        """
        submit = partial(self._client.submit, drive, self._files.name, pure=False)
        futures = {submit(case): case for case in cases}
        with self._client.as_current():
            ended: Any = distributed.as_completed(futures)  # type: ignore[no-untyped-call]
        seen = time.monotonic()
        try:
            while futures:
                for future in ended.next_batch(block=False):
                    if future.status in {"lost", "pending"}:  # with its worker: Dask repeats it
                        ended.add(future)
                        continue
                    case = futures.pop(future)
                    yield case, self._result(future, case)
                seen = time.monotonic() if self._client.nthreads() else seen
                if time.monotonic() - seen > _WORKER_TIME:
                    raise SimulationError(f"{self.address} has no workers left; {_RESUME}")
                with interruptible():
                    time.sleep(_PERIOD)
                    check_interrupted()
        finally:
            self._client.cancel(list(futures), force=True)

    def _result(self, future: Any, case: Case) -> RunRow | WorkerFailure:
        if future.status == "error":
            error = future.exception()
            if isinstance(error, SimulationError):
                raise SimulationError(f"{self.address}: {error}; {_RESUME}")
            return WorkerFailure(f"{type(error).__name__}: {error}")
        if future.status != "finished":
            what = f"the connection to the scheduler at {self.address} is lost"
            raise SimulationError(f"{what}; {_RESUME}")
        row, picture = future.result()
        if picture is not None:
            with atomic_file(case.pictures / row.picture.rpartition("/")[2]) as unfinished:
                unfinished.write_bytes(picture)
        return row  # type: ignore[no-any-return]


@contextlib.contextmanager
def _refusing(what: str, help_: str) -> Iterator[None]:
    """Context that turns errors of Dask into an InputError; those of a worker's check stay."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        reason = f"{what} ({type(error).__name__}: {error}); {help_}"
        raise InputError(reason, key="--scheduler") from None


@cache
def worker_identity() -> dict[str, str]:
    """Return the versions of navfw and of its libraries on this machine, and its installed plugins.

    ``plugins`` lists those of other installed packages, as ``kind name``, separated by commas.
    """
    points = [(kind, metadata.entry_points(group=group)) for group, kind in GROUPS.items()]
    return {
        **library_versions(),
        "navfw": f"{metadata.version('navfw')} ({code_fingerprint()[:12]})",
        "plugins": ", ".join(sorted({f"{kind} {p.name}" for kind, own in points for p in own})),
    }


def compare_identities(address: str, theirs: dict[str, str], ours: dict[str, str]) -> None:
    """Raise InputError if a worker's identity differs from ours; it may have more plugins."""
    lacking = set(ours["plugins"].split(", ")) - {"", *theirs["plugins"].split(", ")}
    if lacking:
        what = f"the worker {address} lacks the plugin {', '.join(sorted(lacking)[:5])}"
        raise InputError(f"{what}; install its package there", key="--scheduler")
    for name, value in ours.items():
        if name != "plugins" and theirs.get(name) != value:
            what = f"the worker {address} has {name} {theirs.get(name)}, here it is {value}"
            raise InputError(f"{what}; install the same there", key="--scheduler")


def _archive_of(cases: Sequence[Case], project: Path) -> bytes:
    """The files of ``project`` and of ``cases`` by their absolute paths, as a zip archive."""
    worlds = [Path(case.world).parent for case in cases if case.world]
    files = [Path(file) for case in cases for file in (case.mission, case.stack) if file]
    places = dict.fromkeys([*(project / part for part in _PARTS), *worlds, *files])
    stream, total = io.BytesIO(), 0
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(f"{project}/navfw.toml", b"")
        for name, file in dict(files_of({str(place): place for place in places})).items():
            content = read_input(file, _MAX_BYTES)
            total += len(content)
            if total > _MAX_BYTES:
                what = f"the files of the project exceed {_MAX_BYTES // 1_000_000} MB"
                raise InputError(f"{what}; move what no run needs", file=project)
            archive.writestr(name, content)
    return stream.getvalue()


# --- in a worker of Dask -------------------------------------------------------------------------

Answer = tuple[RunRow | WorkerFailure, bytes | None]
"""The row of a run, or the reason why it has none; and its picture as PNG, None if not kept."""


class FilesOnWorker(distributed.WorkerPlugin):
    """Unpacks a suite's files on every worker, also on one that joins later, and drives runs."""

    def __init__(self, cases: Sequence[Case], work: str, limit: float, memory: float) -> None:
        project = project_folder()
        if project is None or real_path(project) == shipped_folder():
            project = Path("/project")
        self.name = f"navfw-{os.urandom(8).hex()}"
        self._archive, self._project = _archive_of(cases, project.absolute()), project.absolute()
        self._identity, self._work, self._limits = worker_identity(), work, (limit, memory)
        self._folder: Path | None = None
        self._idle: list[WorkerPool[Case, Answer]] = []

    def setup(self, worker: distributed.Worker) -> None:
        """Unpack the files in the worker's own folder; InputError if it is not like the sender."""
        compare_identities(worker.address, worker_identity(), self._identity)
        folder = Path(worker.local_directory) / self.name
        with zipfile.ZipFile(io.BytesIO(self._archive)) as archive:
            archive.extractall(folder)
        self._folder = folder

    def teardown(self, worker: distributed.Worker) -> None:
        """End the worker's processes that drive runs."""
        del worker
        while self._idle:
            self._idle.pop().__exit__(None, None, None)

    def run(self, case: Case) -> Answer:
        """Drive ``case`` in a process that is kept for the next case."""
        if self._folder is None:
            raise SimulationError("a worker could not take the files of the suite; see its log")
        # Dask's nanny starts it as a daemon, which may have no processes of its own
        multiprocessing.current_process().daemon = False
        try:
            pool = self._idle.pop()
        except IndexError:
            limit, memory = self._limits
            work = partial(_drive_in, self._work, self._folder, self._project)
            pool = WorkerPool(work, 1, limit, memory=memory).__enter__()
        try:
            ((_, answer),) = pool.run([case])
        finally:
            self._idle.append(pool)
        return (answer, None) if isinstance(answer, WorkerFailure) else answer


def drive(name: str, case: Case) -> Answer:
    """Drive ``case`` on this Dask worker; ``name`` is the name of its ``FilesOnWorker`` plugin."""
    plugin: Any = distributed.get_worker().plugins[name]
    answer: Answer = plugin.run(case)
    return answer


def unpacked(case: Case, folder: Path) -> Case:
    """Return ``case`` with the absolute paths of its files moved below ``folder``."""
    old = (case.world, case.mission, case.stack)
    world, mission, stack = (str(folder / path.lstrip("/")) if path else "" for path in old)
    return replace(case, world=world, mission=mission, stack=stack)


def _drive_in(work: str, folder: Path, project: Path, case: Case) -> Answer:
    """In the process of the run: its project is the unpacked one, trusted by who sent it."""
    os.environ[TRUST_VARIABLE] = "1"
    os.chdir(folder / project.relative_to("/"))
    with tempfile.TemporaryDirectory(prefix="navfw-pictures-") as made:
        pictures = Path(made) / case.pictures.name
        pictures.mkdir(exist_ok=True)
        moved = unpacked(replace(case, pictures=pictures), folder)
        row: RunRow = resolve_name(work)(moved)
        picture = pictures / Path(row.picture).name if row.picture else None
        return row, picture.read_bytes() if picture else None
