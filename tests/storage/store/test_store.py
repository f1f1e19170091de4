"""The store keeps its word: whole artifacts or none, damage found, the disk's faults told."""

import errno
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from humanmm.errors import StoreError
from humanmm.storage.store import maintenance
from humanmm.storage.store.artifact import DamageError, Manifest
from humanmm.storage.store.open import open_store
from humanmm.storage.store.recipe import Recipe
from humanmm.storage.store.store import Store
from humanmm.storage.store.video_records import RunNote


@dataclass(frozen=True)
class Result:
    values: np.ndarray
    note: str


RESULT = Result(np.arange(1000.0), "fine")
RECIPE = Recipe("toy", 1, {"start": 0}, {"a.b": "1"}, {}, {"python": "3.11"}, {"toy": {"x": 1}}, {"decode": "2"})
OTHER = Recipe("toy", 2, {}, {}, {}, {}, {}, {})


def _put(store: Store, result: Result = RESULT, recipe: Recipe = RECIPE) -> Manifest:
    with store.lock(recipe.stage, recipe.key), store.new_folder() as folder:
        (folder / "files" / "picture.png").write_bytes(b"picture")
        return store.commit(folder, result, Result, recipe, unit="video", seconds=1.0, version="0")


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "store")


@pytest.fixture(params=["disk", "bucket"])
def any_store(request: pytest.FixtureRequest, tmp_path: Path) -> Store:
    """A store of each kind."""
    return open_store(tmp_path / "store" if request.param == "disk" else request.getfixturevalue("bucket"))


def _fresh(store: Store) -> Store:
    """The same store as another process sees it."""
    return open_store(store.location)


def test_what_was_written_is_found_and_read(any_store: Store) -> None:
    store = any_store
    ref = _put(store).ref
    assert _fresh(store).find("toy", RECIPE.key) is not None
    np.testing.assert_array_equal(_fresh(store).read(ref, Result).values, RESULT.values)
    assert (store.files_of(ref) / "picture.png").read_bytes() == b"picture"
    assert len(ref.model_dump_json()) < 260
    assert str(store.root) not in ref.model_dump_json() and store.location not in ref.model_dump_json()


def test_a_store_moved_to_another_place_still_answers(store: Store, tmp_path: Path) -> None:
    ref = _put(store).ref
    moved = tmp_path / "elsewhere" / "deep"
    shutil.copytree(store.root, moved)
    shutil.rmtree(store.root)
    assert Store(moved).find("toy", RECIPE.key) is not None
    assert Store(moved).read(ref, Result).note == "fine"


def _files(store: Store) -> list[Path]:
    folder = store.root / _put(store).ref.uri
    return sorted(path for path in folder.rglob("*") if path.is_file())


@pytest.mark.parametrize("number", range(6))
@pytest.mark.parametrize("harm", ["flip", "truncate", "delete"])
def test_a_damaged_file_is_found_and_the_artifact_set_aside(store: Store, number: int, harm: str) -> None:
    files = _files(store)
    assert len(files) == 7
    path = files[number]
    content = bytearray(path.read_bytes())
    if harm == "delete":
        path.unlink()
    else:
        content[len(content) // 2] ^= 1
        path.write_bytes(bytes(content) if harm == "flip" else bytes(content[: len(content) // 2]))
    again = _fresh(store)
    assert again.find("toy", RECIPE.key) is None
    assert path.name in str(again.damage("toy", RECIPE.key)) or path.name in ("COMMIT", "manifest.json")
    assert not path.parent.exists() or RECIPE.key not in str(path.parent)
    assert list((store.root / "damaged").iterdir())
    _put(again)
    assert _fresh(store).find("toy", RECIPE.key) is not None


def test_a_file_too_many_is_damage(store: Store) -> None:
    folder = store.root / _put(store).ref.uri
    (folder / "arrays.zarr" / "values" / "c.1").write_bytes(b"a chunk from nowhere")
    assert _fresh(store).find("toy", RECIPE.key) is None


def test_a_read_only_store_tells_damage_and_touches_nothing(store: Store) -> None:
    folder = store.root / _put(store).ref.uri
    (folder / "result.json").write_text("{}")
    before = sorted(store.root.rglob("*"))
    reader = Store(store.root, read_only=True)
    assert reader.find("toy", RECIPE.key) is None
    assert "result.json" in str(reader.damage("toy", RECIPE.key))
    assert sorted(store.root.rglob("*")) == before


def test_an_equal_result_leaves_the_artifact_and_another_one_replaces_it(any_store: Store) -> None:
    store = any_store
    first = _put(store)
    assert _put(store).created == first.created
    assert _put(store, Result(np.zeros(3), "new")).digest != first.digest
    assert _fresh(store).read(first.ref, Result).note == "new"
    assert [entry.kind for entry in store.entries() if entry.stage and entry.kind != "copy"] == ["artifact"]


def test_a_process_that_has_read_the_older_result_reads_the_one_that_replaced_it(any_store: Store) -> None:
    ref = _put(any_store).ref
    reader = _fresh(any_store)
    assert reader.read(ref, Result).note == "fine"
    _put(any_store, Result(np.zeros(3), "new"))
    assert reader.read(ref, Result).note == "new"


def test_records_are_kept_and_a_read_only_store_writes_none(any_store: Store, tmp_path: Path) -> None:
    manifest = _put(any_store)
    any_store.remember("ab" * 32, "shot-0-20", manifest)
    done = RunNote("ab" * 32, "done", path="/film.mp4", run_dir=str(tmp_path), artifacts=(manifest.ref.uri,))
    any_store.note_run(done)
    reader = open_store(any_store.location, read_only=True)
    assert reader.last_recipe("ab" * 32, "toy", "shot-0-20") == RECIPE
    assert reader.last_digest("ab" * 32, "toy", "shot-0-20") == manifest.digest
    assert reader.last_recipe("ab" * 32, "toy", "shot-20-40") is None
    reader.note_run(RunNote("cd" * 32, "failed"))
    assert reader.known_runs() == [done] == [reader.last_run("ab" * 32)]
    assert reader.last_run("cd" * 32) is None


def test_one_key_has_one_holder_and_a_waiter_gets_it_next(any_store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("humanmm.storage.store.locks.POLL_S", 0.02)
    order = []

    def wait() -> None:
        with _fresh(any_store).lock("toy", "key"):
            order.append("second")

    with any_store.lock("toy", "key"):
        with _fresh(any_store).try_lock("toy", "key") as held:
            assert not held
        with _fresh(any_store).try_lock("toy", "another") as held:
            assert held
        waiter = threading.Thread(target=wait)
        waiter.start()
        time.sleep(0.2)
        order.append("first")
    waiter.join(timeout=10)
    assert order == ["first", "second"]
    with _fresh(any_store).try_lock("toy", "key") as held:
        assert held


def test_usage_counts_every_artifact_and_its_bytes(any_store: Store) -> None:
    size = _put(any_store).num_bytes
    _put(any_store, recipe=OTHER)
    count, total = maintenance.usage(any_store)["toy"]
    assert count == 2 and total > 2 * size


def test_usage_is_what_the_disk_has_less(store: Store) -> None:
    for number in range(20):
        _put(store, Result(np.arange(100.0 + number), "fine"), replace(RECIPE, schema_version=number))
    store.note("latest/video/run.json", "{}")
    message = sum(size for _, size in maintenance.usage(store).values())
    du = subprocess.run(["du", "-sk", str(store.root)], capture_output=True, text=True, check=True)
    assert message == pytest.approx(1024 * int(du.stdout.split()[0]), rel=0.02)


@pytest.mark.parametrize("fault", [errno.ENOSPC, errno.EIO, errno.EDQUOT])
def test_a_fault_of_the_disk_is_one_clear_error_and_leaves_nothing(
    store: Store, monkeypatch: pytest.MonkeyPatch, fault: int
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(fault, os.strerror(fault))

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        with pytest.raises(StoreError, match=r"cannot write the artifact of toy"):
            _put(store)
    assert not list(store.root.glob("tmp/*"))
    assert not list(store.root.glob("artifacts/*/*/*"))
    _put(store)
    assert _fresh(store).find("toy", RECIPE.key) is not None


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 256 kB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(folder)], capture_output=True, check=False
    )
    if mounted.returncode != 0:
        pytest.skip("a small file system can only be mounted with the right to do so")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.parametrize("kind", ["disk", "bucket"])
def test_a_disk_that_is_really_full_is_reported_and_leaves_nothing(
    small_disk: Path, kind: str, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = small_disk / "store" if kind == "disk" else request.getfixturevalue("bucket")
    monkeypatch.setenv("HUMANMM_CACHE", str(small_disk))  # where artifacts for a bucket are made
    store = open_store(place)
    _put(store)
    noise = np.random.default_rng(0).normal(size=100_000)
    with pytest.raises(StoreError, match="the disk is full; free some space"):
        _put(store, Result(noise, "large"), Recipe("toy", 1, {}, {}, {}, {}, {}, {}))
    assert not list(store.root.glob("tmp/*"))
    assert _fresh(store).find("toy", RECIPE.key) is not None


def test_a_killed_writer_is_swept_and_a_living_one_is_not(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("humanmm.storage.store.store.TMP_GRACE_S", -1.0)
    dead = store.root / "tmp" / "dead"
    dead.mkdir(parents=True)
    with store.new_folder() as alive:
        assert store.sweep() == 1
        assert alive.is_dir() and not dead.exists()


def test_when_the_holder_of_a_lock_is_killed_the_waiter_proceeds_within_two_seconds(store: Store) -> None:
    script = (
        "import sys, time\nfrom pathlib import Path\nfrom humanmm.storage.store.store import Store\n"
        "with Store(Path(sys.argv[1])).lock('toy', 'key'):\n    print('held', flush=True)\n    time.sleep(100)\n"
    )
    command = [sys.executable, "-c", script, str(store.root)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None and holder.stdout.readline() == "held\n"
        taken: list[float] = []

        def wait() -> None:
            with store.lock("toy", "key"):
                taken.append(time.monotonic())

        waiter = threading.Thread(target=wait)
        waiter.start()
        time.sleep(0.3)
        assert not taken
        killed = time.monotonic()
        holder.kill()
        waiter.join(timeout=10)
    assert taken and taken[0] - killed < 2


def test_who_waits_for_a_lock_whose_file_its_holder_removes_holds_the_one_that_others_lock(store: Store) -> None:
    script = (
        "import sys\nfrom pathlib import Path\nfrom humanmm.storage.store.store import Store\n"
        "print('waits', flush=True)\n"
        "with Store(Path(sys.argv[1])).lock('toy', 'key'):\n    print('held', flush=True)\n    sys.stdin.readline()\n"
    )
    command = [sys.executable, "-c", script, str(store.root)]
    with ExitStack() as stack:
        with store.lock("toy", "key"):
            waiter = stack.enter_context(
                subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            )
            stack.callback(waiter.kill)
            assert waiter.stdout is not None and waiter.stdout.readline() == "waits\n"
            time.sleep(0.5)
            (store.root / "locks" / "toy-key").unlink()
        assert waiter.stdout.readline() == "held\n"
        with _fresh(store).try_lock("toy", "key") as held:
            assert not held
        waiter.communicate("\n", timeout=10)
        with _fresh(store).try_lock("toy", "key") as held:
            assert held


def test_no_two_processes_hold_a_lock_whose_file_every_holder_removes(store: Store) -> None:
    script = (
        "import os, sys\nfrom pathlib import Path\nfrom humanmm.storage.store.store import Store\n"
        "store = Store(Path(sys.argv[1]))\n"
        "for _ in range(300):\n"
        "    with store.lock('toy', 'key'):\n"
        "        os.close(os.open(sys.argv[2], os.O_CREAT | os.O_EXCL))\n"
        "        os.unlink(sys.argv[2])\n"
        "        (store.root / 'locks' / 'toy-key').unlink()\n"
    )
    command = [sys.executable, "-c", script, str(store.root), str(store.root / "alone")]
    store.root.mkdir()
    running = [subprocess.Popen(command, stderr=subprocess.PIPE, text=True) for _ in range(3)]
    assert [process.communicate(timeout=60)[1] for process in running] == ["", "", ""]


def test_verify_finds_every_damage_and_deep_also_a_wrong_digest(store: Store) -> None:
    folder = store.root / _put(store).ref.uri
    outputs = {("toy", 1): f"{__name__}:Result"}
    assert [f.problem for f in maintenance.verify(store, outputs={}, deep=False)] == [""]
    of_today = {("toy", 2): "nowhere:Nothing"}
    assert [f.problem for f in maintenance.verify(store, outputs=of_today, deep=True)] == [""], "another schema"
    (folder / "files" / "picture.png").write_bytes(b"pictura")
    assert ["picture.png" in f.problem for f in maintenance.verify(store, outputs=outputs, deep=False)] == [True]
    assert list(maintenance.verify(store, outputs={}, deep=False)) == []


def test_what_cannot_be_read_now_is_reported_and_stays(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    ref = _put(store).ref

    def unreadable(folder: Path) -> None:
        raise OSError(5, "Input/output error")

    with monkeypatch.context() as patched:
        patched.setattr(maintenance, "read_manifest", unreadable)
        (finding,) = maintenance.verify(store, outputs={}, deep=False)
        assert "Input/output error" in finding.problem and not finding.damaged
    assert store.find("toy", ref.key) is not None


def test_what_is_replaced_or_written_while_it_is_verified_is_not_set_aside(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    ref = _put(store).ref
    looks: list[Path] = []
    check = maintenance.check_files

    def torn_at_first(folder: Path, manifest: Manifest) -> None:
        looks.append(folder)
        if len(looks) == 1:
            raise DamageError("COMMIT is missing")
        check(folder, manifest)

    monkeypatch.setattr(maintenance, "check_files", torn_at_first)
    assert [f.problem for f in maintenance.verify(store, outputs={}, deep=False)] == [""]
    assert len(looks) == 2
    looks.clear()
    with Store(store.root).lock("toy", ref.key):
        assert list(maintenance.verify(store, outputs={}, deep=False)) == []
    assert store.find("toy", ref.key) is not None


def test_verify_tells_what_is_damaged_in_a_store_that_it_may_only_read(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    manifest = _put(store)
    _put(store, recipe=OTHER)
    (store.files_of(manifest.ref) / "picture.png").write_bytes(b"pictures")

    def refuse(*given: object) -> None:
        raise StoreError("cannot lock it: permission denied")

    monkeypatch.setattr(store, "try_lock", refuse)
    found = {finding.uri: finding for finding in maintenance.verify(store, outputs={}, deep=False)}
    assert len(found) == 2
    damaged = found.pop(manifest.ref.uri)
    assert "picture.png" in damaged.problem and "it stays where it is: cannot lock it" in damaged.problem
    assert not damaged.damaged and [one.problem for one in found.values()] == [""]


def test_gc_goes_on_where_another_was_killed(store: Store) -> None:
    key = _put(store).recipe.key
    left = store.root / "tmp" / f"{key}-removed" / "files"
    left.mkdir(parents=True)
    items = maintenance.removable(store, unused_days=-1, with_runs=True)
    assert maintenance.remove(store, items) > 0
    assert store.find("toy", key) is None


def test_gc_lists_first_and_removes_only_what_is_unused(store: Store) -> None:
    kept, old = _put(store), _put(store, recipe=OTHER)
    marker = store.root / old.ref.uri / "COMMIT"
    os.utime(marker, (0, 0))
    items = maintenance.removable(store, unused_days=30)
    assert [item.entry.key for item in items] == [old.ref.key]
    assert maintenance.remove(store, items) > 0
    assert _fresh(store).find("toy", kept.ref.key) is not None
    assert _fresh(store).find("toy", old.ref.key) is None
    assert [path.name for path in (store.root / "locks").iterdir()] == [f"toy-{kept.ref.key}"]


def test_gc_leaves_an_artifact_that_is_being_written(store: Store) -> None:
    old = _put(store)
    os.utime(store.root / old.ref.uri / "COMMIT", (0, 0))
    items = maintenance.removable(store, unused_days=30)
    with store.lock("toy", old.ref.key):
        assert maintenance.remove(_fresh(store), items) == 0


def test_gc_leaves_what_was_used_or_removed_since_it_was_listed(store: Store) -> None:
    used, gone = _put(store), _put(store, recipe=OTHER)
    for manifest in (used, gone):
        os.utime(store.root / manifest.ref.uri / "COMMIT", (0, 0))
    items = maintenance.removable(store, unused_days=30)
    other = _fresh(store)
    assert other.find("toy", used.ref.key) is not None
    other.drop(next(item.entry for item in items if item.entry.key == gone.ref.key))
    assert maintenance.remove(store, items) == 0
    assert _fresh(store).find("toy", used.ref.key) is not None


def test_a_recipe_tells_what_changed() -> None:
    other = Recipe("toy", 1, {"start": 5}, {"a.b": "2"}, {}, {"python": "3.12"}, {"toy": {"x": 2}}, {"decode": "3"})
    assert other.key != RECIPE.key
    assert other.changes_since(RECIPE) == [
        "code changed: a.b",
        "version changed: python 3.11 → 3.12",
        "setting changed: toy.x 1 → 2",
        "unit changed: start 0 → 5",
        "input changed: decode",
    ]
    assert Recipe.from_json(RECIPE.to_json()) == RECIPE
