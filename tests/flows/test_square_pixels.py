"""A film whose stored pixels are neither square nor upright is recovered like the same film in square ones."""

import json
import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import zarr
from short_clip import ROOT

from humanmm.models.geometry.alignment import umeyama_alignment
from humanmm.models.video.frames import frames
from humanmm.models.video.reading import read_facts

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


def _write_turned_and_squeezed(source: Path, target: Path) -> None:
    """Lying on its left side, with two lines for three; the container tells both."""
    with source.open("rb") as stream, av.open(str(target), "w") as out:
        facts = read_facts(stream)
        width, height = facts.height, round(facts.width * 2 / 3)
        video = out.add_stream("libx264", rate=Fraction(facts.fps).limit_denominator(1001), options={"crf": "12"})
        video.width, video.height, video.pix_fmt = width, height, "yuv420p"
        video.codec_context.time_base = Fraction(1, 90_000)
        video.codec_context.sample_aspect_ratio = Fraction(2, 3)
        video.set_display_rotation(-90)
        for frame in frames(stream, facts):
            turned = cv2.rotate(frame.image, cv2.ROTATE_90_COUNTERCLOCKWISE)
            stored = cv2.resize(turned, (width, height), interpolation=cv2.INTER_AREA)
            picture = av.VideoFrame.from_ndarray(np.asarray(stored), "rgb24")
            picture.pts, picture.time_base = round(90_000 * frame.time_s), Fraction(1, 90_000)
            out.mux(video.encode(picture))
        out.mux(video.encode(None))


def _joints(run: Path) -> np.ndarray:
    return np.asarray(zarr.open_group(run / "motion.zarr", mode="r")["people/00/joints"], np.float64)


def test_a_squeezed_film_gives_the_motion_of_the_original(recovered_film: Path, tmp_path: Path) -> None:
    _write_turned_and_squeezed(recovered_film / "film.mp4", tmp_path / "squeezed.mp4")
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "HUMANMM_STORE": str(tmp_path / "store")}
    done = subprocess.run(
        [sys.executable, "-m", "humanmm.cli", "recover", "squeezed.mp4", "--out", "run"],
        env=environment, cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    own, original = (json.loads((path / "run/run.json").read_text()) for path in (tmp_path, recovered_film))
    size = original["video"]["width"], original["video"]["height"]
    assert (own["video"]["width"], own["video"]["height"]) == size
    assert (own["video"]["coded_width"], own["video"]["coded_height"]) == (size[1], round(size[0] * 2 / 3))
    assert (own["video"]["sample_aspect_ratio"], own["video"]["rotation_deg"]) == ("2:3", 90)
    assert not any("pixels" in warning for warning in own["warnings"])
    with (tmp_path / "run/view/overlay.mp4").open("rb") as stream:
        overlay = read_facts(stream)
    assert ((overlay.width, overlay.height), overlay.sample_aspect_ratio) == (size, (1, 1))

    found, expected = _joints(tmp_path / "run"), _joints(recovered_film / "run")
    assert found.shape == expected.shape
    moved = umeyama_alignment(found.reshape(-1, 3), expected.reshape(-1, 3), with_scale=False)
    off = np.linalg.norm(moved.apply(found.reshape(-1, 3)) - expected.reshape(-1, 3), axis=1)
    assert off.mean() < 0.03  # measured 0.006, 0.044 at most: a third of the lines is gone
