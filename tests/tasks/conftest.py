"""A small film of two places, which stages that look at pictures are given."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from held_results import identity_of
from places import HEIGHT, WIDTH, marbled

from humanmm.models.records.video import VideoFacts
from humanmm.models.video.colors import BT601
from humanmm.models.video.reading import read_facts
from humanmm.storage.run_folder.picture_files import write_video
from humanmm.storage.store.identity import VideoIdentity


@dataclass(frozen=True)
class Film:
    """A camera that pans by `PAN_PX` a frame at irregular times, and from frame `CUT` on does so in another place."""

    video: VideoIdentity
    facts: VideoFacts
    time_s: np.ndarray
    CUT = 14
    PAN_PX = 3.0
    SIZE = (WIDTH, HEIGHT)


@pytest.fixture(scope="session")
def film(tmp_path_factory: pytest.TempPathFactory) -> Film:
    """26 frames."""
    path = tmp_path_factory.mktemp("pan") / "film.mp4"
    time_s = np.cumsum(np.random.default_rng(0).uniform(0.02, 0.05, 26))
    offsets = Film.PAN_PX * np.arange(26) + 400.0 * (np.arange(26) >= Film.CUT)
    pictures = (
        (float(moment), cv2.cvtColor(marbled(float(offset)), cv2.COLOR_RGB2YUV_I420))
        for moment, offset in zip(time_s, offsets, strict=True)
    )
    write_video(path, pictures, width=WIDTH, height=HEIGHT, fps=30, colors=BT601, quality=14)
    with path.open("rb") as stream:
        return Film(identity_of(path), read_facts(stream), time_s)
