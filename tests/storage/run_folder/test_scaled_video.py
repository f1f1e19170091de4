"""A longer video of another size, without cuts."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np

from humanmm.storage.run_folder.scaled_video import write_scaled


def test_it_goes_there_and_back_in_another_size_for_as_long_as_requested(tmp_path: Path) -> None:
    source, target = tmp_path / "source.mp4", tmp_path / "target.mkv"
    shades = np.linspace(40, 200, 10)
    with av.open(str(source), "w") as container:
        stream = container.add_stream("libx264", rate=10)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for number, shade in enumerate(shades):
            picture = av.VideoFrame.from_ndarray(np.full((72, 64), shade, np.uint8), format="yuv420p")
            picture.pts, picture.time_base = number, Fraction(1, 10)
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    write_scaled(source, target, height=96, seconds=4.0)
    with av.open(str(target)) as opened:
        pictures = [frame.to_ndarray()[:96] for frame in opened.decode(video=0)]
    assert {picture.shape for picture in pictures} == {(96, 128)}
    found = np.array([picture.mean() for picture in pictures])
    np.testing.assert_allclose(found, np.tile([*shades, *shades[::-1]], 2), atol=5)  # a lossy codec
