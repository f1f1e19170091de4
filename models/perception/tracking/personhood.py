"""Whether a track shows a person at all: a probability from what the detector, the limbs and their motion say.

Bags, furniture and hands become bodies whose limbs jump and that the detector does not confirm; posters and statues are
confirmed, but never change their pose, and move with their wall alone. The weights are a logistic regression on
labelled tracks (docs/method.md says which).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.records import landmarks

Array = np.ndarray

BIAS = -13.20
WEIGHTS = (5.69, 1.48, 10.27, 3.36, 2.94)
"""Of `Evidence.features`: detector, trust, steadiness, motion, own motion (scripts/fit_person_probability)."""
DETECTOR_UNKNOWN = 0.3
"""Taken for a track so short that the detector never ran on it."""
STILL_S = 10.0
"""After this time without any change of pose somebody counts as a picture as much as he ever will."""
MOTION_UNKNOWN = 0.5
"""Feature of somebody who was still, but was seen for a moment only: people mostly are."""
MOVED = 0.02
"""Change of pose, as a fraction of the body's height, that noise alone hardly makes."""
SITS_STILL_S, STILL_MOST = 2.0, 2.0
"""People may move no more than a picture for so long. What it counts grows with the square of the time (somebody still
for four seconds is not twice as rare as for two), up to STILL_MOST."""


@dataclass(frozen=True)
class Evidence:
    """What is known of one track."""

    detector: float
    """Mean score that the detector gave in the frames in which it looked, 0 where it did not see the person."""
    trust: float
    """Mean over frames of how far the pose can be trusted (`observation`)."""
    steadiness: float
    """Mean of `track_builder.steadiness`."""
    pose_change: float
    """How far limbs moved against the body, as a fraction of its height."""
    seen_s: float
    """How long it was seen."""
    own_motion: float | None = None
    """How far what is seen of him moved against what is around him in about a second: below 1 as pictures do, above 1
    as people (`own_motion.of_track`); None if that cannot be told."""

    def features(self) -> Float[Array, " 5"]:
        """What the weights multiply: detector, trust, steadiness, motion, own motion.

        The first three are 0 to 1. Motion is −1 for a body that was still for long to 1. Own motion is 1 for somebody
        who moves, 0 where it cannot be told, and for who moves with what is around him alone less the longer he is
        seen, −STILL_MOST at last; his limbs may then jump by the network's noise only, and motion is not above
        MOTION_UNKNOWN.
        """
        motion = np.tanh(np.log(max(self.pose_change, 1e-4) / MOVED))
        if motion < MOTION_UNKNOWN:
            motion += (MOTION_UNKNOWN - motion) * (1 - min(self.seen_s / STILL_S, 1))
        alone = 0.0 if self.own_motion is None else np.tanh(np.log(max(self.own_motion, 1e-6)))
        if alone < 0:
            alone *= min((self.seen_s / SITS_STILL_S) ** 2, STILL_MOST)
            motion = min(motion, MOTION_UNKNOWN)
        return np.array([self.detector, self.trust, self.steadiness, motion, alone])


def person_probability(evidence: Evidence) -> float:
    """Probability that a track is a person's."""
    odds = BIAS + float(np.array(WEIGHTS) @ evidence.features())
    return float(1 / (1 + np.exp(-odds)))


def mean_score(scores: Iterable[float]) -> float:
    """What the detector says of a track, also of one that it never ran on."""
    values = list(scores)
    return float(np.mean(values)) if values else DETECTOR_UNKNOWN


def pose_change(keypoints: Float[Array, "n 33 3"], height: Float[Array, " n"]) -> float:
    """How much the pose varies: spread of the visible limbs about their mean place on the body, in heights.

    `keypoints` x, y, visibility in pixels, `height` the person's, pixels; place and size in the picture play no part.
    The limb that moves most counts (the second of twelve, for one may be guessed).
    """
    limbs = keypoints[:, list(landmarks.LIMBS)]
    places = (limbs[..., :2] - keypoints[:, list(landmarks.TORSO), :2].mean(axis=1, keepdims=True)) / height[
        :, None, None
    ]
    visible = limbs[..., 2] > 0.5
    spread = []
    for limb in range(places.shape[1]):
        own = places[visible[:, limb], limb]
        if len(own) > 2:
            spread.append(float(np.sqrt(own.var(axis=0).sum())))
    return sorted(spread)[-2] if len(spread) > 1 else 0.0
