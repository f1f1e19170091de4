"""Hard cuts from colour (paper section 3.1, part 1): proposed by PySceneDetect's rules, verified by what moves.

A proposal is a frame whose colours differ enough from the frame before. It is a cut when the change is neither motion
(shake, whip pan, somebody passing the lens), nor light (flash, exposure), nor damage:

1. *New place*: the pictures do not match once their motion is undone, and the change stands out from those around it in
   its size or in its colours. Under a violently moving camera that is not enough while the colours stay alike: then no
   frame shortly before may show the place of one shortly after, as near to it as the camera could have come meanwhile.
2. *Jump*: it is the same place, or motion does explain it, but so far in one frame as the camera never moves otherwise.

A flash only adds light, and the view behind it is the view before it.
"""

from collections.abc import Iterator

import numpy as np

from humanmm.models.shot_detection.picture_window import PictureWindow

MATCHED = 0.35
"""Pictures that correlate better than this once motion is undone show the same things; across cuts < 0.2 (measured)."""
_STANDS_OUT = 2.0
"""A change so many times larger than the quieter of those around it stands out; those of a whip pan vary by 1.5."""
_SAME_VIEW = 0.5
"""Pictures some frames apart without features in common show the same view from this correlation on. Of pairs eight
frames apart in one shot nine in ten have 0.45 or more, of those across cuts one in ten 0.32 or more (development)."""
_NEW_COLORS = 0.35
"""Fraction of the colour histogram that must change at once where the size of the change is no evidence (shaking)."""
_OTHER_COLORS = 0.6
"""Fraction that no movement of the camera inside one place changes from one frame to the next."""
_VIOLENT = 0.005
"""Usual movement a frame, as a fraction of the width, from which on a camera may carry its picture away."""
_JUMP_STANDS_OUT = 3.0
"""A jump inside one place is so many times larger than the changes next to it: PySceneDetect's adaptive threshold;"""
_JUMP = 0.025
"""it moves the picture by at least this fraction of its width,"""
_FARTHEST = 0.3
"""Fraction of its width by which a picture may move in one frame; two views of a room may share a distant wall."""
_JUMP_TIMES = 5.0
"""and this many times farther than the camera usually moves around it in the same time."""
_FLASH_FRAMES = 8
"""Longest flash in frames."""
_LIGHT_STEP = 8.0
"""Grey levels by which a part of the picture must darken to count as darker."""
_AGAINST_LIGHT = 0.05
"""Fraction of the picture that may change against the light."""
_STEPS = (0, 2, 5, 12, 25, 40)
"""Distances in frames from the proposal at which places before and after are compared."""
REACH = 48
"""Frames that are looked at on either side of a proposal."""


def hard_cuts(window: PictureWindow, proposals: list[int], start: int) -> Iterator[int]:
    """Those of the proposed frames that begin a new shot; `start` is the last shot change before them.

    The pictures of REACH frames on both sides must be in the window (as far as the video has them).
    """
    for i, frame in enumerate(proposals):
        following = proposals[i + 1] if i + 1 < len(proposals) else window.end
        if _is_cut(window, frame, max(start, frame - REACH), min(following, frame + REACH, window.end)):
            start = frame
            yield frame


def _is_cut(window: PictureWindow, frame: int, start: int, end: int) -> bool:
    """Whether a new shot begins at `frame`, judged by [start, frame) and [frame, end)."""
    motion = window.motion(frame - 1, frame)
    displacement = window.displacement(frame - 1, frame)
    if motion.match < MATCHED and (displacement is None or displacement > _FARTHEST):
        return _is_new_place(window, frame, start, end)
    jump = motion.flow if displacement is None else displacement
    if jump < _JUMP or _jump_outstanding(window, frame) < _JUMP_STANDS_OUT:
        return False
    speed = window.usual_speed(frame, REACH // 2)
    return jump >= _JUMP_TIMES * speed * window.unseen_s(frame) and not _is_flash(window, frame, speed)


def _is_new_place(window: PictureWindow, frame: int, start: int, end: int) -> bool:
    around = _neighbours(window, frame, 2)
    quiet = sorted(window.change[t] for t in around)[:2]
    stands_out = window.change[frame] >= _STANDS_OUT * max(1.0, sum(quiet) / max(1, len(quiet)))
    usual_colors = min((window.color_change[t] for t in around), default=0.0)
    new_colors = window.color_change[frame] >= max(_NEW_COLORS, _STANDS_OUT * usual_colors)
    if not (stands_out or new_colors):
        return False
    speed = window.usual_speed(frame, REACH // 2)
    if _is_flash(window, frame, speed):
        return False
    if speed * window.elapsed_s(frame - 1, frame) < _VIOLENT or window.color_change[frame] >= _OTHER_COLORS:
        return True
    return not _one_place(window, frame, start, end, speed)


def _one_place(window: PictureWindow, frame: int, start: int, end: int, speed: float) -> bool:
    """Whether some frame before shows the place of some frame after, moved no farther than the camera's usual speed
    (widths a second) takes it in the time between them."""
    for before in (frame - 1 - step for step in _STEPS if frame - 1 - step >= start):
        for after in (frame + step for step in _STEPS if frame + step < end):
            displacement = window.displacement(before, after)
            if displacement is not None and displacement < _farthest(window, before, after, speed):
                return True
    return False


def _is_flash(window: PictureWindow, frame: int, speed: float) -> bool:
    """Whether the change at `frame` is part of a flash: light is added (or taken away), then the view is back."""
    for before in range(frame - 1, max(window.first, frame - 1 - _FLASH_FRAMES) - 1, -1):
        for after in range(max(frame, before + 2), min(window.end, before + 2 + _FLASH_FRAMES)):
            lit = range(before + 1, after)
            if not (_one_sided(window, before, lit, 1) or _one_sided(window, before, lit, -1)):
                break  # a longer stretch holds the same frames
            if _same_view(window, before, after, speed):
                return True
    return False


def _one_sided(window: PictureWindow, before: int, lit: range, sign: int) -> bool:
    """Whether hardly any part of the frames is darker (sign 1) or brighter (-1) than before, and the whole is not."""
    for frame in lit:
        change = sign * (window.luma(frame) - window.luma(before))
        if change.mean() < _LIGHT_STEP / 2 or np.mean(change < -_LIGHT_STEP) > _AGAINST_LIGHT:
            return False
    return True


def _same_view(window: PictureWindow, before: int, after: int, speed: float) -> bool:
    """Whether two frames show the same things, light apart, and moved no farther than the camera's usual speed (widths
    a second) takes it in the time between them."""
    farthest = _farthest(window, before, after, speed)
    motion = window.motion(before, after)
    if motion.match < MATCHED or motion.flow >= farthest:
        return False
    displacement = window.displacement(before, after)
    return motion.match >= _SAME_VIEW if displacement is None else displacement < farthest


def _farthest(window: PictureWindow, before: int, after: int, speed: float) -> float:
    """How far a camera of this usual speed (widths a second) moves its picture between two frames, without a jump."""
    return _JUMP + speed * window.elapsed_s(before, after)


def _neighbours(window: PictureWindow, frame: int, count: int) -> list[int]:
    """The nearest frames on each side, `count` each, that do not repeat their predecessor."""
    before = [t for t in range(frame - 1, max(window.first, frame - REACH), -1) if not window.frozen(t)][:count]
    after = [t for t in range(frame + 1, min(window.end, frame + REACH)) if not window.frozen(t)][:count]
    return before + after


def _jump_outstanding(window: PictureWindow, frame: int) -> float:
    """The change at a frame over the larger of those next to it: a jump is calm on both sides, a whip pan on one."""
    return window.change[frame] / max([1.0, *(window.change[t] for t in _neighbours(window, frame, 1))])
