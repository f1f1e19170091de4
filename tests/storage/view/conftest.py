"""A run of two people with what run.json says of it, and a video whose pictures carry their own number."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import two_people

from humanmm.models.records.recording import Recording
from humanmm.models.video.colors import BT601
from humanmm.storage.run_folder.picture_files import write_video

BITS, CELL_PX = 8, 32
HOSTILE = "</script><script>document.title='stolen'</script><img src=x onerror=alert(1)>&amp;\u2028.mp4"


@pytest.fixture(scope="session")
def recording() -> Recording:
    """40 frames at a variable rate, a cut, two people."""
    return two_people.recording(time_s=3.0 + np.cumsum(np.random.default_rng(0).uniform(0.02, 0.07, 40)))


@pytest.fixture(scope="session")
def record(recording: Recording) -> dict[str, Any]:
    """What the page reads of run.json."""
    cut = recording.cut_frames[0]
    join = {"method": "bundle", "uncertainty_deg": 12.0, "probability": 0.7, "evidence": []}
    return {
        "video": {"path": f"/films/{HOSTILE}", "sha256": "0" * 64},
        "shots": [
            {
                "start": 0, "end": cut, "transition": None, "linked": True, "join": None, "people": [0, 1],
                "failed": False,
            },
            {
                "start": cut, "end": 40, "transition": {"type": "cut", "start": cut, "end": cut}, "linked": True,
                "join": join, "people": [0, 1], "failed": False,
            },
        ],
        "warnings": [f"align: cut at frame {cut}: {HOSTILE}", "people: nobody's feet are seen"],
        "fallbacks": [],
        "failures": [],
    }  # fmt: skip


@pytest.fixture(scope="session")
def numbered_video(recording: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An mp4 at the times of the recording; the upper left corner of each picture is its number in black and white."""
    path = tmp_path_factory.mktemp("video") / "numbered.mp4"

    def picture(number: int) -> np.ndarray:
        planes = np.full((1080, 1280), 128, np.uint8)
        planes[:720] = 110
        for bit in range(BITS):
            planes[:CELL_PX, bit * CELL_PX : (bit + 1) * CELL_PX] = 235 if number >> bit & 1 else 16
        return planes

    pictures = ((float(time), picture(number)) for number, time in enumerate(recording.time_s))
    write_video(path, pictures, width=1280, height=720, fps=recording.fps, colors=BT601)
    return path
