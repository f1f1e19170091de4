"""Stage `deliver`, and the run folder that comes of it, on a small made-up video with a variable rate."""

import base64
import dataclasses
import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import av
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from humanmm.config import Config
from humanmm.errors import InputError
from humanmm.models.records.motion import PersonMotion, WorldMotion
from humanmm.models.records.shots import Appearance, Person, Shot, ShotList, Transition
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.colors import BT601
from humanmm.models.video.reading import read_facts
from humanmm.storage.run_folder.motion_zarr import read_motion, write_run_folder
from humanmm.storage.run_folder.picture_files import write_video
from humanmm.storage.run_folder.run_record import read_run_record, write_run_record
from humanmm.tasks import pictures
from humanmm.tasks.deliver import deliver
from humanmm.tasks.pictures import EMBEDDED, draw_again, write_scene, write_timeline

F = 24


def _gray(luma: int) -> np.ndarray:
    """Planes of a uniform 322 × 180 picture."""
    planes = np.full((270, 322), 128, np.uint8)
    planes[:180] = luma
    return planes


@dataclasses.dataclass
class Given:
    """Stage inputs from a dictionary."""

    results: dict[str, Any]
    video: Path
    blob_dir: Path
    config: Config = dataclasses.field(default_factory=Config)
    span: tuple[int, int] = (0, F)
    shot: None = None
    seen: list[tuple[int, int]] = dataclasses.field(default_factory=list)

    def read(self, stage: str, output: type[Any]) -> Any:
        assert isinstance(self.results[stage], output)
        return self.results[stage]

    def read_all(self, stage: str, output: type[Any]) -> Sequence[Any]:
        return self.results[stage]

    def open_video(self) -> BinaryIO:
        return self.video.open("rb")

    def progress(self, done: int, total: int) -> None:
        self.seen.append((done, total))


@pytest.fixture
def given(tmp_path: Path) -> Given:
    """A cut at 8, a dissolve over [14, 18); one person; the second scene of the detector has failed."""
    video = tmp_path / "video.mp4"
    times = np.cumsum(np.random.default_rng(0).uniform(0.02, 0.05, F))
    pictures = ((t, _gray(16 + 7 * i)) for i, t in enumerate(times))
    write_video(video, pictures, width=322, height=180, fps=30, colors=BT601)
    with video.open("rb") as stream:
        facts = read_facts(stream)
    frame = np.arange(F, dtype=np.int32)
    person = PersonMotion(
        person=0, frame=frame, observed=np.ones(F, bool), R_world_root=Rotation.from_rotvec([np.pi / 2, 0, 0])
        .as_matrix()[None].repeat(F, 0), body_pose=np.zeros((F, 23, 3)), betas=np.zeros(10),
        pelvis_world=np.tile([0.0, 0, 0.95], (F, 1)), contacts=np.ones((F, 4), np.float32),
        confidence=np.ones(F, np.float32),
    )  # fmt: skip
    motion = WorldMotion(
        R_world_cam=np.tile([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]], (F, 1, 1)), t_world_cam=np.tile([0.0, -4, 1], (F, 1)),
        K=np.tile([[300.0, 0, 161], [0, 300, 90], [0, 0, 1]], (F, 1, 1)), camera_source=np.zeros(F, np.uint8),
        people=(person,), cuts=(),
    )  # fmt: skip
    one = (Appearance(0, 0, ()),)
    shots = ShotList(
        F,
        (
            Shot(0, 0, 8, 0, None, one),
            Shot(1, 8, 16, 1, Transition("cut", 8, 8, "scene"), one),
            Shot(2, 16, F, 1, Transition("dissolve", 14, 18, "scene"), one),
        ),
        (Person(0, np.zeros(10, np.float32), 1.0),),
    )
    blobs = tmp_path / "blobs"
    blobs.mkdir()
    results = {"decode": facts, "shots": shots, "people": [None, None], "align": motion, "refine": motion}
    return Given(results, video, blobs)


def test_the_overlay_has_the_frames_and_times_of_the_video_and_the_body_on_them(given: Given) -> None:
    delivery = deliver(given)
    with av.open(str(given.blob_dir / "overlay.mp4")) as container:
        frames = list(container.decode(video=0))
    times = given.results["decode"].time_s
    np.testing.assert_allclose([f.time for f in frames], times - times[0], atol=1e-4)
    picture = frames[4].to_ndarray(format="rgb24").astype(int)
    blue = picture[..., 2] - picture[..., 0]
    assert blue[60:100, 150:172].mean() > 60  # the chest, in person 0's colour
    assert delivery.recording.people[0].observed.tolist() == [not 14 <= f < 18 for f in range(F)]
    assert given.seen[-1] == (F, F)


def test_a_smaller_overlay_shows_the_same_scene(given: Given) -> None:
    given.config = Config.model_validate({"deliver": {"overlay_max_side_px": 161}})
    deliver(given)
    with av.open(str(given.blob_dir / "overlay.mp4")) as container:
        frames = list(container.decode(video=0))
    assert (frames[0].width, frames[0].height) == (160, 90)
    picture = frames[4].to_ndarray(format="rgb24").astype(int)
    assert (picture[..., 2] - picture[..., 0])[30:50, 76:85].mean() > 60


@pytest.fixture
def run_dir(given: Given, tmp_path: Path) -> Path:
    """A finished run folder."""
    run_dir = tmp_path / "run"
    delivery = deliver(given)
    write_run_folder(run_dir, delivery, given.blob_dir)
    shots = given.results["shots"].shots
    record = {
        "schema": "humanmm.run/1",
        "video": {"path": str(given.video), "sha256": hashlib.sha256(given.video.read_bytes()).hexdigest()},
        "config": given.config.model_dump(mode="json"),
        "shots": [
            {
                "start": shot.start,
                "end": shot.end,
                "linked": True,
                "failed": False,
                "people": [0],
                "join": None,
                "transition": None if shot.transition is None else dataclasses.asdict(shot.transition),
            }
            for shot in shots
        ],
        "warnings": [],
        "failures": [],
        "stages": [{"stage": "deliver", "unit": "video", "seconds": 1.0, "state": "computed"}],
    }
    write_run_record(run_dir, record)
    write_timeline(run_dir, delivery.recording, record)
    return run_dir


def test_pictures_drawn_again_from_the_run_folder_are_those_of_the_run(run_dir: Path) -> None:
    before = {path.name: path.read_bytes() for path in (run_dir / "view").iterdir()}
    assert set(before) == {"overlay.mp4", "top.png", "timeline.png"}
    for name in before:
        (run_dir / "view" / name).unlink()
    paths = draw_again(run_dir, force=False)
    assert {path.name: path.read_bytes() for path in paths} == before


def test_the_page_is_written_with_a_small_copy_of_the_overlay_unless_the_video_is_too_long(
    run_dir: Path, given: Given
) -> None:
    recording, record = read_motion(run_dir / "motion.zarr"), read_run_record(run_dir)
    embedded = given.blob_dir / EMBEDDED
    with av.open(str(embedded)) as container:
        times = [frame.time for frame in container.decode(video=0)]
    np.testing.assert_allclose(times, recording.time_s - recording.time_s[0], atol=1e-4)
    write_scene(run_dir, recording, record, embedded)
    assert base64.b64encode(embedded.read_bytes()) in (run_dir / "view" / "scene.html").read_bytes()
    embedded.unlink()
    given.config = Config.model_validate({"deliver": {"scene_max_s": 0.5}})
    deliver(given)
    assert not embedded.exists()
    write_scene(run_dir, recording, record, embedded)
    assert not (run_dir / "view" / "scene.html").exists(), "that of an earlier result"


def test_pictures_that_are_there_are_left_alone_unless_forced(run_dir: Path) -> None:
    top = run_dir / "view" / "top.png"
    top.write_bytes(b"mine")
    draw_again(run_dir, force=False)
    assert top.read_bytes() == b"mine"
    draw_again(run_dir, force=True)
    assert top.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(("limit", "value"), [("max_side_px", 64), ("max_memory_mb", 16)])
def test_the_video_is_read_again_within_the_limits_of_the_run(
    run_dir: Path, monkeypatch: pytest.MonkeyPatch, limit: str, value: int
) -> None:
    record = read_run_record(run_dir)
    record["config"]["decode"][limit] = value
    write_run_record(run_dir, record)
    found: dict[str, object] = {}

    def read(stream: BinaryIO, **limits: object) -> VideoFacts:
        found.update(limits)
        return read_facts(stream)

    monkeypatch.setattr(pictures, "read_facts", read)
    draw_again(run_dir, force=True)
    assert found[limit] == value and set(found) == {"max_side_px", "max_memory_mb"}


@pytest.mark.parametrize(
    "change",
    [
        lambda video: video.unlink(),
        lambda video: video.write_bytes(_other_video(video, np.arange(5) / 10)),
        lambda video: video.write_bytes(_other_video(video, _times(video))),
    ],
    ids=["gone", "other times", "other pictures at the same times"],
)
def test_an_overlay_is_not_drawn_on_another_video(
    run_dir: Path, given: Given, change: Callable[[Path], object]
) -> None:
    (run_dir / "view" / "overlay.mp4").unlink()
    change(given.video)
    with pytest.raises(InputError, match="video"):
        draw_again(run_dir, force=False)
    assert not (run_dir / "view" / "overlay.mp4").exists()


def _times(video: Path) -> np.ndarray:
    with video.open("rb") as stream:
        return read_facts(stream).time_s


def _other_video(beside: Path, times: np.ndarray) -> bytes:
    other = beside.with_name("other.mp4")
    write_video(other, ((time, _gray(16)) for time in times), width=322, height=180, fps=30, colors=BT601)
    return other.read_bytes()


def test_the_recording_in_the_run_folder_is_the_delivered_one(run_dir: Path, given: Given) -> None:
    person = read_motion(run_dir / "motion.zarr").people[0]
    np.testing.assert_allclose(person.joints[:, 0], given.results["refine"].people[0].pelvis_world, atol=1e-6)
