"""Left and right of one network's limbs as another network names them, and what the two say of who is right.

Limbs are the twelve of `landmarks.LIMBS`, left and right by turns; `side` is that of the person's region.
"""

import numpy as np
from jaxtyping import Float

from humanmm.models.perception.regions import HEIGHT_OF_SIDE
from humanmm.models.records import landmarks

CROSSED = 0.02
"""Fraction of the height by which another network's limbs must fit better with left and right exchanged."""
EVEN_ODDS, CLEAR_ODDS, CLEAR = -0.7, 2.3, 0.08
"""What another network's limbs say of BlazePose's left and right in one frame: log-odds if they fit either way, what is
added or taken away where they clearly do not, and by how much of the height they do so. Fitted to 1,019 frames (spins,
kicks, floor work, acrobatics) in which BlazePose has swapped the sides and 1,783 in which it has not: Thunder fits
better crossed in 59 and 4 % of them, MultiPose in 70 and 5 %."""
CROSSED_ODDS = EVEN_ODDS - CLEAR_ODDS * CROSSED / CLEAR
"""`side_odds` below which Thunder's limbs are crossed."""
ARMS, LEGS = slice(0, 6), slice(6, 12)
"""Of the limbs. Networks disagree about the legs alone about as often as about the whole body."""
_WITH_ENDS = tuple(
    (part, np.array([one for limb in landmarks.LIMBS[part] for one in (limb, *landmarks.BEYOND.get(limb, ()))]))
    for part in (ARMS, LEGS)
)
"""All landmarks of arms and legs, hands and feet too."""
_LIMBS = np.array(landmarks.LIMBS)
_EXCHANGED = np.arange(12).reshape(6, 2)[:, ::-1].ravel()


def is_crossed(
    keypoints: Float[np.ndarray, "33 _"], limbs: Float[np.ndarray, "12 _"], side: float, among: slice = slice(12)
) -> bool:
    """Whether another network's limbs (all, or those `among` them) fit the keypoints better with left and right
    exchanged."""
    return _crossing(keypoints, limbs, side, among) > CROSSED


def side_odds(keypoints: Float[np.ndarray, "33 _"], limbs: Float[np.ndarray, "12 _"], side: float) -> float:
    """Log-odds that left and right of BlazePose's keypoints are right, by another network's limbs in the same frame."""
    return EVEN_ODDS - CLEAR_ODDS * float(np.clip(_crossing(keypoints, limbs, side) / CLEAR, -1, 1))


def named_as(
    keypoints: Float[np.ndarray, "33 _"], limbs: Float[np.ndarray, "12 n"], side: float
) -> Float[np.ndarray, "12 n"]:
    """Another network's limbs, arms and legs each with left and right as the keypoints have them."""
    limbs = limbs.copy()
    for part in (ARMS, LEGS):
        if is_crossed(keypoints, limbs, side, part):
            limbs[part] = limbs[_EXCHANGED[part]]
    return limbs


def body_named_as(
    keypoints: Float[np.ndarray, "33 _"], other: Float[np.ndarray, "33 n"], side: float
) -> Float[np.ndarray, "33 n"]:
    """A body's landmarks, arms with hands and legs with feet each with left and right as the keypoints have them."""
    named = other.copy()
    for part, members in _WITH_ENDS:
        if is_crossed(keypoints, other[_LIMBS], side, part):
            named[members] = other[landmarks.SWAP[members]]
    return named


def _crossing(
    keypoints: Float[np.ndarray, "33 _"], limbs: Float[np.ndarray, "12 _"], side: float, among: slice = slice(12)
) -> float:
    """By how much of the height another network's limbs fit better with left and right exchanged."""
    own = keypoints[_LIMBS, :2][among]
    kept, crossed = (
        float(np.median(np.linalg.norm(limbs[order[among], :2] - own, axis=1))) for order in (np.arange(12), _EXCHANGED)
    )
    return (kept - crossed) / (HEIGHT_OF_SIDE * side)
