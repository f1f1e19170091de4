"""Who was seen in a video in which nobody could be recovered: a picture of the likeliest, which the error names."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.drawing import palette
from humanmm.models.perception.picture import Picture
from humanmm.models.records.tracks import ScenePeople

MOST = 6
"""Candidates in the picture, the likeliest first."""
EMPTY_FRAMES = 3
"""Frames shown if nothing at all was taken for a person."""
HEIGHT_PX = 300


@dataclass(frozen=True, eq=False)
class Candidate:
    """A frame to be shown, and what was taken for a person in it."""

    frame: int
    box: Float[np.ndarray, " 4"] | None = None
    """xyxy, source pixels."""
    probability: float = 0.0


def candidates(scenes: Sequence[ScenePeople | None], num_frames: int) -> list[Candidate]:
    """The clearest moment of each of the likeliest tracks; some frames of the video if there is no track."""
    tracks = [track for scene in scenes if scene is not None for track in scene.tracks]
    tracks.sort(key=lambda track: -track.probability)
    clearest = [(track, int(np.argmax(track.confidence))) for track in tracks[:MOST]]
    if not clearest:
        return [Candidate(int(frame)) for frame in np.linspace(0, num_frames - 1, EMPTY_FRAMES + 2)[1:-1]]
    return [Candidate(int(track.frame[row]), track.bbox[row], track.probability) for track, row in clearest]


def draw_candidate(candidate: Candidate, picture: Picture, width: int) -> UInt8[np.ndarray, "height width 3"]:
    """A frame, RGB, with the candidate marked; `width` is the source's, for the picture may be reduced."""
    scale = HEIGHT_PX / picture.height
    image = np.ascontiguousarray(picture.reduced(min(scale, 1.0)))
    words = f"frame {candidate.frame}: " + ("nobody" if candidate.box is None else f"{candidate.probability:.2f}")
    if candidate.box is not None:
        corners = np.round(candidate.box * image.shape[1] / width).astype(int).tolist()
        cv2.rectangle(image, corners[:2], corners[2:], palette.CUT, 2)
    for color, thickness in ((palette.INK, 3), (palette.WHITE, 1)):
        cv2.putText(image, words, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, color, thickness, cv2.LINE_AA)
    return image


def side_by_side(pictures: Sequence[UInt8[np.ndarray, "height width 3"]]) -> UInt8[np.ndarray, "height width 3"]:
    """Pictures in one row, the lower ones filled up below."""
    height = max(picture.shape[0] for picture in pictures)
    return np.hstack([np.pad(picture, ((0, height - picture.shape[0]), (0, 0), (0, 0))) for picture in pictures])
