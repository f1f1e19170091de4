"""Videos so small that a brightness tells which camera one looks through."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from humanmm.models.video.colors import BT601
from humanmm.storage.run_folder.picture_files import write_video

WIDTH, HEIGHT = 64, 48


@pytest.fixture
def film() -> Callable[[Path, int, float, int], None]:
    """Writes a video of so many frames and rate whose luma is a constant."""

    def write(path: Path, num_frames: int, fps: float, luma: int) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        picture = np.full((HEIGHT * 3 // 2, WIDTH), 128, np.uint8)
        picture[:HEIGHT] = luma
        pictures = ((k / fps, picture) for k in range(num_frames))
        write_video(path, pictures, width=WIDTH, height=HEIGHT, fps=fps, colors=BT601)

    return write
