"""Colours become the samples that an independent converter makes of them."""

import av
import numpy as np
import pytest
from av.video.reformatter import Colorspace

from humanmm.models.video.colors import Colors

MATRICES = [(1, Colorspace.ITU709), (2, Colorspace.ITU601), (6, Colorspace.ITU601), (9, Colorspace.BT2020)]


@pytest.mark.parametrize(("matrix", "converter"), MATRICES)
def test_samples_agree_with_ffmpeg(matrix: int, converter: Colorspace) -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (16, 16, 3), np.uint8).repeat(4, 0).repeat(4, 1)
    picture = av.VideoFrame.from_ndarray(rgb, "rgb24").reformat(
        format="yuv444p", dst_colorspace=converter, dst_color_range="MPEG"
    )
    theirs = picture.to_ndarray(format="yuv444p").transpose(1, 2, 0)
    assert np.abs(Colors(matrix=matrix).samples(rgb).astype(int) - theirs).max() <= 2  # its tables round to 8 bits


def test_grays_have_no_colour_in_any_matrix() -> None:
    grays = np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1)
    for matrix in (1, 6, 9):
        samples = Colors(matrix=matrix).samples(grays)
        assert samples[0, 0] == 16
        assert samples[255, 0] == 235
        assert (samples[:, 1:] == 128).all()


@pytest.mark.parametrize("matrix", [1, 6, 9])
def test_the_way_back_gives_the_colours_again(matrix: int) -> None:
    colors = Colors(matrix=matrix)
    rgb = np.random.default_rng(1).integers(0, 256, (50, 3), np.uint8)
    back = np.column_stack([colors.samples(rgb), np.ones(50)]) @ colors.to_rgb().T
    assert np.abs(back - rgb).max() <= 2  # samples are whole numbers
