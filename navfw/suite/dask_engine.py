"""The runs of a suite on the workers of a Dask scheduler: a cluster, or this machine.

What runs need travels once, as an archive: the project's files, and worlds, missions and stacks
from outside of it. What ships with navfw does not: workers have the same version of it. A run needs
a main thread, may hang or leak, and has limits; so each thread of Dask hands its runs to a process
of a ``WorkerPool``, and only there the simulator is imported.
"""

from __future__ import annotations

import contextlib
import io
import multiprocessing
import os
import platform
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from importlib import metadata
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, Self

from navfw.config.extras import extra_imports, pybullet_version
from navfw.config.input_file import read_input, real_path
from navfw.config.lookup import project_folder, shipped_folder
from navfw.config.project_trust import TRUST_VARIABLE
from navfw.errors import InputError, SimulationError
from navfw.plugins.built_in import GROUPS
from navfw.process.atomic import atomic_file
from navfw.process.interruption import check_interrupted, interruptible
from navfw.recording.provenance import code_fingerprint, files_of
from navfw.suite.case import Case, Job
from navfw.suite.run_row import RunRow
from navfw.suite.worker_pool import WorkerFailure, WorkerPool

with extra_imports("dask", key="--engine"):
    import distributed

PERIOD = 0.25
"""Period [s] of looking for runs that have ended, and for an interruption."""

CONNECT_TIME = 15.0
"""Longest time [s] to wait for the scheduler's answer."""

_WORKER_TIME = 60.0
"""Longest time [s] to wait for a worker, at the beginning and when all have gone."""

_PARTS = ("worlds", "maps", "stacks", "robots", "behaviors", "plugins")
"""Folders of the project that travel."""
_MAX_BYTES = 200_000_000
"""Largest size of all files that travel [byte]."""
_LIBRARIES = ("numpy", "numba", "opencv-python-headless", "scipy")
_RESUME = "--resume drives the rest"


@dataclass
class DaskEngine:
    """A context manager; ``run`` yields each job with its result, in the order of completion.

    A run whose worker is lost is driven again by Dask on another one. ``work`` is the function of a
    job as ``module:name``: only the process of a run imports it.

    Raises:
        InputError: the scheduler cannot be reached or has no workers; a worker has another version
            of navfw, Python or a library, or lacks a plugin; the project's files are too large.

    """

    address: str
    cases: Sequence[Case]
    limit: float
    memory: float
    work: str = "navfw.suite.case_worker:run_job"
    _files: ProjectFiles = field(init=False)
    _client: Any = field(init=False, default=None)  # the library has no types

    def __enter__(self) -> Self:
        connect: Any = distributed.Client
        security: Any = distributed.Security
        try:
            arguments = security().get_connection_args("client")
            if self.address.startswith("tls://") and arguments["ssl_context"] is None:
                what = "tls:// needs certificates: set distributed.comm.tls in Dask's configuration"
                raise InputError(what, key="--scheduler")
            self._client = connect(self.address, timeout=CONNECT_TIME, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            what = f"no scheduler of Dask answers at {self.address} ({type(error).__name__})"
            help_ = "start one with dask scheduler, or correct the address"
            raise InputError(f"{what}; {help_}", key="--scheduler") from None
        try:
            self._prepare()
        except BaseException:
            self._client.close()
            raise
        return self

    def __exit__(self, *exception: object) -> None:
        with contextlib.suppress(Exception):  # the scheduler may be gone
            self._client.unregister_worker_plugin(self._files.name)
        self._client.close()

    @property
    def capacity(self) -> int:
        """Number of threads of all workers now; 1 while there are none."""
        threads: dict[str, int] = self._client.nthreads()
        return max(1, sum(threads.values()))

    def run(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, RunRow | WorkerFailure]]:
        """Run all jobs; may be called again with others.

        Raises:
            SimulationError: scheduler or workers are gone, or a worker has another version.
            KeyboardInterrupt: of the user; what had not ended is cancelled.

        """
        submit = partial(self._client.submit, drive, self._files.name, pure=False)
        futures = {submit(self._files.packed(job)): job for job in jobs}
        with self._client.as_current():
            ended: Any = distributed.as_completed(futures)  # type: ignore[no-untyped-call]
        seen = time.monotonic()
        try:
            while futures:
                for future in ended.next_batch(block=False):
                    if future.status in {"lost", "pending"}:  # with its worker: Dask repeats it
                        ended.add(future)
                        continue
                    job = futures.pop(future)
                    yield job, self._result(future, job)
                seen = time.monotonic() if self._client.nthreads() else seen
                if time.monotonic() - seen > _WORKER_TIME:
                    raise SimulationError(f"{self.address} has no workers left; {_RESUME}")
                with interruptible():
                    time.sleep(PERIOD)
                    check_interrupted()
        finally:
            self._client.cancel(list(futures), force=True)

    def _prepare(self) -> None:
        """Compare the workers with this machine, and send them the files."""
        try:
            self._client.wait_for_workers(1, timeout=_WORKER_TIME)
        except TimeoutError:
            what = f"{self.address} has no workers; start some with dask worker {self.address}"
            raise InputError(what, key="--scheduler") from None
        try:
            identities = self._client.run(worker_identity)
        except Exception as error:
            what = f"a worker of {self.address} cannot import this navfw: {error}"
            raise InputError(f"{what}; install the same version there", key="--scheduler") from None
        for address, theirs in sorted(identities.items()):
            compare_identities(address, theirs, worker_identity())
        self._files = ProjectFiles.of(self.cases)
        limits = self.limit, self.memory
        self._client.register_plugin(FilesOnWorker(self._files, self.work, limits))

    def _result(self, future: Any, job: Job) -> RunRow | WorkerFailure:
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
            with atomic_file(job.pictures / row.picture.rpartition("/")[2]) as unfinished:
                unfinished.write_bytes(picture)
        return row  # type: ignore[no-any-return]


@cache
def worker_identity() -> dict[str, str]:
    """What has to be the same on all machines: versions, navfw's own files, and its plugins.

    ``plugins`` are those of other installed packages, as ``kind name``.
    """
    points = [(kind, metadata.entry_points(group=group)) for group, kind in GROUPS.items()]
    return {
        "navfw": f"{metadata.version('navfw')} ({code_fingerprint()[:12]})",
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in _LIBRARIES},
        "pybullet": pybullet_version(),
        "plugins": ", ".join(sorted({f"{kind} {p.name}" for kind, own in points for p in own})),
    }


def compare_identities(address: str, theirs: dict[str, str], ours: dict[str, str]) -> None:
    """Raise InputError at the first difference; a worker may have more plugins."""
    lacking = set(ours["plugins"].split(", ")) - {"", *theirs["plugins"].split(", ")}
    if lacking:
        what = f"the worker {address} lacks the plugin {', '.join(sorted(lacking)[:5])}"
        raise InputError(f"{what}; install its package there", key="--scheduler")
    for name, value in ours.items():
        if name != "plugins" and theirs.get(name) != value:
            what = f"the worker {address} has {name} {theirs.get(name)}, here it is {value}"
            raise InputError(f"{what}; install the same there", key="--scheduler")


@dataclass(frozen=True)
class ProjectFiles:
    """Files as a zip archive, and the folders or files here that its names stand for.

    Inside the archive, the project is ``project``; folders of worlds, missions and stacks outside
    of it are ``outside-2``, ``outside-3``, ...
    """

    name: str
    archive: bytes
    roots: dict[str, Path]

    @classmethod
    def of(cls, cases: Sequence[Case]) -> Self:
        """The files of ``cases``, and of the project around the working folder."""
        roots = _fixed_roots()
        project = project_folder()
        if project is not None and real_path(project) != shipped_folder():
            roots["project"] = project
        worlds = [Path(case.world).parent for case in cases if case.world]
        files = [Path(file) for case in cases for file in (case.mission, case.stack) if file]
        for path in dict.fromkeys([*worlds, *files]):
            if not any(path.is_relative_to(root) for root in roots.values()):
                roots[f"outside-{len(roots)}{path.suffix if path.is_file() else ''}"] = path
        places = {name: root for name, root in roots.items() if name.startswith("outside")}
        if "project" in roots:
            places |= {f"project/{name}": roots["project"] / name for name in _PARTS}
        stream, total = io.BytesIO(), 0
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("project/navfw.toml", b"")
            for name, file in files_of(places):
                content = read_input(file, _MAX_BYTES)
                total += len(content)
                if total > _MAX_BYTES:
                    what = f"the files of the project exceed {_MAX_BYTES // 1_000_000} MB"
                    raise InputError(f"{what}; move what no run needs", file=project or file)
                archive.writestr(name, content)
        return cls(f"navfw-{os.urandom(8).hex()}", stream.getvalue(), roots)

    def packed(self, job: Job) -> Job:
        """``job`` with names of the archive instead of local paths."""
        # the innermost: the package may lie inside of what is shipped
        roots = sorted(self.roots.items(), key=lambda item: -len(str(item[1])))

        def named(path: str) -> str:
            within = ((n, root) for n, root in roots if path and Path(path).is_relative_to(root))
            name, root = next(within, ("", Path()))
            return f"{name}:{Path(path).relative_to(root).as_posix()}" if name else path

        return _with_paths(job, named)


def unpacked(job: Job, folder: Path) -> Job:
    """``job`` with the paths of this machine; ``folder`` is that of the unpacked files."""

    def place(path: str) -> str:
        name, colon, rest = path.partition(":")
        return str(_fixed_roots().get(name, folder / name) / rest) if colon else path

    return _with_paths(job, place)


def _with_paths(job: Job, changed: Callable[[str], str]) -> Job:
    case = job.case
    world, mission, stack = map(changed, (case.world, case.mission, case.stack))
    return replace(job, case=replace(case, world=world, mission=mission, stack=stack))


def _fixed_roots() -> dict[str, Path]:
    """The folders that every machine has."""
    return {"shipped": shipped_folder(), "package": Path(__file__).parents[1]}


# --- in a worker of Dask -------------------------------------------------------------------------

Answer = tuple[RunRow | WorkerFailure, bytes | None]
"""A row, or why there is none, with the picture of the run as PNG."""


class FilesOnWorker(distributed.WorkerPlugin):
    """Unpacks the files of a suite on every worker, also on one that joins later."""

    def __init__(self, files: ProjectFiles, work: str, limits: tuple[float, float]) -> None:
        self.name, self._archive = files.name, files.archive
        self._identity, self._work, self._limits = worker_identity(), work, limits
        self._folder = Path()
        self._idle: list[WorkerPool[Job, Answer]] = []

    def setup(self, worker: distributed.Worker) -> None:
        """Unpack the files in the worker's own folder."""
        self._folder = Path(worker.local_directory) / self.name
        with zipfile.ZipFile(io.BytesIO(self._archive)) as archive:
            archive.extractall(self._folder)

    def teardown(self, worker: distributed.Worker) -> None:
        """End the processes of the runs."""
        del worker
        while self._idle:
            self._idle.pop().__exit__(None, None, None)

    def run(self, job: Job) -> Answer:
        """Drive a run in a process that is kept for the next one."""
        if self._identity != worker_identity():
            raise SimulationError("the worker has another version of navfw or of its libraries")
        # Dask's nanny starts it as a daemon, which may have no processes of its own
        multiprocessing.current_process().daemon = False
        try:
            pool = self._idle.pop()
        except IndexError:
            limit, memory = self._limits
            work = partial(_drive_in, self._work, self._folder)
            pool = WorkerPool(work, 1, limit, memory=memory).__enter__()
        try:
            ((_, answer),) = pool.run([unpacked(job, self._folder)])
        finally:
            self._idle.append(pool)
        return (answer, None) if isinstance(answer, WorkerFailure) else answer


def drive(name: str, job: Job) -> Answer:
    """A task of Dask: one run on this worker, with the files called ``name``."""
    plugin: Any = distributed.get_worker().plugins.get(name)
    if plugin is None:
        raise SimulationError("the worker could not take the files of the suite; see its log")
    answer: Answer = plugin.run(job)
    return answer


def _drive_in(work: str, folder: Path, job: Job) -> Answer:
    """In the process of the run: its project is the unpacked one, trusted by who sent it."""
    os.environ[TRUST_VARIABLE] = "1"
    os.chdir(folder / "project")
    with tempfile.TemporaryDirectory(prefix="navfw-pictures-") as made:
        pictures = Path(made) / job.pictures.name
        pictures.mkdir(exist_ok=True)
        row: RunRow = resolve_name(work)(replace(job, pictures=pictures))
        picture = pictures / Path(row.picture).name if row.picture else None
        return row, picture.read_bytes() if picture else None
