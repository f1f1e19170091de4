"""What cast shadows say: where the light comes from in each shot, and how two shots' cameras head apart.

The sun and most lamps stay where they are over a cut. In each shot the shadows of its people tell the direction of the
light against the shot's own axes, levelled (`models.shadows.light`); two shots of one place therefore differ by the
heading that carries one direction to the other. That is rough, 10 to 20°, but no pose of a body and no wall that looks
like another has a part in it, so that it chooses between quarter turns.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.rotations.levelling import level_axes
from humanmm.models.motion.rotations.rotation_mixtures import RotationEdge, RotationHypothesis, Upright
from humanmm.models.motion.rotations.shot_results import ShotResults, camera_of, motions_of
from humanmm.models.motion.rotations.standing import standing
from humanmm.models.records.motion import PersonShotMotion
from humanmm.models.shadows.floor import PosedOnFloor, seen_floor
from humanmm.models.shadows.light import AZIMUTHS_DEG, ELEVATIONS_DEG, STEP_DEG, light_log_likelihood

Array = np.ndarray

SHADOW = 0.8
"""Prior probability that there is one light whose shadows can be seen."""
MISTAKEN = 0.05
"""That what explains one person's surroundings best is no shadow of his: a carpet, a drain, somebody else's."""
ONE_LIGHT = 0.9
"""That two shots that people or backgrounds connect are lit from one direction."""
SHADOW_ERROR, FLOOR_ERROR_M, SHADOW_LENGTH_M = 0.06, 0.02, 0.3
"""Standard deviation of where the shadow of somebody's head falls, in his heights: bodies that lean, lamps nearby.
To it comes what a floor that is too high or low, or slopes by the error of the vertical, moves of a shadow of this
length: much if the camera stands low."""
PEAK_DEG = 45.0
"""Headings within this of a maximum belong to it."""
NEIGHBOURS = 3
"""Each shot's light is compared with those of so many shots after it: in a long video the cost grows with the shots."""
LEAST_PROBABILITY = 0.15
"""Headings that are less likely are not named."""


@dataclass(frozen=True, eq=False)
class ShotLight:
    """Where the light of a shot comes from."""

    axes: Float[Array, "3 3"]
    """Level axes of the shot, z up, as columns: shot axes."""
    sigma_deg: float
    """Error of the shot's vertical."""
    shadow_error: float
    """Standard deviation of where the shadow of somebody's head falls, in his heights."""
    probability: float
    """That there is one light whose shadows are seen."""
    direction: Float[Array, "azimuths elevations"]
    """Where it is if so: probabilities of AZIMUTHS_DEG × ELEVATIONS_DEG in these axes."""


def shot_lights(results: ShotResults, upright: Mapping[int, Upright]) -> dict[int, ShotLight]:
    """By shot, where the light comes from, as far as anybody's shadow says so; `upright`: by shot, where up is."""
    certain = results.certain
    found = {}
    for shot, up in upright.items():
        axes = level_axes(up.direction)
        people = [
            person
            for motion in motions_of(results, shot).values()
            if motion.person in certain and (person := _on_floor(results, shot, motion, axes)) is not None
        ]
        if people:
            evidence = [_either(light_log_likelihood(person, seen_floor(person))) for person in people]
            down = float(np.mean([person.depression for person in people]))
            error = (SHADOW_ERROR, FLOOR_ERROR_M / math.tan(down), SHADOW_LENGTH_M * math.radians(up.sigma_deg) / down)
            found[shot] = _light_of(axes, up.sigma_deg, float(np.linalg.norm(error)), evidence)
    return found


def light_edges(lights: Mapping[int, ShotLight]) -> list[RotationEdge]:
    """The headings between each shot that has a light and the next NEIGHBOURS of them."""
    edges, lit = [], sorted(lights)
    for a, b in ((a, b) for k, a in enumerate(lit) for b in lit[k + 1 : k + 1 + NEIGHBOURS]):
        first, second = lights[a], lights[b]
        both = ONE_LIGHT * first.probability * second.probability
        hypotheses = []
        for heading_deg, spread_deg, share in _peaks(_headings(first, second)):
            if both * share >= LEAST_PROBABILITY:
                sigma_deg = float(np.linalg.norm([spread_deg, first.sigma_deg, second.sigma_deg]))
                R = rotvec_to_rotmat(np.array([0.0, 0.0, math.radians(heading_deg)]))
                hypotheses.append(
                    RotationHypothesis(first.axes @ R @ second.axes.T, sigma_deg, both * share, "shadows")
                )
        if hypotheses:
            edges.append(RotationEdge(a, b, tuple(hypotheses), "shadows", connects=False, pooled=True))
    return edges


def _on_floor(
    results: ShotResults, shot: int, motion: PersonShotMotion, axes: Float[Array, "3 3"]
) -> PosedOnFloor | None:
    """A person in the pictures of a shot's ground in which he stands in view; None if there are none."""
    pictures = {picture.frame: picture for picture in results.ground[shot]}
    camera, person = camera_of(results, shot), standing(results, shot, motion, axes)
    rows = [row for row in np.flatnonzero(person.feet_seen) if int(motion.frame[row]) in pictures]
    if not rows:
        return None
    of_rows = [(pictures[int(motion.frame[row])], camera.K[motion.frame[row] - camera.start]) for row in rows]
    return PosedOnFloor(
        joints=person.joints[rows],
        pelvis=person.pelvis[rows],
        floor=person.floor[rows],
        R_level_cam=person.R_level_cam[rows],
        K=np.stack([picture.in_picture(K) for picture, K in of_rows]),
        pictures=[picture.gray for picture, _ in of_rows],
    )


@dataclass(frozen=True, eq=False)
class _Evidence:
    """Of one person, who may be mistaken: log likelihoods against no shadow at all."""

    direction: Float[Array, "azimuths elevations"]
    none: float
    """Of no light's shadow being seen: what is dark is something else."""


def _either(log_likelihood: Float[Array, "azimuths elevations"]) -> _Evidence:
    """What a person's surroundings say if they may show no shadow of his: that, averaged over all directions."""
    anything = math.log(MISTAKEN) + np.logaddexp.reduce(log_likelihood.ravel()) - math.log(log_likelihood.size)
    right = math.log(1 - MISTAKEN)
    return _Evidence(np.logaddexp(right + log_likelihood, anything), float(np.logaddexp(right, anything)))


def _light_of(axes: Float[Array, "3 3"], sigma_deg: float, shadow_error: float, evidence: list[_Evidence]) -> ShotLight:
    """What the people of a shot say together."""
    directions = np.stack([one.direction for one in evidence])
    log_direction = directions.sum(axis=0) + math.log(SHADOW / directions[0].size)
    log_none = sum(one.none for one in evidence) + math.log(1 - SHADOW)
    total = np.logaddexp.reduce(log_direction.ravel())
    seen = float(np.exp(total - np.logaddexp(total, log_none)))
    return ShotLight(axes, sigma_deg, shadow_error, seen, np.exp(log_direction - total))


def _headings(a: ShotLight, b: ShotLight) -> Float[Array, " azimuths"]:
    """Probabilities of the headings, AZIMUTHS_DEG, that carry shot b's level axes to shot a's, if both have one light.

    What is measured is where the shadow of one's head falls, in heights from one's feet: cot(elevation) along the
    azimuth, with the same error in all directions. High lights tell little of the heading.
    """
    length = 1 / np.tan(np.radians(ELEVATIONS_DEG))  # 0 overhead
    variance = a.shadow_error**2 + b.shadow_error**2
    along = np.cos(np.radians(AZIMUTHS_DEG))[:, None, None] * length[:, None] * length
    alike = np.exp(-0.5 * ((length**2)[:, None] + length**2 - 2 * along) / variance)
    # Circular correlations, one for each pair of elevations: azimuth in a = azimuth in b + heading.
    first, second = np.fft.fft(a.direction, axis=0), np.fft.fft(b.direction, axis=0)
    found = np.fft.ifft(np.einsum("fi,fj,fij->f", first, second.conj(), np.fft.fft(alike, axis=0))).real
    found = np.maximum(found, 0.0)
    return np.asarray(found / max(float(found.sum()), 1e-300))


def _peaks(probability: Float[Array, " azimuths"]) -> list[tuple[float, float, float]]:
    """Maxima of a circular distribution over AZIMUTHS_DEG: degrees, standard deviation, and the probability about each.

    What all headings have in common says nothing of any.
    """
    above = probability - probability.min()
    index = np.arange(len(above))
    found = []
    for peak in np.flatnonzero((above >= np.roll(above, 1)) & (above > np.roll(above, -1))):
        away_deg = STEP_DEG * ((index - peak + len(index) // 2) % len(index) - len(index) // 2)
        share = np.where(np.abs(away_deg) <= PEAK_DEG, above, 0.0)
        mean = float(share @ away_deg / share.sum())
        variance = float(share @ (away_deg - mean) ** 2 / share.sum()) + STEP_DEG**2 / 6  # both lights are rounded
        found.append((float(AZIMUTHS_DEG[peak]) + mean, math.sqrt(variance), float(share.sum())))
    return found
