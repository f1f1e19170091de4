"""A pipeline that costs nothing (`toyline`), on a store and a video of its own, for tests of what is around stages."""

import os

# Two workers share two cores, and the matrices are small: a second thread of BLAS or torch only waits for the first.
os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy and torch are imported, here and in processes of tests

import fcntl
import gc
import json
import logging
import shutil
import signal
import sqlite3
import subprocess
import sys
import urllib.request
import uuid
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from short_clip import recover_film

from humanmm.config import Config
from humanmm.storage.store import artifact
from humanmm.storage.store import store as artifacts
from humanmm.storage.store.identity import identify
from humanmm.storage.store.open import open_store
from humanmm.storage.store.store import Store
from humanmm.tasks import pictures, pipeline
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.units import module_facts
from humanmm.tasks.units.selection import Selection

# A shell that starts the tests in the background, or nohup, leaves signals ignored, and programs inherit that.
for _number, _action in {
    signal.SIGINT: signal.default_int_handler, signal.SIGQUIT: signal.SIG_DFL, signal.SIGHUP: signal.SIG_DFL
}.items():  # fmt: skip
    if signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, _action)

ROOT = Path(__file__).resolve().parent.parent


def pytest_collection_finish() -> None:
    """Leave what is loaded by now, 600,000 objects, out of every later search for garbage, which takes 0.3 s with them:
    `read_facts` alone makes one for each video."""
    gc.collect()
    gc.freeze()


@dataclass
class Toy:
    """A folder with a copy of the toy's code, a video, a store, and a log of what was executed."""

    folder: Path
    video: Path
    store: Path
    log: Path
    capture: pytest.CaptureFixture[str]

    def executed(self) -> list[str]:
        """What was executed since the last call, sorted; a shot or scene is named by its first frame."""
        lines = self.log.read_text().split() if self.log.exists() else []
        self.log.unlink(missing_ok=True)
        return sorted(lines)

    def edit(self, module: str, old: str, new: str) -> None:
        """Change the toy's code."""
        path = self.folder / "toyline" / f"{module}.py"
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))
        for name in [name for name in sys.modules if name.startswith("toyline.") and name != "toyline.table"]:
            del sys.modules[name]

    def open(self, *, selection: Selection | None = None, read_only: bool = False, **settings: Any) -> VideoRun:
        """A run on the toy's store; settings as `camera={"static": True}`."""
        return self.open_on(open_store(self.store, read_only=read_only), selection=selection, **settings)

    def open_on(self, store: Store, *, selection: Selection | None = None, **settings: Any) -> VideoRun:
        """A run on another store."""
        config = Config.model_validate(settings)
        return VideoRun(identify(self.video, store), config, store, selection=selection)

    def run(self, *, selection: Selection | None = None, expect_failure: bool = False, **settings: Any) -> VideoRun:
        """Every stage in order, one after the other, without Prefect; failures of units are noted in the run."""
        return self._through(self.open(selection=selection, **settings), expect_failure=expect_failure)

    def run_on(self, store: Store, **settings: Any) -> VideoRun:
        """The same on another store."""
        return self._through(self.open_on(store, **settings), expect_failure=False)

    def _through(self, run: VideoRun, *, expect_failure: bool) -> VideoRun:
        for stage in run.stages:
            for unit in run.units(stage) or ():
                try:
                    run.execute(unit)
                except Exception as error:
                    if not expect_failure:
                        raise
                    assert run.outcomes[unit.id].error is error  # noqa: PT017 (which stage fails, the test does not say)
        run.close()
        return run

    def command(self, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        """The command line in a process of its own."""
        return subprocess.run(
            self.command_line(*arguments), env=self.environment(**environment), cwd=self.folder,
            capture_output=True, text=True, timeout=200, check=False,
        )  # fmt: skip

    def main(self, *arguments: str, **environment: str) -> tuple[int, str, str]:
        """The command line in this process: exit status, standard output, standard error."""
        import humanmm.cli

        with pytest.MonkeyPatch.context() as patched:
            patched.chdir(self.folder)
            for name, value in {"HUMANMM_STORE": str(self.store), **environment}.items():
                patched.setenv(name, value)
            self.capture.readouterr()
            try:
                status = humanmm.cli.main(arguments)
            except SystemExit as left:
                status = int(left.code or 0)
        captured = self.capture.readouterr()
        return status, captured.out, captured.err

    def command_line(self, *arguments: str) -> list[str]:
        return [sys.executable, "-m", "toyline", *arguments]

    def environment(self, **more: str) -> dict[str, str]:
        path = os.pathsep.join([str(self.folder), str(ROOT / "src")])
        own = {"PYTHONPATH": path, "TOY_LOG": str(self.log), "HUMANMM_STORE": str(self.store)}
        return {**os.environ, **own, **more}


@pytest.fixture
def short_videos(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Has `bench … --size tiny` take a short video for each of some numbers of cuts."""
    from humanmm.flows.bench import planned

    def set_cuts(*cuts: int) -> None:
        monkeypatch.setitem(planned.SIZES, "tiny", (1, cuts, 20 * (max(cuts) + 1)))

    return set_cuts


@pytest.fixture
def two_methods(monkeypatch: pytest.MonkeyPatch) -> None:
    """Has `bench` run ours and the baseline alone; `tests/flows/bench/test_motion.py` runs all."""
    from humanmm.flows.bench import tables

    monkeypatch.setattr(tables, "METHODS", ("humanmm", "concat"))


@pytest.fixture(scope="session")
def for_all_processes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that all processes of the tests share."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@pytest.fixture
def parsed_once(for_all_processes: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each module of ours is parsed once for all tests, and not for each test with a cache folder of its own."""
    monkeypatch.setattr(module_facts, "cache_folder", lambda: for_all_processes)


@pytest.fixture(scope="session")
def server_cache(tmp_path_factory: pytest.TempPathFactory, for_all_processes: Path) -> Iterator[Path]:
    """A cache folder whose Prefect server all tests of this process share."""
    folder = tmp_path_factory.mktemp("cache")
    before = {name: os.environ.get(name) for name in ("HUMANMM_CACHE", "HUMANMM_SERVER_IDLE_S")}
    os.environ.update({"HUMANMM_CACHE": str(folder), "HUMANMM_SERVER_IDLE_S": "300"})
    with (for_all_processes / "database.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        empty = for_all_processes / "prefect.db"
        if empty.exists():
            give_database(folder, empty)
        else:
            start = "from humanmm.flows.server.local_server import prefect_server\nwith prefect_server(): pass\n"
            own = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
            subprocess.run([sys.executable, "-c", start], env=own, check=True, capture_output=True)
            copy_database(next(folder.glob("prefect-*/prefect.db")), empty)
    yield folder
    if "prefect.logging.handlers" in sys.modules:  # what it has still to send, it would try to send for a minute
        sys.modules["prefect.logging.handlers"].APILogWorker.drain_all()
    for name, value in before.items():
        os.environ.pop(name)
        if value is not None:
            os.environ[name] = value
    for state in folder.glob("*/server.json"):
        os.kill(json.loads(state.read_text())["pid"], signal.SIGTERM)


@pytest.fixture
def new_cache(tmp_path: Path, server_cache: Path, for_all_processes: Path) -> Path:
    """A cache folder of one test, whose Prefect server has still to be started."""
    give_database(tmp_path / "cache", for_all_processes / "prefect.db")
    return tmp_path / "cache"


def give_database(cache: Path, empty: Path) -> None:
    """Give a cache folder Prefect's database: making it anew takes a server 8 s of a processor."""
    folder = cache / f"prefect-{version('prefect')}"
    folder.mkdir(parents=True, mode=0o700)
    shutil.copy2(empty, folder / "prefect.db")
    (folder / "prefect.db").chmod(0o600)  # as the server makes it


def copy_database(source: Path, target: Path) -> None:
    """A database as it is now, also while a server uses it."""
    with closing(sqlite3.connect(source)) as one, closing(sqlite3.connect(target)) as other:
        one.backup(other)


@pytest.fixture(scope="session")
def recovered_film(server_cache: Path, for_all_processes: Path) -> Path:
    """A folder with a few frames of the shipped clip, `film.mp4`, its truth, and its `run` and `store`: recovered once
    for all tests, in whichever process of theirs."""
    recover_film(for_all_processes / "recovered")
    return for_all_processes / "recovered"


@pytest.fixture(scope="session")
def s3_server() -> Iterator[str]:
    """Address of an S3 server of this process alone."""
    server = pytest.importorskip("moto.server", reason="an S3 server to test against: pip install 'humanmm[dev]'")
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    own = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    own.start()
    host, port = own.get_host_and_port()
    yield f"http://{host}:{port}"
    own.stop()


@pytest.fixture
def bucket(request: pytest.FixtureRequest, s3_server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """An empty bucket as `s3://…`, and the environment that finds it."""
    name = f"test-{uuid.uuid4().hex}"
    for key, value in {
        "AWS_ENDPOINT_URL": s3_server, "AWS_ALLOW_HTTP": "true", "AWS_REGION": "us-east-1",
        "AWS_ACCESS_KEY_ID": "nobody", "AWS_SECRET_ACCESS_KEY": "nothing",
    }.items():  # fmt: skip
        monkeypatch.setenv(key, value)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))  # its batches
    if "server_cache" not in request.fixturenames:
        monkeypatch.setenv("HUMANMM_CACHE", str(tmp_path / "cache"))
    urllib.request.urlopen(urllib.request.Request(f"{s3_server}/{name}", method="PUT")).close()
    return f"s3://{name}/prefix"


@pytest.fixture
def toy(
    tmp_path: Path, parsed_once: None, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Iterator[Toy]:
    """A fresh toy: three shots [0, 20), [20, 40), [40, 60) in two scenes [0, 20), [20, 60)."""
    source = Path(__file__).parent / "toyline"
    shutil.copytree(source, tmp_path / "toyline", ignore=shutil.ignore_patterns("__pycache__"))
    video = tmp_path / "film.mp4"
    video.write_text(json.dumps({"num_frames": 60, "cuts": [20, 40]}))
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("TOY_LOG", str(tmp_path / "executed"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(artifact, "_sync", lambda folder: None)  # no test pulls the plug, and a busy disk is slow
    monkeypatch.setattr(artifacts, "sync_to_disk", lambda folder: None)
    monkeypatch.setattr(artifact, "INLINE_BYTES", 1 << 20)  # zarr takes longer than all stages; `in_zarr` has it
    monkeypatch.setattr(pictures, "timeline", lambda *_: np.full((8, 8, 3), 255, np.uint8))  # test_deliver draws it
    _forget()
    monkeypatch.setattr(pipeline, "STAGES", import_module("toyline.table").STAGES)
    yield Toy(tmp_path, video, tmp_path / "store", tmp_path / "executed", capfd)
    _forget()


@pytest.fixture
def in_zarr(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> None:
    """The toy's artifacts keep their arrays in zarr, as real ones do."""
    monkeypatch.setattr(artifact, "INLINE_BYTES", 512)


@pytest.fixture(params=["disk", "bucket"])
def any_toy(request: pytest.FixtureRequest, toy: Toy) -> Toy:
    """The toy on a store of each kind."""
    if request.param == "bucket":
        toy.store = Path(request.getfixturevalue("bucket"))
    return toy


def _forget() -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "toyline"]:
        del sys.modules[name]
