"""Whether a whole film lies on its side or stands on its head: its file has no mark that says how it was held."""

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from humanmm.models.records.landmarks import HIPS, SHOULDERS, TORSO, VISIBLE

Array = np.ndarray

TURNS = {-90: "transpose=1", 90: "transpose=2", 180: "hflip,vflip"}
"""Where heads point in the picture, degrees clockwise from up → the filter of ffmpeg that puts it right."""
WITHIN_DEG = 45.0
AT_LEAST_S, NEARLY_ALWAYS = 1.0, 0.9
"""So much of the time that people are seen their heads must point there: then it may be the picture and not they."""


def turned_picture(seen: Iterable[tuple[Float[Array, "n 33 3"], Float[Array, " n"]]]) -> tuple[str, ...]:
    """A warning if people lie on one side, or stand on their heads, nearly all the time.

    `seen` holds keypoints (pixels, visibility) with the seconds for which each frame is shown, of everybody who counts.
    """
    angles, seconds = [np.zeros(0)], [np.zeros(0)]
    for keypoints, shown_s in seen:
        visible = (keypoints[:, list(TORSO), 2] >= VISIBLE).all(axis=1)
        xy = keypoints[visible, :, :2].astype(np.float64)
        trunk = xy[:, list(SHOULDERS)].mean(axis=1) - xy[:, list(HIPS)].mean(axis=1)
        angles.append(np.degrees(np.arctan2(trunk[:, 0], -trunk[:, 1])))
        seconds.append(shown_s[visible])
    angle, weight = np.concatenate(angles), np.concatenate(seconds)
    for turn, cure in TURNS.items():
        there = np.abs((angle - turn + 180) % 360 - 180) < WITHIN_DEG
        if weight.sum() >= AT_LEAST_S and weight[there].sum() >= NEARLY_ALWAYS * weight.sum():
            how = "stand on their heads" if turn == 180 else "lie on their sides"
            return (
                f"people {how} in the picture nearly all the time: if it is the picture that is turned, "
                f"`ffmpeg -i IN -vf {cure} OUT` puts it right",
            )
    return ()
