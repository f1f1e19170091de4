"""A real phone clip with sound and a real web clip read as their containers promise."""

import os
from pathlib import Path

import pytest

from humanmm.models.video.frames import frames
from humanmm.models.video.reading import read_facts

DATA = os.environ.get("HUMANMM_DATA")
EXAMPLE = Path(__file__).parents[3] / "examples/pose2sim_multishot/pose2sim_A_01-02-01.mp4"


def test_the_shipped_clip_has_a_hundred_upright_frames_at_sixty_hertz() -> None:
    with EXAMPLE.open("rb") as stream:
        facts = read_facts(stream)
        shapes = {f.image.shape for f in frames(stream, facts, 90)}
    assert (facts.num_frames, facts.width, facts.height, facts.warnings) == (100, 720, 1280, ())
    assert facts.fps == pytest.approx(60)
    assert shapes == {(1280, 720, 3)}


@pytest.mark.skipif(DATA is None, reason="HUMANMM_DATA names no folder with the development clips")
@pytest.mark.parametrize(
    ("name", "num_frames", "size", "codec"),
    [
        ("sports2d_demo.mp4", 230, (1768, 994), "vp9"),
        ("intel_asl_walk.mkv", 89, (640, 480), "h264"),
        ("intel_one_by_one_person.mp4", 1394, (768, 432), "h264"),
        ("mmaction2_demo.mp4", 280, (426, 256), "h264"),  # 340 columns are stored; its pixels are 64:51
    ],
)
def test_development_clips_read_as_described(name: str, num_frames: int, size: tuple[int, int], codec: str) -> None:
    with (Path(str(DATA)) / "videos" / name).open("rb") as stream:
        facts = read_facts(stream)
    assert (facts.num_frames, (facts.width, facts.height), facts.codec) == (num_frames, size, codec)
