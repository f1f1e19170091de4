"""Which shots share the video's lens, and which clearly have one of their own.

The paper takes one focal length for all shots. Films are cut of several cameras, cameras zoom between shots, and an
editor enlarges a shot. Shots that show one camera's view enlarged have lenses in a known ratio (`camera.background.
enlarged`): such a group has one unknown lens. Every group either shares the video's lens or has one of its own; a
group leaves the shared lens where the evidence for two lenses outweighs the evidence for one by what makes lenses of
their own rare (Bayesian comparison of models: a lens of its own pays with its prior).
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from humanmm.models.camera.focal_length.evidence import Evidence, Weighed, log_likelihood

OWN_LENS_PROBABILITY = 0.2
"""That a shot has a lens of its own, before anything is known of it. With 0.02, 0.1, 0.2, 0.3 and 0.4 the focal lengths
of 33 shots whose neighbours have another lens are off by 20.0, 17.8, 14.6, 13.6 and 12.7 % in the mean, those of 98 of
one lens by 7.1, 7.6, 7.9, 8.4 and 8.4 % (development)."""
SAME = 1.02
"""A camera whose picture comes back from an enlargement within this ratio has its lens back."""


@dataclass(frozen=True)
class LensGroup:
    """Shots that have one lens, but for known ratios."""

    ratios: Mapping[int, float]
    """By shot, how many times as long as the group's its focal length is; the least is 1."""
    evidence: tuple[Evidence, ...]
    """Of the group's focal length."""
    num_frames: int


def groups_of(
    evidence: Sequence[Sequence[Evidence]], enlargements: Mapping[int, float], num_frames: Sequence[int]
) -> list[LensGroup]:
    """Shots in a row that enlargements tie together; `enlargements`: by later shot, how many times as long as that of
    the shot before its focal length is. `evidence` and `num_frames`: by shot."""
    rows: list[dict[int, float]] = []
    for shot in range(len(evidence)):
        if shot in enlargements and rows:
            rows[-1][shot] = rows[-1][shot - 1] * enlargements[shot]
        else:
            rows.append({shot: 1.0})
    groups = []
    for row in rows:
        least = min(row.values())
        ratios = {shot: ratio / least if ratio > SAME * least else 1.0 for shot, ratio in row.items()}
        together = tuple(one.enlarged(1 / ratio) for shot, ratio in ratios.items() for one in evidence[shot])
        groups.append(LensGroup(ratios, together, sum(num_frames[shot] for shot in row)))
    return groups


def with_own_lens(groups: Sequence[LensGroup], default_px: float) -> list[LensGroup]:
    """The groups that do not share the video's lens; never all of those of which anything is known."""
    log_odds = math.log(OWN_LENS_PROBABILITY / (1 - OWN_LENS_PROBABILITY))
    said = [log_likelihood(group.evidence, default_px) for group in groups]
    shared, own = [k for k, group in enumerate(groups) if group.evidence], []

    def log_evidence(chosen: Iterable[int]) -> float:
        return Weighed(np.sum([said[k] for k in chosen], axis=0)).log_evidence

    while len(shared) > 1:
        together = log_evidence(shared)
        gains = {
            k: log_evidence(one for one in shared if one != k) + log_evidence([k]) - together + log_odds for k in shared
        }
        # Of two groups that contradict one another either may leave: the shorter one does.
        best = max(shared, key=lambda k: (round(gains[k], 6), -groups[k].num_frames))
        if gains[best] <= 0:
            break
        shared.remove(best)
        own.append(groups[best])
    return own
