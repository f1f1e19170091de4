"""A track while it grows, and what is made of it at the end of the scene."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from humanmm.models.perception.clothing import mean_colours
from humanmm.models.perception.observation import Observation
from humanmm.models.perception.regions import Region
from humanmm.models.perception.sides import exchanged_sides
from humanmm.models.records import landmarks
from humanmm.models.records.tracks import PersonTrack, Silhouettes, deflated_mask

MAX_STEP_SHARE = 0.1
"""Largest motion of the region that is carried on to the next frame, as a share of its side."""
UNSTEADY_SHARE = 0.07
"""Second difference of the limbs, as a share of the region's side at 30 fps, at which a track is hardly a person's:
people measured 0.005 to 0.035, bodies seen in furniture, pictures and hands 0.03 to 0.11."""
_STEADY_FRAMES = 7
STEADINESS_UNKNOWN = 0.8
"""Of a track without three frames in a row."""


@dataclass(frozen=True, eq=False, slots=True)
class Row:
    """One packed observation, less than 2 KB."""

    numbers: Float[np.ndarray, " 208"]
    """Single precision: keypoints, 3D landmarks, box and the mask's affine map one after the other (an array of its own
    for each would take half as much again)."""
    confidence: float
    mask: bytes
    """Deflated."""
    side: float
    vote: float
    """Log-odds for left and right as named, from a second look; 0 without one."""

    @classmethod
    def of(cls, seen: Observation, vote: float) -> "Row":
        """An observation, packed."""
        parts = (seen.keypoints, seen.landmarks3d, seen.bbox, seen.mask_to_source)
        numbers = np.concatenate([np.ravel(part) for part in parts]).astype(np.float32)
        return cls(numbers, seen.confidence, deflated_mask(seen.mask), seen.region.side, vote)

    @property
    def keypoints(self) -> Float[np.ndarray, "33 3"]:
        """x, y and visibility."""
        return self.numbers[:99].reshape(33, 3)

    @property
    def landmarks3d(self) -> Float[np.ndarray, "33 3"]:
        """Metres about the mid-hip."""
        return self.numbers[99:198].reshape(33, 3)

    @property
    def bbox(self) -> Float[np.ndarray, " 4"]:
        """xyxy."""
        return self.numbers[198:202]

    @property
    def mask_affine(self) -> Float[np.ndarray, "2 3"]:
        """From pixels of the mask to the picture's."""
        return self.numbers[202:].reshape(2, 3)


@dataclass(eq=False)
class Trail:
    """Observations of one person so far."""

    last: Observation
    last_frame: int
    velocity: tuple[float, float] = (0.0, 0.0)
    """Of the region, pixels a frame, in the direction in which frames are taken."""
    rows: dict[int, Row] = field(default_factory=dict)
    colours: dict[int, np.ndarray] = field(default_factory=dict)
    missing: int = 0
    """Frames since the person was last seen."""
    active: bool = True

    def predicted(self) -> Region:
        """Where to look in the next frame."""
        steps = 1 - 0.8 ** (self.missing + 1)  # the motion fades while the person is not seen: Σ 0.8^k · 0.2 · 5
        return self.last.next_region.moved(self.velocity[0] * steps * 5, self.velocity[1] * steps * 5)

    def predicted_keypoints(self) -> Float[np.ndarray, "33 3"]:
        """The last pose moved to where the next is expected."""
        there, here = self.predicted(), self.last.next_region
        shift = np.array([there.x - here.x, there.y - here.y, 0.0])
        return np.asarray(self.last.keypoints + shift)

    def mean_colours(self) -> Float[np.ndarray, " bins"] | None:
        """Clothing so far; None before anything is known."""
        return mean_colours(np.stack(list(self.colours.values()))) if self.colours else None

    def add(self, frame: int, seen: Observation, vote: float = 0.0) -> None:
        """Take an observation in; frames may come in either direction."""
        steps = abs(frame - self.last_frame)
        if steps:
            before, now = self.last.next_region, seen.next_region
            limit = MAX_STEP_SHARE * now.side
            step = np.clip(np.array([now.x - before.x, now.y - before.y]) / steps, -limit, limit)
            self.velocity = (float(step[0]), float(step[1]))
        self.last, self.last_frame, self.missing, self.active = seen, frame, 0, True
        self.rows[frame] = Row.of(seen, vote)

    def split(self, frame: int) -> tuple["Trail", "Trail"]:
        """The trail before and from a frame on."""
        halves = (Trail(self.last, self.last_frame), Trail(self.last, self.last_frame))
        for f, row in self.rows.items():
            halves[f >= frame].rows[f] = row
        for f, colours in self.colours.items():
            halves[f >= frame].colours[f] = colours
        return halves

    def finished(self, fps: float) -> PersonTrack:
        """The track, with left and right named alike in all frames and confidence lowered where it is unsteady.

        The rows are gone then: a long track is not kept twice.
        """
        frames = np.array(sorted(self.rows), np.int32)
        count, masks = len(frames), []
        keypoints, poses = np.empty((count, 33, 3), np.float32), np.empty((count, 33, 3), np.float32)
        bbox, mask_affine = np.empty((count, 4), np.float32), np.empty((count, 2, 3), np.float32)
        votes, side, seen_confidence = np.empty(count), np.empty(count), np.empty(count)
        for k, frame in enumerate(frames.tolist()):
            row = self.rows.pop(frame)
            keypoints[k], poses[k], bbox[k], mask_affine[k] = row.keypoints, row.landmarks3d, row.bbox, row.mask_affine
            votes[k], side[k], seen_confidence[k] = row.vote, row.side, row.confidence
            masks.append(row.mask)
        exchanged = exchanged_sides(keypoints, poses, votes, frames / fps, side)
        keypoints[exchanged], poses[exchanged] = (
            keypoints[exchanged][:, landmarks.SWAP],
            poses[exchanged][:, landmarks.SWAP],
        )
        confidence = seen_confidence * steadiness(keypoints, frames, side, fps)
        sampled = sorted(self.colours)
        return PersonTrack(
            frame=frames,
            keypoints2d=keypoints,
            landmarks3d=poses,
            bbox=bbox,
            confidence=confidence.astype(np.float32),
            side_votes=np.where(exchanged, -votes, votes).astype(np.float32),
            masks=Silhouettes.of(masks),
            mask_affine=mask_affine,
            color_frame=np.array(sampled, np.int32),
            color_histogram=np.stack([self.colours[f] for f in sampled]).astype(np.float32),
        )


def steadiness(
    keypoints: Float[np.ndarray, "frames 33 3"],
    frames: np.ndarray,
    side: Float[np.ndarray, " frames"],
    fps: float,
) -> Float[np.ndarray, " frames"]:
    """1 where the limbs move smoothly about a frame, towards 0 where they jump: a body that is not there jumps."""
    count = len(frames)
    if count < 3:
        return np.full(count, STEADINESS_UNKNOWN)
    limbs = keypoints[:, list(landmarks.LIMBS), :2]
    bend = np.linalg.norm(limbs[2:] - 2 * limbs[1:-1] + limbs[:-2], axis=-1) / side[1:-1, None]
    consecutive = frames[2:] - frames[:-2] == 2
    if not consecutive.any():
        return np.full(count, STEADINESS_UNKNOWN)
    everywhere = np.interp(frames, frames[1:-1][consecutive], np.median(bend, axis=1)[consecutive])
    padded = np.pad(everywhere, _STEADY_FRAMES // 2, mode="edge")
    local = np.median(np.lib.stride_tricks.sliding_window_view(padded, _STEADY_FRAMES), axis=1)
    scale = UNSTEADY_SHARE * max(1.0, 30 / fps)
    return np.asarray(np.exp(-((local / scale) ** 2)))
