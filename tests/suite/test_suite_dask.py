"""A suite on a scheduler of Dask with two workers on loopback, one of which is killed."""

import pickle
import signal
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import suite_samples as samples
from cli_calls import answer, put_files, refusal
from dask_cluster import Cluster, cluster
from processes import printed

from navfw.errors import InputError
from navfw.suite.run_row import RunRow
from navfw.suite.suite_folder import SuiteFolder
from navfw.suite.suite_plan import SuitePlan
from navfw.suite.suite_run import run_suite

pytest.importorskip("distributed", reason="needs the extra dask: uv sync --extra dask")

from navfw.suite import dask_engine
from navfw.suite.dask_engine import (
    DaskEngine,
    FilesOnWorker,
    compare_identities,
    unpacked,
    worker_identity,
)

__all__ = ["cluster"]


@pytest.mark.slow
def test_every_run_ends_once_although_a_worker_is_killed(cluster: Cluster, tmp_path: Path) -> None:
    address, workers = cluster
    plan = SuitePlan("rooms", tuple(samples.case(seed) for seed in range(30)), {"a": "1"})
    out = SuiteFolder(tmp_path / "out")
    have = out.open(plan, "abc")
    ended: list[int] = []

    def kill_one(case: object, row: RunRow) -> None:
        ended.append(row.seed)
        if len(ended) == 6:
            workers[0].send_signal(signal.SIGKILL)

    work = "suite_samples:slow_fake_run"
    with DaskEngine(address, plan.cases, 60.0, 2000.0, work) as engine:
        done = run_suite(plan, out, engine, have=have, on_row=kill_one)
    assert (done.complete, done.exit_code) == (True, 0)
    assert sorted(ended) == list(range(30))
    assert [row.seed for row in out.rows()] == ended


@pytest.mark.slow
def test_suite_and_tune_drive_on_a_cluster(cluster: Cluster, tmp_path: Path) -> None:
    on_cluster = ("--engine", "dask", "--scheduler", cluster[0])
    suite, stack = tmp_path / "short.yaml", tmp_path / "detuned.yaml"
    suite.write_text("entries: [{world: empty, missions: [straight]}]\n", encoding="utf-8")
    stack.write_text("base: default\nbehaviors:\n  avoid: {spare: 0.5}\n", encoding="utf-8")
    words = ["suite", suite, "--seeds", "0:3", "--stack", stack, "--keep", "all"]
    hashes = []
    for name, where in (("cluster", on_cluster), ("process", ())):
        told = answer(*words, "--out", tmp_path / name, *where)
        assert len(list((tmp_path / name).glob("**/*.png"))) == 3
        hashes.append([run["command_hash"] for run in told["runs"]])
    assert hashes[0] == hashes[1]

    words = ["tune", suite, "--stack", stack, "--param", "avoid.spare", "--trials", "2"]
    words += ["--seeds", "0:2", "--validate", "9:10", "--out", tmp_path / "study"]
    assert answer(*words, *on_cluster)["runs"] == 1


@pytest.mark.parametrize("command", ["suite", "tune"])
def test_scheduler_and_engine_belong_together(command: str) -> None:
    needed = {"suite": ["--seeds", "0:2"], "tune": ["--stack", "default", "--trials", "2"]}
    words = [command, "rooms", *needed[command]]
    assert "needs --engine dask" in refusal(*words, "--scheduler", "tcp://127.0.0.1:9")
    assert "tcp://HOST:PORT" in refusal(*words, "--engine", "dask")


def test_a_worker_of_another_version_or_without_a_plugin_is_refused() -> None:
    ours = {**worker_identity(), "navfw": "9.9 (abc)"}
    with pytest.raises(InputError, match=r"has navfw .*, here it is 9\.9 \(abc\); install"):
        compare_identities("tcp://a", worker_identity(), ours)
    ours = {**worker_identity(), "plugins": "flow mine, fusion yours"}
    theirs = {**ours, "plugins": "fusion yours"}
    with pytest.raises(InputError, match="lacks the plugin flow mine; install its package"):
        compare_identities("tcp://a", theirs, ours)


@pytest.mark.parametrize(("scheme", "why"), [("tcp", ""), ("tls", ".*check your TLS config")])
def test_a_scheduler_that_does_not_answer(
    scheme: str, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask_engine, "CONNECT_TIME", 0.5)
    address = f"{scheme}://127.0.0.1:9"
    engine = DaskEngine(address, (), limit=1.0, memory=1.0)
    with pytest.raises(InputError, match=f"no scheduler of Dask answers at {address}{why}"):
        engine.__enter__()


def test_a_worker_itself_imports_no_simulator(tmp_path: Path) -> None:
    work = "navfw.suite.suite_run:run_case"
    plugin = FilesOnWorker([samples.case(1)], work, 10.0, 1000.0)
    (tmp_path / "plugin").write_bytes(pickle.dumps(plugin))
    code = "import pickle, sys; pickle.load(open(sys.argv[1], 'rb')); print('numba' in sys.modules)"
    assert printed(code, tmp_path / "plugin") == "False"


def test_paths_travel_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    texts = {"tuned.yaml": "base: default", "mine/worlds/hall/world.yaml": "name: hall"}
    put_files(tmp_path, {**texts, "mine/navfw.toml": ""})
    monkeypatch.chdir(tmp_path / "mine")
    stack, world = (str(tmp_path / name) for name in texts)
    case = samples.case(1, family="", world=world, stack=stack)
    plugin = FilesOnWorker([case], "a:b", 10.0, 1000.0)
    worker: Any = SimpleNamespace(local_directory=str(tmp_path / "worker"), address="tcp://a")
    plugin.setup(worker)
    case = unpacked(case, tmp_path / "worker" / plugin.name)
    for path, text in ((case.world, "name: hall"), (case.stack, "base: default")):
        assert Path(path).is_relative_to(tmp_path / "worker")
        assert Path(path).suffix == ".yaml"
        assert Path(path).read_text() == text
