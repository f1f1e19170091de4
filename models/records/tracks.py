"""One person's observations over one scene, frame by frame."""

import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, reduce

import numpy as np

from humanmm.models.records.frame_arrays import FrameArrays
from humanmm.models.records.hands import HandTracks, not_looked
from humanmm.models.records.landmarks import with_sides_swapped
from humanmm.models.records.shots import Appearance, TrackPart, Unfollowed

Intervals = tuple[tuple[int, int], ...]

MASK_SIDE = 128
"""Masks are MASK_SIDE × MASK_SIDE pictures of the person's crop."""


@dataclass(frozen=True)
class Silhouettes:
    """One mask a row, each packed to bits and deflated by itself: some 200 bytes instead of 2 KB of a track that
    every stage reads, and most for its other arrays."""

    data: np.ndarray
    """(B,) uint8, the masks one after the other."""
    end: np.ndarray
    """(N,) int64: where each ends in `data`."""

    @classmethod
    def of(cls, deflated: Iterable[bytes]) -> "Silhouettes":
        """Masks that `deflated_mask` has packed."""
        rows = list(deflated)
        return cls(np.frombuffer(b"".join(rows), np.uint8), np.cumsum([len(row) for row in rows], dtype=np.int64))

    @classmethod
    def pack(cls, masks: np.ndarray) -> "Silhouettes":
        """Masks (N, 128, 128), zero or not."""
        return cls.of(deflated_mask(mask) for mask in masks)

    def chosen(self, rows: np.ndarray) -> "Silhouettes":
        """Those of some rows."""
        start = np.concatenate([[0], self.end[:-1]])
        return Silhouettes.of(self.data[start[row] : self.end[row]].tobytes() for row in rows)

    def then(self, other: "Silhouettes") -> "Silhouettes":
        """These, and others after them."""
        end = np.concatenate([self.end, other.end + len(self.data)])
        return Silhouettes(np.concatenate([self.data, other.data]), end)

    def mask(self, row: int) -> np.ndarray:
        """(128, 128) uint8, 0 or 1."""
        start = self.end[row - 1] if row else 0
        bits = np.frombuffer(zlib.decompress(self.data[start : self.end[row]].tobytes()), np.uint8)
        return np.unpackbits(bits).reshape(MASK_SIDE, MASK_SIDE)


def deflated_mask(mask: np.ndarray) -> bytes:
    """A mask (128, 128), zero or not, as few bytes."""
    return zlib.compress(np.packbits(mask != 0, axis=-1).tobytes(), 1)


@dataclass(frozen=True)
class PoseEstimates(FrameArrays):
    """Joint rotations of one person in N frames, as the lifter estimates them: of a body whose left and right are those
    of the keypoints, or the others where these are held for swapped."""

    vectors: np.ndarray
    """(N,20,3) float32, rotation vectors: the root's in the axes of the viewing ray through the crop's centre, and
    those of `body24.FREE_JOINTS` relative to their parents."""
    sigma: np.ndarray
    """(N,20) float32: expected errors, radians; UNKNOWN_RAD where nothing is known."""
    swap_odds: np.ndarray
    """(N,) float32: log-odds that left and right of the keypoints are swapped."""

    def with_sides_swapped(self, is_swapped: np.ndarray) -> "PoseEstimates":
        """The same estimates beside keypoints of some frames that are named the other way."""
        return replace(self, swap_odds=np.where(is_swapped, -self.swap_odds, self.swap_odds))

    @property
    def sigma_as_named(self) -> np.ndarray:
        """(N,20): expected errors where left and right are held for what the keypoints name, else UNKNOWN_RAD."""
        return np.where(self.swap_odds[:, None] > 0, np.float32(UNKNOWN_RAD), self.sigma)


UNKNOWN_RAD = 10.0


@dataclass(frozen=True)
class PersonTrack:
    """Observations of one person; N frames, strictly increasing, holes allowed (frames where the person is not seen).

    Pixels have their centres at (0.5, 0.5) and belong to the upright source picture.
    """

    frame: np.ndarray
    """(N,) int32, index into the video."""
    keypoints2d: np.ndarray
    """(N,33,3) float32: x, y in source pixels, visibility 0..1; order as in `landmarks.NAMES`."""
    landmarks3d: np.ndarray
    """(N,33,3) float32: metres about the mid-hip, in the axes of the viewing ray through the crop's centre (x right, y
    down, z away): the lifter's, or without one the pose network's, rotated back by the crop's in-plane angle."""
    bbox: np.ndarray
    """(N,4) float32: xyxy, source pixels, of the visible body."""
    confidence: np.ndarray
    """(N,) float32, 0..1: torso and legs seen, limbs on the mask, limbs moving steadily."""
    masks: Silhouettes
    """N silhouettes in the crop."""
    mask_affine: np.ndarray
    """(N,2,3) float32: mask pixel coordinates (centres at .5) to source pixels."""
    color_frame: np.ndarray
    """(S,) int32: frames at which the clothing colours were taken, a few a second."""
    color_histogram: np.ndarray
    """(S,B) float32: clothing colours, upper and lower body; rows sum to about 1."""
    keypoint_sigma: np.ndarray | None = None
    """(N,33) float32: expected errors of the keypoints, each axis, source pixels; None where no network says."""
    color_parts: np.ndarray | None = None
    """(S,9,3) float32: L*a*b* of the parts of the body in these frames (`perception.clothing.PARTS`) and of the ground
    about the feet, NaN where not seen; None where nobody looked."""
    side_odds: np.ndarray | None = None
    """(N,) float32: log-odds that left and right are named rightly, from other looks at the same frame (`perception.
    keypoints.naming.side_odds`); 0 where there was none, None where nobody looked."""
    probability: float = 1.0
    """That this is a person at all, and not a bag, a poster or nothing (`perception.tracking.personhood`)."""
    evidence: tuple[float, ...] = ()
    """What the probability was made of: detector, trust, steadiness, motion, own motion; empty if unknown."""
    lifted: bool = False
    """`landmarks3d` lie where `body.landmarks` has them: they were made from COCO keypoints (then `pose` is None), or
    from a body that another system found."""
    pose: PoseEstimates | None = None
    """Joint rotations, by the lifter or another system; None without either."""
    hands: HandTracks | None = None
    """Both hands; None where nobody asked for them."""
    number: int = -1
    """By which the user's own tracker names this person through the whole video; −1 without one."""

    @property
    def is_in_space(self) -> bool:
        """`landmarks3d` are a lifter's or another system's body's: they lie where `body.landmarks` has them."""
        return self.lifted or self.pose is not None

    def with_sides_swapped(self, intervals: Intervals) -> "PersonTrack":
        """The track with left and right of keypoints and landmarks swapped in the frames of some intervals."""
        is_swapped = np.zeros(len(self.frame), bool)
        for start, end in intervals:
            is_swapped[slice(*np.searchsorted(self.frame, (start, end)))] = True
        return replace(
            self,
            keypoints2d=with_sides_swapped(self.keypoints2d, is_swapped),
            landmarks3d=with_sides_swapped(self.landmarks3d, is_swapped),
            keypoint_sigma=_if_known(self.keypoint_sigma, lambda sigma: with_sides_swapped(sigma, is_swapped)),
            side_odds=_if_known(self.side_odds, lambda odds: np.where(is_swapped, -odds, odds)),
            pose=self.pose.with_sides_swapped(is_swapped) if self.pose is not None else None,
            hands=self.hands.with_sides_swapped(is_swapped) if self.hands is not None else None,
        )

    def within(self, start: int, end: int) -> "PersonTrack":
        """The track in frames [start, end)."""
        rows = slice(*np.searchsorted(self.frame, (start, end)).tolist())
        colours = slice(*np.searchsorted(self.color_frame, (start, end)).tolist())
        return replace(
            self,
            frame=self.frame[rows],
            keypoints2d=self.keypoints2d[rows],
            landmarks3d=self.landmarks3d[rows],
            keypoint_sigma=_if_known(self.keypoint_sigma, lambda sigma: sigma[rows]),
            side_odds=_if_known(self.side_odds, lambda odds: odds[rows]),
            pose=self.pose.chosen(rows) if self.pose is not None else None,
            hands=self.hands.chosen(rows) if self.hands is not None else None,
            bbox=self.bbox[rows],
            confidence=self.confidence[rows],
            masks=self.masks.chosen(np.arange(rows.start, rows.stop)),
            mask_affine=self.mask_affine[rows],
            color_frame=self.color_frame[colours],
            color_histogram=self.color_histogram[colours],
            color_parts=_if_known(self.color_parts, lambda parts: parts[colours]),
        )

    def then(self, later: "PersonTrack") -> "PersonTrack":
        """This track, and after it another one of the same person; each counts by its frames for whether he is one."""
        counts = (len(self.frame), len(later.frame))
        total = self.probability * counts[0] + later.probability * counts[1]
        return replace(
            self,
            frame=np.concatenate([self.frame, later.frame]),
            keypoints2d=np.concatenate([self.keypoints2d, later.keypoints2d]),
            landmarks3d=np.concatenate([self.landmarks3d, later.landmarks3d]),
            bbox=np.concatenate([self.bbox, later.bbox]),
            confidence=np.concatenate([self.confidence, later.confidence]),
            masks=self.masks.then(later.masks),
            mask_affine=np.concatenate([self.mask_affine, later.mask_affine]),
            color_frame=np.concatenate([self.color_frame, later.color_frame]),
            color_histogram=np.concatenate([self.color_histogram, later.color_histogram]),
            keypoint_sigma=_both(self.keypoint_sigma, later.keypoint_sigma),
            color_parts=_both(self.color_parts, later.color_parts),
            probability=total / sum(counts) if sum(counts) else self.probability,
            side_odds=_both(self.side_odds, later.side_odds),
            lifted=self.lifted or later.lifted,
            pose=self.pose.then(later.pose) if self.pose is not None and later.pose is not None else None,
            hands=self._hands_then(later),
        )

    def _hands_then(self, later: "PersonTrack") -> HandTracks | None:
        if self.hands is None and later.hands is None:
            return None
        return (self.hands or not_looked(len(self.frame))).then(later.hands or not_looked(len(later.frame)))


def _if_known(values: np.ndarray | None, change: Callable[[np.ndarray], np.ndarray]) -> np.ndarray | None:
    return None if values is None else change(values)


def _both(first: np.ndarray | None, second: np.ndarray | None) -> np.ndarray | None:
    """One after the other; None if either is not known."""
    return None if first is None or second is None else np.concatenate([first, second])


@dataclass(frozen=True)
class ScenePeople:
    """All person tracks of one scene [start, end)."""

    start: int
    end: int
    tracks: tuple[PersonTrack, ...]
    warnings: tuple[str, ...] = ()
    unfollowed: tuple[Unfollowed, ...] = ()
    looks: np.ndarray | None = None
    """(L,) int32: the frames that were looked at, in order; None where all were. What tracks have in others is
    interpolated."""

    def track_of(self, appearance: Appearance) -> PersonTrack:
        """The track of a person in a shot, with left and right as they are, not as the detector swapped them.

        All later stages take keypoints and landmarks from here; nobody else puts sides right or parts together.
        """
        if not appearance.left_right_swapped and not appearance.parts:
            return self.tracks[appearance.track]
        key = appearance.track, appearance.parts, appearance.left_right_swapped
        if key not in self._put_right:
            self._put_right[key] = self._whole(appearance).with_sides_swapped(appearance.left_right_swapped)
        return self._put_right[key]

    def _whole(self, appearance: Appearance) -> PersonTrack:
        """The track as the detector saw it, put together from its parts."""
        parts = sorted(appearance.parts, key=lambda part: part.start)
        pieces = [self.tracks[part.track].within(part.start, part.end) for part in parts]
        return reduce(PersonTrack.then, pieces) if pieces else self.tracks[appearance.track]

    @cached_property
    def _put_right(self) -> dict[tuple[int, tuple[TrackPart, ...], Intervals], PersonTrack]:
        """Tracks that were put right, so that a long one is copied once."""
        return {}
