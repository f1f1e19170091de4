"""Square pixels: the shape of the stored ones, and the size of the picture in which they are square.

DV, DVD and HDV store 720 or 1440 columns for pictures of other proportions. The sample aspect ratio is the width of a
stored pixel divided by its height (ITU-T H.264, annex E.2.1), of the coded picture, before any rotation. Containers say
it as well; as in FFmpeg's `av_guess_sample_aspect_ratio`, the container has the last word.
"""

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise

WIDEST = 4
"""Pixels more than so many times as wide as high, or as high as wide, are a broken header: H.264's table ends at
160:99, anamorphic lenses double, and what declares 1:1000 shows ordinary pictures."""
NEARLY_SQUARE = Fraction(1, 200)
"""Beyond 1 by less than this is rounding of a writer (1279:1280): what resampling blurs would weigh more than 5 mm in a
metre."""

Aspect = Fraction | None
"""None: nothing is said."""


def shape_of_pixels(declared: Aspect, coded: Sequence[Aspect], size: tuple[int, int]) -> tuple[Fraction, list[str]]:
    """The sample aspect ratio by which pictures are resampled, 1 if they are not; and what is doubtful about it.

    `declared`: by the container, or else by the stream's header; `coded`: by the stream at its pictures, each once, in
    order. `size`: of the stored pictures.
    """
    said = [aspect for aspect in coded if aspect is not None and aspect > 0]
    aspect = declared or (said[0] if said else Fraction(1))
    warnings = []
    if any(not _alike(one, other) for one, other in pairwise(said)):
        warnings.append(
            f"the shape of pixels changes inside the video ({', '.join(map(_colon, said))}): {_colon(aspect)} is used "
            "for all; bodies look too wide or narrow where it is wrong"
        )
    elif said and said[0] != 1 and not _alike(said[0], aspect):  # 1:1 is what encoders write that were told nothing
        width, height = square_size(size, said[0])
        warnings.append(
            f"container and pictures disagree about the shape of pixels ({_colon(aspect)} and {_colon(said[0])}): the "
            "container's is used; if bodies look too wide or narrow, convert the video by "
            f"`ffmpeg -i FILE -vf scale={width}:{height},setsar=1 NEW.mp4`"
        )
    if not Fraction(1, WIDEST) <= aspect <= WIDEST:
        warnings.append(f"pixels of {_colon(aspect)}, as the file says, are no camera's: they are taken as square")
        return Fraction(1), warnings
    return (Fraction(1) if _alike(aspect, Fraction(1)) else aspect), warnings


def square_size(coded: tuple[int, int], aspect: Fraction) -> tuple[int, int]:
    """Width and height in square pixels: nothing is lost, so that one side grows, to an even number."""
    width, height = coded
    if aspect > 1:
        return 2 * round(width * aspect / 2), height
    return (width, 2 * round(height / aspect / 2)) if aspect < 1 else coded


def _alike(one: Fraction, other: Fraction) -> bool:
    return abs(one / other - 1) <= NEARLY_SQUARE


def _colon(aspect: Fraction) -> str:
    return f"{aspect.numerator}:{aspect.denominator}"
