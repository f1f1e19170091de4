"""What is computed again after which change, and what is said about it."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from humanmm.errors import InputError, StageError, StoreError, VideoError
from humanmm.models.records.shots import ShotList
from humanmm.models.records.video import VideoFacts
from humanmm.storage.store import locks
from humanmm.storage.store.bucket import Bucket
from humanmm.storage.store.open import open_store
from humanmm.tasks.units import digest as code_digest
from humanmm.tasks.units.selection import Selection

EVERYTHING = [
    "align", "camera:0", "camera:20", "camera:40", "decode", "deliver", "hmr:0", "hmr:20", "hmr:40", "intrinsics",
    "keyframes", "people:0", "people:20", "points:0", "points:20", "refine", "scenes", "shots",
]  # fmt: skip

slow = pytest.mark.slow
on_each_store = pytest.mark.parametrize("any_toy", ["disk", pytest.param("bucket", marks=slow)], indirect=True)
"""A whole toy on a bucket takes seconds: not each of them is in the quick suite."""


def _reasons(run: Any, stage: str) -> set[str]:
    return {outcome.reason for (name, _), outcome in run.outcomes.items() if name == stage}


@on_each_store
def test_a_cold_store_computes_everything_once_and_a_warm_one_nothing(any_toy: Any) -> None:
    toy = any_toy
    run = toy.run()
    assert toy.executed() == EVERYTHING
    assert _reasons(run, "camera") == {"no artifact yet"}
    run = toy.run()
    assert toy.executed() == []
    assert {outcome.state for outcome in run.outcomes.values()} == {"cached"}


@on_each_store
def test_one_setting_reruns_only_what_depends_on_it_and_says_so(any_toy: Any) -> None:
    toy = any_toy
    toy.run()
    toy.executed()
    run = toy.run(camera={"static": True})
    assert toy.executed() == [
        "align", "camera:0", "camera:20", "camera:40", "deliver", "hmr:0", "hmr:20", "hmr:40", "refine",
    ]  # fmt: skip
    assert _reasons(run, "camera") == {"setting changed: camera.static False → True"}
    assert _reasons(run, "hmr") == {"input changed: camera"}
    toy.run()
    assert toy.executed() == []  # the first results are still there


@on_each_store
def test_an_equal_output_cuts_off_what_comes_after(any_toy: Any) -> None:
    toy = any_toy
    toy.run()
    toy.executed()
    toy.edit("points", "n = end - start", "n = 0 + end - start")
    run = toy.run()
    assert toy.executed() == ["points:0", "points:20"]
    assert _reasons(run, "points") == {"code changed: toyline.points"}
    assert not any(outcome.changed for outcome in run.outcomes.values())


@on_each_store
def test_a_changed_helper_reruns_the_stages_that_import_it(any_toy: Any) -> None:
    toy = any_toy
    toy.run()
    toy.executed()
    toy.edit("science", "return 1.0", "return 2.0")
    run = toy.run()
    assert "people:0" in toy.executed()
    assert _reasons(run, "people") == {"code changed: toyline.science"}


@on_each_store
def test_a_reworded_docstring_or_comment_reruns_nothing(any_toy: Any) -> None:
    toy = any_toy
    toy.run()
    toy.executed()
    toy.edit("science", '"""A number that shows in results."""', '"""Quite another text."""')
    toy.edit("science", "# a comment", "# another comment")
    toy.run()
    assert toy.executed() == []


def test_a_changed_weight_file_reruns_its_stage(toy: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    weights = toy.folder / "weights"
    weights.mkdir()
    (weights / "net.tflite").write_bytes(b"one")
    digest = code_digest.code_digest
    monkeypatch.setattr(
        "humanmm.tasks.units.keys.code_digest", lambda module, parts: digest(module, parts, weights_dir=weights)
    )
    toy.edit("science", "def factor", 'NET = "net.tflite"\n\n\ndef factor')
    toy.run()
    toy.executed()
    (weights / "net.tflite").write_bytes(b"two")
    run = toy.run()
    assert toy.executed() == ["hmr:0", "hmr:20", "hmr:40", "people:0", "people:20"]
    assert _reasons(run, "people") == {"weight file changed: net.tflite"}


def test_where_nobody_is_found_the_oddities_of_the_file_are_reported(toy: Any) -> None:
    toy.edit("shots", 'act("shots", inputs)', 'act("shots", inputs)\n    raise NoUsablePersonError("nobody")')
    toy.edit("shots", "import numpy as np\n", "import numpy as np\n\nfrom humanmm.errors import NoUsablePersonError\n")
    run = toy.run(expect_failure=True)
    assert run.outcomes["shots", 0].reason.endswith("film.mp4: nobody (of the file: a toy)")


CHANGES = {
    "grown": "path.write_bytes(old + b' ')",
    "truncated": "path.write_bytes(old[:5])",
    "replaced": "other.write_bytes(old.replace(b'20', b'30')); other.rename(path)",
    "deleted": "path.unlink()",
    "rewritten behind its old time": "path.write_bytes(old.replace(b'20', b'30')); restore(path)",
    "rewritten and restored": "path.write_bytes(old.replace(b'20', b'30')); path.write_bytes(old); restore(path)",
}
"""Changes of the video `path`, whose bytes are `old`; `restore` gives it its old time."""

CHANGING = """act("decode", inputs)
    import os
    from pathlib import Path
    path = Path(os.environ["TOY_LOG"]).with_name("film.mp4")
    old, other, status = path.read_bytes(), path.with_name("other"), path.stat()
    restore = lambda path: os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
"""


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("when", ["before it is read", "after it is read"])
def test_nothing_is_kept_of_a_video_that_changes_while_it_is_read(toy: Any, change: str, when: str) -> None:
    hook = 'act("decode", inputs)\n' if when == "before it is read" else "    size = inputs"
    changed = f"{CHANGING}    {CHANGES[change]}\n"
    toy.edit("decode", hook, changed if when == "before it is read" else changed.partition("\n")[2] + hook)
    run = toy.open()
    message = "no such video" if change == "deleted" else "film.mp4 changed while it was read"
    with pytest.raises(VideoError, match=message) as raised:
        run.execute(run.unit("decode"))
    assert str(raised.value).count("film.mp4") == 1
    assert run.manifest("decode") is None
    assert not list(toy.store.glob("artifacts/*/*/*")), "no artifact may be made of bytes that its key does not name"


def test_another_cut_leaves_the_other_shots_alone(toy: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    toy.run()
    toy.executed()
    monkeypatch.setenv("TOY_CUTS", "41,50")
    toy.run(selection=Selection(force=True))
    toy.executed()
    monkeypatch.setenv("TOY_CUTS", "41,51")
    toy.run(selection=Selection(only="shots"))
    assert toy.executed() == [
        "align", "camera:41", "camera:51", "deliver", "hmr:41", "hmr:51", "intrinsics", "keyframes", "refine",
        "shots",
    ]  # fmt: skip


def test_a_shot_sees_itself_alone(toy: Any) -> None:
    run = toy.run()
    shots = run.read(run.unit("shots"), ShotList)
    assert [shot.index for shot in shots.shots] == [0, 1, 2]
    unit = run.unit("camera", 2)
    assert unit.shot is not None and (unit.shot.index, unit.shot.scene) == (0, 0)
    assert (unit.shot.start, unit.shot.end, unit.scene) == (40, 60, 1)


def test_the_same_content_at_another_path_is_found(toy: Any) -> None:
    toy.run()
    toy.executed()
    other = toy.folder / "another name.mkv"
    shutil.copy(toy.video, other)
    toy.video = other
    toy.run()
    assert toy.executed() == []


def test_a_moved_store_is_found(toy: Any) -> None:
    toy.run()
    toy.executed()
    shutil.move(toy.store, toy.folder / "moved")
    toy.store = toy.folder / "moved"
    toy.run()
    assert toy.executed() == []


@slow
def test_a_store_copied_to_another_bucket_is_found(toy: Any, bucket: str) -> None:
    run = toy.run_on(open_store(bucket))
    old, new = Bucket(bucket), Bucket(f"{bucket}/moved/elsewhere")
    for found in [found for folder in ("artifacts", "latest") for found in old.list(folder)]:
        new.write(found.name, (old.read(found.name) or (b"",))[0])
    toy.executed()
    again = toy.run_on(open_store(new.url))
    assert toy.executed() == []
    assert again.manifest("deliver").digest == run.manifest("deliver").digest


@pytest.mark.usefixtures("in_zarr")
@pytest.mark.parametrize("harm", ["flip", *(pytest.param(h, marks=slow) for h in ("truncate", "delete", "remove all"))])
def test_a_damaged_artifact_in_a_bucket_is_computed_again_with_the_reason(toy: Any, bucket: str, harm: str) -> None:
    run = toy.run_on(open_store(bucket))
    toy.executed()
    uri, objects = run.manifest("people", 1).ref.uri, Bucket(bucket)
    (victim,) = [found.name for found in objects.list(uri) if found.name.endswith(".tar")]
    content = bytearray((objects.read(victim) or (b"",))[0])
    content[content.index(b"zarr.json") + 1024] ^= 1
    objects.remove([victim, f"{uri}/COMMIT"] if harm == "remove all" else [victim])
    if harm in ("flip", "truncate"):
        objects.write(victim, bytes(content if harm == "flip" else content[: len(content) // 2]))
    shutil.rmtree(open_store(bucket).root)  # another host
    again = toy.run_on(open_store(bucket))
    assert toy.executed() == ["people:20"]
    (reason,) = _reasons(again, "people") - {""}
    assert ("gone from the store" if harm == "remove all" else "damaged artifact: ") in reason


@pytest.mark.usefixtures("in_zarr")
@pytest.mark.parametrize("harm", ["flip", "truncate", "delete", "remove all"])
def test_a_damaged_artifact_is_computed_again_with_the_reason(toy: Any, harm: str) -> None:
    run = toy.run()
    toy.executed()
    folder = toy.store / run.manifest("people", 1).ref.uri
    victim = next(path for path in folder.rglob("c.0*"))
    content = bytearray(victim.read_bytes())
    content[-1] ^= 1
    if harm == "flip":
        victim.write_bytes(bytes(content))
    elif harm == "truncate":
        victim.write_bytes(bytes(content[:5]))
    elif harm == "delete":
        victim.unlink()
    else:
        shutil.rmtree(folder)
    run = toy.run()
    assert toy.executed() == ["people:20"]
    (reason,) = _reasons(run, "people") - {""}
    expected = "gone from the store" if harm == "remove all" else "damaged artifact: arrays.zarr/"
    assert expected in reason


@pytest.mark.parametrize("isolate", [False, True])
def test_what_is_damaged_after_it_was_found_is_computed_again_before_it_is_used(toy: Any, isolate: bool) -> None:
    toy.run()
    toy.executed()
    run = toy.open(align={"method": "eight-point"}, run={"isolate": isolate})
    for stage in run.stages[: [stage.name for stage in run.stages].index("align")]:
        for unit in run.units(stage) or ():
            assert run.execute(unit).state == "cached"
    damaged = toy.store / run.manifest("camera", 1).ref.uri / "result.json"
    text = damaged.read_text()
    assert '"start": 20' in text
    damaged.write_text(text.replace('"start": 20', '"start": 21'))
    if isolate:  # the child finds it before it begins, and its parent knows what it was made of
        with pytest.raises(StoreError, match=r"camera \(shot 1\) cannot be read: result.json has changed"):
            run.execute(run.unit("align"))
    assert run.execute(run.unit("align")).state == "computed"
    run.close()
    assert toy.executed() == ["align", "camera:20"]
    assert damaged.read_text() == text


Alone = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def alone() -> Iterator[Alone]:
    """Starts processes that compute a toy's film, each in a process of its own."""
    with contextlib.ExitStack() as processes:

        def start(toy: Any, *arguments: str, store: Path | None = None, **options: Any) -> subprocess.Popen[str]:
            command = [sys.executable, "-m", "toyline.alone", str(toy.video), str(store or toy.store), *arguments]
            options = {"env": toy.environment(), **options}
            return processes.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True, **options))

        yield start


def test_killed_while_writing_nothing_half_is_seen_and_the_rest_is_reused(
    any_toy: Any, alone: Alone, monkeypatch: pytest.MonkeyPatch
) -> None:
    toy, store = any_toy, open_store(any_toy.store)
    process = alone(toy, "people")
    assert process.stdout is not None
    assert process.stdout.readline() == "writing\n"
    assert list(store.root.glob("tmp/*/manifest.json")), "the artifact was all but finished"
    process.send_signal(signal.SIGKILL)
    process.wait()
    monkeypatch.setattr(locks, "LEASE_S", 2.0)  # in a bucket the lock of a dead process runs out
    assert "people" not in {entry.stage for entry in store.entries()}
    assert toy.executed() == ["decode", "people:0", "scenes"]
    began = time.monotonic()
    toy.run()
    assert time.monotonic() - began < 20, "the lock of a dead process must not be waited for"
    assert toy.executed() == [name for name in EVERYTHING if name not in ("decode", "scenes")]


def test_two_processes_on_a_cold_store_compute_everything_once(
    any_toy: Any, alone: Alone, monkeypatch: pytest.MonkeyPatch
) -> None:
    toy = any_toy
    monkeypatch.setenv("TOY_SLEEP", "decode=1;people=0.3;camera=0.1")
    processes = [alone(toy), alone(toy)]
    assert [process.wait(timeout=100) for process in processes] == [0, 0]
    assert toy.executed() == EVERYTHING


def test_another_checkout_and_another_store_give_the_same_keys_and_content(toy: Any, alone: Alone) -> None:
    there = toy.folder / "elsewhere"
    shutil.copytree(toy.folder / "toyline", there / "toyline")
    path = os.pathsep.join([str(there), toy.environment()["PYTHONPATH"].partition(os.pathsep)[2]])
    other = alone(toy, store=there / "store", env=toy.environment(PYTHONPATH=path), cwd=there)
    processes = [alone(toy), other]
    assert [process.wait(timeout=100) for process in processes] == [0, 0]
    digests = [
        {path.parent.relative_to(root): json.loads(path.read_text())["digest"] for path in root.rglob("manifest.json")}
        for root in (toy.store, there / "store")
    ]
    assert digests[0] == digests[1] and len(digests[0]) == len(EVERYTHING)


@slow
def test_a_store_in_a_bucket_has_the_same_keys_and_content(toy: Any, bucket: str) -> None:
    runs = [toy.run(), toy.run_on(open_store(bucket))]
    here, there = ({at: done.manifest.ref for at, done in run.outcomes.items()} for run in runs)
    assert here == there and len(here) == len(EVERYTHING)


@on_each_store
def test_a_failed_shot_leaves_the_others_and_is_tried_again(any_toy: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    toy = any_toy
    monkeypatch.setenv("TOY_FAIL", "camera:20=stage")
    run = toy.run(expect_failure=True)
    assert run.outcomes["camera", 1].state == "failed"
    assert run.outcomes["hmr", 1].state == "skipped"
    assert run.outcomes["hmr", 2].state == run.outcomes["deliver", 0].state == "computed"
    monkeypatch.delenv("TOY_FAIL")
    toy.executed()
    toy.run()
    assert toy.executed() == ["align", "camera:20", "deliver", "hmr:20", "refine"]


def test_bad_input_ends_the_run_and_a_defect_is_reported_as_one(toy: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TOY_FAIL", "points:0=input")
    run = toy.run(expect_failure=True)
    assert {run.outcomes[stage, 0].state for stage in ("shots", "align", "deliver")} == {"skipped"}
    assert isinstance(run.outcomes["points", 0].error, InputError)
    monkeypatch.setenv("TOY_FAIL", "points:0=bug")
    run = toy.run(expect_failure=True)
    assert isinstance(run.outcomes["points", 0].error, StageError)
    assert "ZeroDivisionError: a defect" in run.outcomes["points", 0].reason


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ('inputs.read("camera", ShotList)', "reads camera without naming it"),
        ('inputs.read("people", ShotList)', "use read_all"),
        ("inputs.config.camera", "uses the settings 'camera' without naming them"),
        ("inputs.open_video()", "without `reads_video`"),
        ("return 3", "must be ShotList, is int"),
    ],
)
def test_a_stage_gets_only_what_its_key_is_made_of(toy: Any, body: str, message: str) -> None:
    toy.edit("shots", 'act("shots", inputs)', body)
    run = toy.run(expect_failure=True)
    assert message in run.outcomes["shots", 0].reason


def test_a_video_that_changes_is_another_video(toy: Any) -> None:
    toy.run()
    toy.executed()
    toy.video.write_text(json.dumps({"num_frames": 61, "cuts": [20, 40]}))
    os.utime(toy.video, ns=(1, 1))
    run = toy.run()
    assert "decode" in toy.executed()
    assert run.read(run.unit("decode"), VideoFacts).num_frames == 61
