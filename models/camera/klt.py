"""Long point tracks: pyramidal Lucas-Kanade forward and backward, re-seeded on a grid so that the picture stays
covered.

Where LEAP-VO (the paper's section 3.2) uses a learned tracker, this is the classical one: it needs no weights and
costs a few milliseconds a frame. It knows nothing of people; `masking` removes what lies on them.
"""

from collections.abc import Iterable
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from humanmm.models.records.camera import PointTracks

WINDOW = 15
"""Side of the window that is matched, pixels."""
FORWARD_LEVELS, BACKWARD_LEVELS = 3, 2
"""Pyramid levels of the two searches; the way back starts where the way there ended."""
STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 0.03)
"""A point is found when a step moves it by less than 0.03 pixels; its place is about ten times more exact by then."""
MAX_BACKWARD_ERROR_PX = 1.0
"""Forward-backward error, in pixels of the tracking picture, beyond which a point is lost."""
CONFIDENCE_SCALE_PX = 0.5
CONTRAST = 40.0
"""Standard deviation, in grey levels, that every picture is brought to, so that exposure changes and flicker do not
move points."""
MAX_GAIN = 4.0
MIN_CORNER_STRENGTH = 2e-4
"""Smaller eigenvalue of the structure tensor (OpenCV's scale, grey levels / 255 squared) below which a place has no
corner."""
SUDDEN_LOSS, MAX_PASSED = 0.25, 2
"""If fewer than this fraction of the points survive a frame it is passed over: a flash or a damaged frame would
otherwise end every track. If the next ones are no better, so many at most, it was a change that stays (a cut that
colours do not show, a quick turn): every track ends, because what survives are mostly chance matches, and tracking
begins anew with the first of them."""
NO_SHIFT = np.zeros(2, np.float32)
MAX_POINTS_PER_CELL = 2
BORDER_PX = 4.0


NUM_POINTS = 200
"""Cells of the grid over the picture that are each kept supplied with a point by default."""
STILL_PX = 0.25
"""A frame whose points moved less than this since the last recorded frame is not recorded; pixels of the tracking
picture."""
MAX_UNRECORDED = 12
"""Longest run of frames that are not recorded."""
RESEED_INTERVAL = 5
"""Frames between two searches for new corners while enough points live."""


def klt_tracks(
    pictures: Iterable[UInt8[np.ndarray, "h w"]],
    *,
    start: int,
    source_size: tuple[int, int],
    num_points: int = NUM_POINTS,
) -> PointTracks:
    """Points tracked through the grey pictures of one scene, in source pixels with centres at .5 (a `PointTracker`).

    `pictures` may be smaller than the source (width, height); they are consumed one by one. The first and the last
    usable frame are always recorded; a frame in between is left out while the picture stands still (STILL_PX),
    which is what makes long static shots cheap to keep.
    """
    tracker: _Tracker | None = None
    num_frames = 0
    for picture in pictures:
        tracker = tracker or _Tracker(picture.shape[1], picture.shape[0], num_points)
        tracker.advance(picture, start + num_frames)
        num_frames += 1
    end = start + num_frames
    if tracker is None:
        return PointTracks(start, end, *_empty_columns(), window_px=float(WINDOW))
    tracker.record(always=True)
    return tracker.result(start, end, source_size)


def _empty_columns() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    return np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros((0, 2), np.float32), np.zeros(0, np.float32)


class _Evened(NamedTuple):
    """A picture without its slow brightness changes and with a fixed contrast."""

    picture: UInt8[np.ndarray, "h w"]
    frame: int
    faint: bool
    """It has less contrast still, as in the dark part of a fade."""

    @classmethod
    def of(cls, picture: UInt8[np.ndarray, "h w"], frame: int) -> "_Evened":
        brightness = cv2.blur(picture, (31, 31))
        deviation = cv2.norm(picture, brightness, cv2.NORM_L2) / picture.size**0.5
        gain = min(CONTRAST / max(deviation, 1e-6), MAX_GAIN)
        even = np.asarray(cv2.addWeighted(picture, gain, brightness, -gain, 128.0), np.uint8)
        return cls(even, frame, gain == MAX_GAIN)


class _Tracker:
    """The living points of one scene."""

    def __init__(self, width: int, height: int, num_points: int) -> None:
        self.width, self.height = width, height
        self.cell_px = max(8, round((width * height / num_points) ** 0.5))
        self.columns, self.rows = -(-width // self.cell_px), -(-height // self.cell_px)
        self.picture = np.zeros((height, width), np.uint8)
        self.xy = np.zeros((0, 2), np.float32)
        self.track = np.zeros(0, np.int32)
        self.confidence = np.zeros(0, np.float32)
        self.recorded_xy = np.zeros((0, 2), np.float32)
        self.next_track = 0
        self.frame = self.recorded_frame = self.seeded_frame = -1
        self.seeded_count, self.seeded_faint = 0, False
        self.passed: list[_Evened] = []
        self.kept: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []

    def advance(self, picture: np.ndarray, frame: int) -> None:
        """Carry the points on to the next frame, look for new ones where they are missing, record if anything moved."""
        self._advance(_Evened.of(picture, frame))

    def _advance(self, new: _Evened) -> None:
        if self._follow(new.picture):
            self.passed = []
            self._arrive(new)
            return
        self.passed.append(new)
        if len(self.passed) > MAX_PASSED:
            self.record(always=True)
            first, *rest = self.passed
            self.passed = []
            self._select(np.zeros(0, int))
            self._arrive(first, always=True)
            for later in rest:
                self._advance(later)

    def _arrive(self, new: _Evened, *, always: bool = False) -> None:
        self.picture, self.frame = new.picture, new.frame
        since = new.frame - self.seeded_frame
        due = since >= RESEED_INTERVAL and len(self.xy) < 0.9 * self.seeded_count
        first_to_show = self.seeded_faint and not new.faint
        if self.seeded_frame < 0 or first_to_show or due or len(self.xy) < 0.7 * self.seeded_count or since >= 60:
            self._seed()
            self.seeded_faint = new.faint
        self.record(always=always)

    def _follow(self, picture: np.ndarray) -> bool:
        """Move the points on; False if nearly all are lost at once and the next frame may bring them back (a flash).

        Where they are lost they may have moved farther than they are looked for (a quick turn): they are looked for
        again from where the whole picture went.
        """
        if not len(self.xy):
            return True
        there, error, alive = self._found(picture)
        if alive.sum() < SUDDEN_LOSS * len(alive):
            there, error, alive = self._found(picture, _picture_shift(self.picture, picture))
        if alive.sum() < SUDDEN_LOSS * len(alive):
            return False
        self.xy = there[alive]
        self.confidence = np.exp(-np.square(error[alive] / CONFIDENCE_SCALE_PX)).astype(np.float32)
        self.track, self.recorded_xy = self.track[alive], self.recorded_xy[alive]
        return True

    def _found(
        self, picture: np.ndarray, shift: np.ndarray = NO_SHIFT
    ) -> tuple[np.ndarray, np.ndarray, Bool[np.ndarray, " points"]]:
        """Where the points are now, how far the way back misses them, and which are found; `shift`: the motion from
        which they are looked for."""
        there, found = _flow(self.picture, picture, self.xy, FORWARD_LEVELS, shift)
        back, found_back = _flow(picture, self.picture, there, BACKWARD_LEVELS, -shift)
        error = np.linalg.norm(back - self.xy, axis=1)
        inside = (there > BORDER_PX).all(1) & (there < (self.width - 1 - BORDER_PX, self.height - 1 - BORDER_PX)).all(1)
        return there, error, found & found_back & (error < MAX_BACKWARD_ERROR_PX) & inside

    def _cell(self, xy: np.ndarray) -> np.ndarray:
        column_row = (xy / self.cell_px).astype(int)
        return np.asarray(column_row[:, 1] * self.columns + column_row[:, 0])

    def _seed(self) -> None:
        """Drop crowded points (the younger ones), then put the strongest corner into every empty cell."""
        if len(self.xy):
            keep = _oldest_per_cell(self._cell(self.xy), MAX_POINTS_PER_CELL)
            self._select(keep)
        strength = cv2.cornerMinEigenVal(self.picture, 5)
        margin = int(BORDER_PX) + 4
        strength[:margin], strength[-margin:], strength[:, :margin], strength[:, -margin:] = 0, 0, 0, 0
        for x, y in self.xy.astype(int):  # no second corner beside a living point
            strength[max(y - 6, 0) : y + 7, max(x - 6, 0) : x + 7] = 0
        padded = np.zeros((self.rows * self.cell_px, self.columns * self.cell_px), np.float32)
        padded[: self.height, : self.width] = strength
        cells = padded.reshape(self.rows, self.cell_px, self.columns, self.cell_px).transpose(0, 2, 1, 3)
        flat = cells.reshape(self.rows * self.columns, -1)
        best = flat.argmax(1)
        free = np.bincount(self._cell(self.xy), minlength=len(flat)) == 0
        chosen = np.flatnonzero(free & (flat.max(1) > MIN_CORNER_STRENGTH))
        x = (chosen % self.columns) * self.cell_px + best[chosen] % self.cell_px
        y = (chosen // self.columns) * self.cell_px + best[chosen] // self.cell_px
        new = np.stack([x, y], 1).astype(np.float32)
        self.xy = np.concatenate([self.xy, new])
        numbers = np.arange(self.next_track, self.next_track + len(new), dtype=np.int32)
        self.track = np.concatenate([self.track, numbers])
        self.confidence = np.concatenate([self.confidence, np.ones(len(new), np.float32)])
        self.recorded_xy = np.concatenate([self.recorded_xy, np.full_like(new, np.nan)])
        self.next_track += len(new)
        self.seeded_frame, self.seeded_count = self.frame, len(self.xy)

    def _select(self, keep: np.ndarray) -> None:
        self.xy, self.track = self.xy[keep], self.track[keep]
        self.confidence, self.recorded_xy = self.confidence[keep], self.recorded_xy[keep]

    def record(self, *, always: bool = False) -> None:
        """Keep this frame's points, unless the picture stood still since the last kept frame."""
        if self.recorded_frame == self.frame:
            return
        moved = np.linalg.norm(self.xy - self.recorded_xy, axis=1)
        moved = moved[np.isfinite(moved)]
        waiting = self.frame - self.recorded_frame if self.recorded_frame >= 0 else MAX_UNRECORDED
        middle = int(0.6 * len(moved))
        still = len(moved) > 0 and np.partition(moved, middle)[middle] < STILL_PX
        if still and waiting < MAX_UNRECORDED and not always:
            return
        frame = np.full(len(self.xy), self.frame, np.int32)
        self.kept.append((self.track, frame, self.xy, self.confidence))
        self.recorded_frame, self.recorded_xy = self.frame, self.xy

    def result(self, start: int, end: int, source_size: tuple[int, int]) -> PointTracks:
        track, frame, xy, confidence = (np.concatenate(column) for column in zip(*self.kept, strict=True))
        scale = np.array([source_size[0] / self.width, source_size[1] / self.height], np.float32)
        window_px = float(WINDOW * scale.max())
        return PointTracks(start, end, track, frame, (xy + 0.5) * scale, confidence, window_px)


def _flow(
    before: np.ndarray, after: np.ndarray, xy: np.ndarray, levels: int, shift: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where the points of one picture are in the other, looked for from `shift` off, and whether they were found."""
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        before, after, xy[:, None], (xy + shift).reshape(-1, 1, 2), winSize=(WINDOW, WINDOW), maxLevel=levels,
        criteria=STOP, flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )  # fmt: skip
    return np.asarray(there)[:, 0], np.asarray(found)[:, 0] > 0


def _picture_shift(before: np.ndarray, after: np.ndarray) -> Float[np.ndarray, "2"]:
    """By how many pixels one picture as a whole lies beside the other, by phase correlation (Kuglin and Hines, "The
    phase correlation image alignment method", 1975); float32."""
    height, width = before.shape
    a, b = (picture.astype(np.float32) for picture in (before, after))
    shift, _ = cv2.phaseCorrelate(a, b, cv2.createHanningWindow((width, height), cv2.CV_32F))
    return np.array(shift, np.float32)


def _oldest_per_cell(cell: np.ndarray, most: int) -> Bool[np.ndarray, "points"]:
    """True for the first `most` points of each cell; points come oldest first."""
    order = np.argsort(cell, kind="stable")
    ordered = cell[order]
    first = np.searchsorted(ordered, ordered, side="left")
    keep = np.zeros(len(cell), bool)
    keep[order] = np.arange(len(cell)) - first < most
    return keep
