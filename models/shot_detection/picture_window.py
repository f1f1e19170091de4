"""A sliding window of small pictures of the video, and what neighbouring frames have to do with each other.

The detectors of cuts, dissolves and fades look at pictures `SIDE_PX` wide through this window; memory does not grow
with the video but for a few numbers a frame.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

import cv2
import numpy as np

from humanmm.models.shot_detection.burned_in import burned_in
from humanmm.models.shot_detection.similarity import (
    WINDOW_PX,
    Motion,
    MotionMeter,
    PlaceFeatures,
    PlaceRecogniser,
    color_histogram,
    mean_shift,
)

SIDE_PX = 192
"""Largest side of the pictures that are looked at."""
THUMB = (32, 18)
"""Width and height of the thumbnails in which blends are looked for."""
_BGR_TO_LUMA = np.array([0.114, 0.587, 0.299], np.float32)
_UNIFORM = 4.0
"""Contrast (grey levels) below which a picture is uniform: a black or white frame after coding."""
_FEATURELESS = 5
"""It has fewer features than this: black frames have none, a street at night of the same contrast 17 to 48."""
_FINE_PX, _COARSE_PX = 1.0, 4.0
"""Standard deviations of the two blurs whose difference is a picture's detail."""
_ALIKE = 0.7
"""Correlation, motion undone, from which two frames show the same things whatever is burned in; neighbours have 0.8."""
_NOISE, _REPLACED = 2, 6
"""Grey levels by which coding alone changes the mean of a window from one frame to the next, and from which something
else is there."""
_FROZEN = 0.3
"""A mean change (of 255) below which a frame repeats the one before it."""


@dataclass
class PictureWindow:
    """Small pictures of frames [first, end) and scalars of all frames so far; index = frame of the video."""

    time_s: np.ndarray
    """(F,) presentation times of the whole video's frames."""
    first: int = 0
    gray: list[np.ndarray] = field(default_factory=list)
    """(h,w) uint8 each, of frames [first, end)."""
    thumbs: list[np.ndarray] = field(default_factory=list)
    """(THUMB_H · THUMB_W · 3,) float32 each, of frames [first, end)."""
    change: list[float] = field(default_factory=list)
    """Mean change of hue, saturation and value against the frame before (PySceneDetect's content value), from 0 on."""
    color_change: list[float] = field(default_factory=list)
    """Fraction of the colour histogram that differs from the frame before, 0..1."""
    contrast: list[float] = field(default_factory=list)
    """Standard deviation of the luma of the thumbnail, grey levels."""
    uniform: list[bool] = field(default_factory=list)
    """Whether there is nothing to be seen: hardly any contrast, and no features (a street at night has some)."""
    _last: tuple[np.ndarray, np.ndarray] | None = None
    _motion: dict[tuple[int, int], Motion] = field(default_factory=dict)
    _filmed: dict[tuple[int, int], np.ndarray] = field(default_factory=dict)
    _place_features: dict[int, PlaceFeatures] = field(default_factory=dict)
    _detail_variance: dict[int, float] = field(default_factory=dict)
    _meter: MotionMeter = field(default_factory=MotionMeter)
    _places: PlaceRecogniser = field(default_factory=PlaceRecogniser)

    @property
    def end(self) -> int:
        return len(self.change)

    def append(self, bgr: np.ndarray) -> None:
        """Add the next frame, (h,w,3) uint8 of SIDE_PX."""
        hsv = cv2.cvtColor(bgr, cv2.COLOR_BGR2HSV)
        histogram = color_histogram(hsv)
        if self._last is None:
            self.change.append(0.0)
            self.color_change.append(0.0)
        else:
            self.change.append(float(np.mean(cv2.mean(cv2.absdiff(hsv, self._last[0]))[:3])))
            self.color_change.append(float(0.5 * np.abs(histogram - self._last[1]).sum()))
        self._last = hsv, histogram
        thumb = cv2.resize(bgr, THUMB, interpolation=cv2.INTER_AREA)
        self.gray.append(cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY))
        self.thumbs.append(thumb.astype(np.float32).ravel())
        self.contrast.append(float(cv2.cvtColor(thumb, cv2.COLOR_BGR2GRAY).std()))
        low = self.contrast[-1] < _UNIFORM
        self.uniform.append(low and len(self._features(self.end - 1).xy) < _FEATURELESS)

    def forget_before(self, frame: int) -> None:
        """Drop the pictures of frames before this one."""
        drop = max(0, min(frame - self.first, len(self.gray)))
        del self.gray[:drop], self.thumbs[:drop]
        self.first += drop
        self._motion = {pair: motion for pair, motion in self._motion.items() if pair[0] >= self.first}
        self._filmed = {pair: part for pair, part in self._filmed.items() if pair[0] >= self.first}
        self._place_features = {t: seen for t, seen in self._place_features.items() if t >= self.first}
        self._detail_variance = {t: detail for t, detail in self._detail_variance.items() if t >= self.first}

    def luma(self, frame: int) -> np.ndarray:
        """(THUMB_H · THUMB_W,) float32 grey levels of a thumbnail."""
        return self.thumbs[frame - self.first].reshape(-1, 3) @ _BGR_TO_LUMA

    def pair(self, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """(h,w) uint8 grey pictures of the frame before one, and of it."""
        return self.gray[frame - 1 - self.first], self.gray[frame - self.first]

    def frozen(self, frame: int) -> bool:
        """Whether a frame repeats the one before it."""
        return self.change[frame] < _FROZEN

    def motion(self, before: int, after: int) -> Motion:
        """Motion from one frame to another, the better of both directions, but for what is burned in; computed once."""
        if (before, after) not in self._motion:
            a, b = self.gray[before - self.first], self.gray[after - self.first]
            filmed, forth = None, self._meter(a, b)
            if forth.match < _ALIKE and not (part := self.filmed(before, after)).all():
                filmed, forth = part, self._meter(a, b, part)
            poor = forth.match < 0.5
            back = self._meter(b, a, filmed) if poor else forth
            self._motion[before, after] = max(forth, back, key=lambda m: m.match)
        return self._motion[before, after]

    def unmatched(self, frame: int, where: np.ndarray) -> float:
        """Fraction 0..1 of the picture whose texture changed, motion undone, and that lies in a part (h,w) of it."""
        return self._meter(*self.pair(frame), where).unmatched

    def moving(self, frames: Iterable[int]) -> np.ndarray:
        """(h,w) bool: where one of these frames differs from the one before it."""
        of_steps = (cv2.absdiff(*self.pair(t)) for t in frames)
        return np.asarray(np.any([cv2.blur(step, (WINDOW_PX, WINDOW_PX)) > _NOISE for step in of_steps], axis=0))

    def replaced(self, frame: int, where: np.ndarray, least_height: float) -> np.ndarray:
        """(h,w) bool: the pieces of a part (h,w) in which a frame differs from the one before it, of those that are at
        least so high (fraction of the picture's height)."""
        step = cv2.absdiff(*self.pair(frame))
        changed = where & (cv2.blur(step, (WINDOW_PX, WINDOW_PX)) > _REPLACED)
        _, pieces, stats, _ = cv2.connectedComponentsWithStats(changed.astype(np.uint8))
        high = stats[:, cv2.CC_STAT_HEIGHT] >= least_height * len(step)
        high[0] = False  # what has not changed
        return np.asarray(high[pieces])

    def displacement(self, before: int, after: int) -> float | None:
        """Mean shift of the picture as a fraction of its width if both frames show one place, else None."""
        left_out = ~self.filmed(before, after)
        similarity = self._places.similarity(self._features(before), self._features(after), left_out)
        return None if similarity is None else mean_shift(similarity, self.gray[0].shape)

    def detail(self, frame: int) -> np.ndarray:
        """(h,w) float32 grey levels: what is finer than `_COARSE_PX` and coarser than coding noise."""
        gray = self.gray[frame - self.first].astype(np.float32)
        return cv2.GaussianBlur(gray, (0, 0), _FINE_PX) - cv2.GaussianBlur(gray, (0, 0), _COARSE_PX)

    def detail_variance(self, frame: int, where: np.ndarray) -> float:
        """Variance of a picture's detail in a part (h,w) of it, grey levels squared; of the whole computed once."""
        if not where.all():
            return float(np.square(self.detail(frame)[where]).mean())
        if frame not in self._detail_variance:
            self._detail_variance[frame] = float(np.square(self.detail(frame)).mean())
        return self._detail_variance[frame]

    def filmed(self, before: int, after: int) -> np.ndarray:
        """(h,w) bool: the part of two frames in which nothing is burned in; computed once."""
        if (before, after) not in self._filmed:
            found = burned_in(self.gray[before - self.first], self.gray[after - self.first])
            self._filmed[before, after] = ~found
        return self._filmed[before, after]

    def _features(self, frame: int) -> PlaceFeatures:
        if frame not in self._place_features:
            self._place_features[frame] = self._places.features(self.gray[frame - self.first])
        return self._place_features[frame]

    def unseen_s(self, frame: int) -> float:
        """Seconds between a frame and the last one before it that showed something new: while a picture is repeated,
        time goes on."""
        last = frame - 1
        while last > self.first and self.frozen(last):
            last -= 1
        return self.elapsed_s(last, frame)

    def elapsed_s(self, before: int, after: int) -> float:
        """Seconds from one frame to another."""
        return float(self.time_s[after] - self.time_s[before])

    def usual_speed(self, frame: int, reach: int) -> float:
        """How fast the picture usually moves within `reach` frames of a frame: upper quartile of the flow, in widths of
        the picture a second.

        Repeated frames and the largest changes of the window (cuts themselves) do not count.
        """
        around = range(max(self.first + 1, frame - reach), min(self.end, frame + reach + 1))
        moving = [t for t in around if t != frame and not self.frozen(t)]
        if not moving:
            return 0.0
        quick = np.quantile([self.change[t] for t in moving], 0.9)
        speeds = [self.motion(t - 1, t).flow / self.elapsed_s(t - 1, t) for t in moving if self.change[t] <= quick]
        return float(np.quantile(speeds, 0.75))
