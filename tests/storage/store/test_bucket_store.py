"""A store in an S3 bucket: conditional puts commit, leases lock, and what one host damages no other sees."""

import io
import pickle
import re
import subprocess
import sys
import tarfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from humanmm.errors import ConfigError, StoreError
from humanmm.storage.store import locks, maintenance
from humanmm.storage.store.artifact import Manifest
from humanmm.storage.store.bucket import Bucket
from humanmm.storage.store.bucket_store import BucketStore, extract
from humanmm.storage.store.open import open_store
from humanmm.storage.store.recipe import Recipe


@dataclass(frozen=True)
class Result:
    values: np.ndarray
    note: str


RESULT = Result(np.arange(1000.0), "fine")
RECIPE = Recipe("toy", 1, {}, {}, {}, {}, {}, {})


def _put(store: BucketStore, result: Result = RESULT) -> Manifest:
    with store.lock("toy", RECIPE.key), store.new_folder() as folder:
        return store.commit(folder, result, Result, RECIPE, unit="video", seconds=1.0, version="0")


@pytest.fixture
def store(bucket: str) -> BucketStore:
    return BucketStore(bucket)


@pytest.fixture
def elsewhere(bucket: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> BucketStore:
    """The same store on another host."""
    with monkeypatch.context() as patched:
        patched.setenv("HUMANMM_CACHE", str(tmp_path / "another host"))
        return BucketStore(bucket)


@pytest.fixture
def quick_leases(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seconds in {"LEASE_S": 1.0, "RENEW_S": 0.1, "POLL_S": 0.05}.items():
        monkeypatch.setattr(locks, name, seconds)


def _objects(store: BucketStore, folder: str) -> list[str]:
    return [found.name for found in Bucket(store.location).list(folder)]


def test_another_host_finds_and_reads_what_one_has_written(store: BucketStore, elsewhere: BucketStore) -> None:
    ref = _put(store).ref
    assert elsewhere.root != store.root
    np.testing.assert_array_equal(elsewhere.read(ref, Result).values, RESULT.values)
    assert len(_objects(store, "artifacts")) == 2


def test_an_artifact_without_its_commit_marker_does_not_exist(store: BucketStore, elsewhere: BucketStore) -> None:
    ref = _put(store).ref
    Bucket(store.location).remove([f"{ref.uri}/COMMIT"])
    assert elsewhere.find("toy", ref.key) is None
    assert store.find("toy", ref.key) is None, "a copy on this host proves nothing"
    (entry,) = [entry for entry in store.entries() if entry.kind == "unfinished"]
    assert entry.busy, "its writer may be about to commit it"


@pytest.mark.parametrize("harm", ["flip", "truncate", "delete"])
def test_a_damaged_object_is_set_aside_and_its_artifact_computed_again(
    store: BucketStore, elsewhere: BucketStore, harm: str, tmp_path: Path
) -> None:
    ref = _put(store).ref
    (pack,) = [name for name in _objects(store, "artifacts") if name.endswith(".tar")]
    content = bytearray((Bucket(store.location).read(pack) or (b"",))[0])
    content[content.index(b'"note"') + 10] ^= 1
    Bucket(store.location).remove([pack])
    if harm != "delete":
        Bucket(store.location).write(pack, bytes(content if harm == "flip" else content[: len(content) // 2]))
    reader = open_store(store.location, read_only=True)
    reader.root = tmp_path / "a third host"
    before = _objects(store, "artifacts")
    assert reader.find("toy", ref.key) is None and reader.damage("toy", ref.key)
    assert _objects(store, "artifacts") == before, "a read-only store only tells"
    assert elsewhere.find("toy", ref.key) is None
    assert elsewhere.damage("toy", ref.key)
    assert _objects(store, "artifacts") == []
    assert len(_objects(store, "damaged")) == (0 if harm == "delete" else 1)
    _put(elsewhere)
    assert store.read(ref, Result).note == "fine"


def test_a_damaged_copy_is_made_again_from_the_bucket(store: BucketStore, bucket: str) -> None:
    ref = _put(store).ref
    (store.root / ref.uri / "result.json").write_text("{}")
    again = BucketStore(bucket)
    assert again.read(ref, Result).note == "fine"
    assert again.damage("toy", ref.key) is None and _objects(store, "damaged") == []


def test_of_two_that_commit_at_once_the_first_counts_and_both_go_on_with_it(
    store: BucketStore, elsewhere: BucketStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without any lease: as after a holder that had stopped for too long."""
    created = Bucket.create

    def late(self: Bucket, name: str, content: bytes) -> str | None:
        if name.endswith("COMMIT"):
            monkeypatch.setattr(Bucket, "create", created)
            with elsewhere.new_folder() as folder:
                elsewhere.commit(folder, RESULT, Result, RECIPE, unit="video", seconds=1.0, version="first")
        return created(self, name, content)

    monkeypatch.setattr(Bucket, "create", late)
    with store.new_folder() as folder:
        second = Result(np.zeros(2), "other")
        kept = store.commit(folder, second, Result, RECIPE, unit="video", seconds=1.0, version="second")
    assert kept.version == "first"
    assert store.read(kept.ref, Result).note == elsewhere.read(kept.ref, Result).note == "fine"
    assert len(_objects(store, "artifacts")) == 2, "the loser's object is gone"


@pytest.mark.usefixtures("quick_leases")
def test_the_lease_of_a_holder_that_lives_is_never_taken(store: BucketStore, elsewhere: BucketStore) -> None:
    got = threading.Event()

    def wait() -> None:
        with elsewhere.lock("toy", "key"):
            got.set()

    with store.lock("toy", "key"):
        waiter = threading.Thread(target=wait)
        waiter.start()
        assert not got.wait(2.5 * locks.LEASE_S)
    assert got.wait(5)
    waiter.join()


@pytest.mark.usefixtures("quick_leases")
def test_the_lease_of_a_killed_holder_is_taken_over_when_it_has_run_out(
    store: BucketStore, elsewhere: BucketStore
) -> None:
    Bucket(store.location).write("locks/toy-key", b"dead-host 1 0123 4")
    with elsewhere.try_lock("toy", "key") as held:
        assert not held, "whether it lives cannot be told at once"
    with elsewhere.lock("toy", "key"), store.try_lock("toy", "key") as held:
        assert not held
    with store.try_lock("toy", "key") as held:
        assert held


def test_when_the_holder_of_a_lease_is_killed_the_waiter_proceeds_as_soon_as_it_has_run_out(
    store: BucketStore, quick_leases: None
) -> None:
    script = (
        "import sys, time\nfrom humanmm.storage.store.open import open_store\n"
        "with open_store(sys.argv[1]).lock('toy', 'key'):\n    print('held', flush=True)\n    time.sleep(100)\n"
    )
    with subprocess.Popen([sys.executable, "-c", script, store.location], stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None and holder.stdout.readline() == "held\n"
        holder.kill()
        began = time.monotonic()
        with store.lock("toy", "key"):
            assert locks.LEASE_S <= time.monotonic() - began < locks.LEASE_S + 2


class _Refusing:
    """The server's application, except that it takes no archives while it `refuses`."""

    def __init__(self, application: Any) -> None:
        self.refuses = True
        self._application = application

    def __call__(self, asked: dict[str, Any], answer: Any) -> Any:
        if not (self.refuses and asked["REQUEST_METHOD"] == "PUT" and asked["PATH_INFO"].endswith(".tar")):
            return self._application(asked, answer)
        asked["wsgi.input"].read(int(asked["CONTENT_LENGTH"]))
        answer("403 Forbidden", [("Content-Type", "application/xml")])
        return [b"<Error><Code>QuotaExceeded</Code><Message>the quota is used up</Message></Error>"]


def test_a_service_that_takes_nothing_more_is_one_clear_error_and_leaves_nothing(
    bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from moto.server import DomainDispatcherApplication, create_backend_app
    from werkzeug.serving import make_server

    front = _Refusing(DomainDispatcherApplication(create_backend_app))
    serving = make_server("127.0.0.1", 0, front, threaded=True)
    threading.Thread(target=serving.serve_forever, daemon=True).start()
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{serving.port}")
    store = BucketStore(bucket)
    with pytest.raises(StoreError, match=rf"cannot write artifacts/toy/.* in {bucket}: "):
        _put(store)
    assert _objects(store, "artifacts") == [] and not list(store.root.glob("tmp/*"))
    front.refuses = False
    assert store.read(_put(store).ref, Result).note == "fine"
    serving.shutdown()


@pytest.mark.usefixtures("quick_leases")
def test_a_holder_whose_lease_was_taken_does_not_free_its_successors(store: BucketStore) -> None:
    bucket = Bucket(store.location)
    with store.lock("toy", "key"):
        bucket.write("locks/toy-key", b"successor 1 0123 4")
    assert (bucket.read("locks/toy-key") or (b"",))[0] == b"successor 1 0123 4"


@pytest.mark.usefixtures("bucket")
def test_a_bucket_that_is_not_there_or_not_named_is_one_clear_error() -> None:
    nowhere = BucketStore("s3://no-such-bucket")
    with pytest.raises(StoreError, match="in s3://no-such-bucket: "):
        _put(nowhere)
    with pytest.raises(ConfigError, match="is no bucket; expected s3://bucket/prefix"):
        Bucket("s3://")


def test_the_store_travels_to_another_process(store: BucketStore) -> None:
    ref = _put(store).ref
    assert pickle.loads(pickle.dumps(store)).read(ref, Result).note == "fine"


def test_verify_and_gc_care_for_the_bucket_and_for_the_copies(
    store: BucketStore, elsewhere: BucketStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    ref = _put(store).ref
    outputs = {("toy", 1): f"{__name__}:Result"}
    assert [f.problem for f in maintenance.verify(elsewhere, outputs=outputs, deep=True)] == [""]
    assert not (elsewhere.root / ref.uri).exists(), "to verify a bucket fills no disk"
    assert maintenance.removable(store, unused_days=1) == []
    items = maintenance.removable(store, unused_days=-1)
    assert [item.entry.kind for item in items] == ["artifact", "copy"]
    with elsewhere.lock("toy", ref.key):
        assert maintenance.remove(store, items[:1]) == 0
    assert maintenance.remove(store, items[:1]) > 0
    assert elsewhere.find("toy", ref.key) is None and _objects(store, "artifacts") == []
    _put(store)
    (pack,) = [name for name in _objects(store, "artifacts") if name.endswith(".tar")]
    Bucket(store.location).write(pack, b"no archive")
    assert ["cannot be unpacked" in f.problem for f in maintenance.verify(elsewhere, outputs=outputs, deep=False)] == [
        True
    ]


def test_an_artifact_in_use_stays_young(store: BucketStore, monkeypatch: pytest.MonkeyPatch) -> None:
    ref = _put(store).ref
    marker = f"{ref.uri}/COMMIT"
    replaced: list[str] = []
    monkeypatch.setattr(Bucket, "replace", lambda self, name, content, tag: replaced.append(name))
    store.find("toy", ref.key)
    assert replaced == []
    monkeypatch.setattr("humanmm.storage.store.bucket_store.TOUCH_S", -1.0)
    store.find("toy", ref.key)
    assert replaced == [marker]


def test_a_video_recovered_on_one_host_is_known_on_another(toy: Any, bucket: str, tmp_path: Path) -> None:
    stored = ("--store", bucket)
    dry = toy.main("recover", "film.mp4", "--dry-run", *stored)
    assert dry[0] == 0 and "will run: no artifact yet" in dry[1], dry[2]
    run = toy.run_on(open_store(bucket))
    assert {outcome.state for outcome in run.outcomes.values()} == {"computed"} and len(toy.executed()) == 18
    other = {"HUMANMM_CACHE": str(tmp_path / "another host")}
    done = toy.main("recover", "film.mp4", "--out", "out", *stored, **other)
    assert done[:2] == (0, "out\n") and toy.executed() == [], done[2]
    assert f"store {bucket}: 1 videos" in toy.main("status", *stored, **other)[1]
    assert "up to date" in toy.main("status", "out", **other)[1]
    assert toy.main("verify", "--deep", *stored, **other)[1] == "18 artifacts are sound, 0 damaged\n"
    assert bucket in toy.main("store", "du", *stored)[1]
    checked = toy.main("doctor", *stored)[1]
    assert "writable, with conditional puts" in checked and "BAD  bucket" not in checked
    assert "BAD  bucket" in toy.main("doctor", "--store", "s3://no-such-bucket")[1]
    message = toy.main("batch", "status", *stored)
    assert message[0] == 1 and f"the store {bucket} has no batch" in message[2]


def test_du_verify_and_gc_tell_and_do_what_they_do_on_a_disk(toy: Any, bucket: str, tmp_path: Path) -> None:
    elsewhere = {"HUMANMM_STORE": bucket, "HUMANMM_CACHE": str(tmp_path / "another host")}
    run = toy.run_on(open_store(bucket))
    toy.executed()
    objects = Bucket(bucket)
    (pack,) = [found for found in objects.list(run.manifest("refine").ref.uri) if found.name.endswith(".tar")]
    message = toy.main("store", "du", **elsewhere)[1]
    assert re.search(rf"^refine +1 +{round((pack.num_bytes + 64) / 1000)} kB$", message, re.MULTILINE), message
    assert re.search(rf"^total +18 .* {bucket}$", message, re.MULTILINE), message

    content = bytearray((objects.read(pack.name) or (b"",))[0])
    with tarfile.open(fileobj=io.BytesIO(content)) as archive:
        content[archive.getmember("./result.json").offset_data + 80] ^= 1
    objects.write(pack.name, bytes(content))
    status, message, _ = toy.main("verify", **elsewhere)
    assert status == 1 and message.startswith(f"damaged: {run.manifest('refine').ref.uri}: result.json"), message
    assert toy.main("verify", "--deep", **elsewhere)[:2] == (0, "17 artifacts are sound, 0 damaged\n")

    listed = toy.main("gc", **elsewhere)[1]
    assert "(damaged, set aside)" in listed and "in 1 items could go; nothing was removed" in listed
    assert toy.main("gc", "--yes", **elsewhere)[0] == 0 and list(objects.list("damaged")) == []
    assert toy.main("verify", **elsewhere)[1] == "17 artifacts are sound, 0 damaged\n"
    toy.run_on(open_store(bucket))
    assert toy.executed() == ["refine"], "gc left what is in use"

    with open_store(bucket).lock("people", run.manifest("people", 1).recipe.key):
        toy.main("gc", "--yes", "--unused-days", "0", **elsewhere)
    left = {found.name.rpartition("/")[0] for found in objects.list("artifacts")}
    assert left == {run.manifest("people", 1).ref.uri}, "what somebody holds stays"
    assert "1 videos" not in message and f"store {bucket}" in toy.main("status", **elsewhere)[1]


@pytest.mark.parametrize("name", ["../out", "/out", "inside/../../out"])
def test_an_object_that_names_places_outside_is_damaged(name: str, tmp_path: Path) -> None:
    with tarfile.open(tmp_path / "a.tar", "w") as archive:
        archive.addfile(tarfile.TarInfo(name))
    with tarfile.open(tmp_path / "a.tar") as archive, pytest.raises(tarfile.TarError, match="outside"):
        extract(archive, tmp_path / "folder")
    assert not (tmp_path / "out").exists()


def test_an_object_that_holds_a_link_is_damaged(tmp_path: Path) -> None:
    link = tarfile.TarInfo("link")
    link.type, link.linkname = tarfile.SYMTYPE, "/etc/passwd"
    with tarfile.open(tmp_path / "a.tar", "w") as archive:
        archive.addfile(link)
    with tarfile.open(tmp_path / "a.tar") as archive, pytest.raises(tarfile.TarError, match="neither"):
        extract(archive, tmp_path / "folder")
