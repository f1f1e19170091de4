"""The rotations of the camera that one person allows at a cut, each with its expected error and its probability.

They are the answers of the bundle adjustments, with left and right as found and swapped, and the rotation that carries
the fitted body over the cut; and each of these again after the time that may be missing between the two shots, during
which a spinning body rotates on. The constants are those under which the true rotations of 108 people at 85 cuts of
rendered clips are the most likely; docs/measurements/cuts.md has what they give on others.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from humanmm.models.cuts.bundle import BundleResult
from humanmm.models.cuts.sides import CutPerson, SideTrack
from humanmm.models.geometry.rotations import angle_between_deg, rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.records.motion import CutHypothesis

Array = np.ndarray

ROTATION_DEG_S = 40.0
"""Rotation error that each second without an observation adds."""
BIAS_DEG = 9.5
"""68 % of rotations are off by less where one motion explains both sides: nothing at the cut betrays the pose network's
bias of one posture seen from two sides."""
GOOD_COST, DEG_PER_COST, MAX_SIGMA_DEG = 8.0, 0.3, 45.0
"""A motion that explains both sides costs about GOOD_COST (½ Σ of squared normalised residuals); what it costs
more, the rotation is off by more."""
WRONG, WRONG_COST, WRONG_GAP_S = 0.05, 80.0, 0.8
"""Probability that no hypothesis is true at a cut like most; cost and gap at which it is one half and 0.63."""
COST_TEMPERATURE = 0.7
"""Costs count by so much when hypotheses are compared: the errors of one body's landmarks hang together."""
FAR_DEG = 45.0
"""The bundle's answer and the fitted body's are averaged up to this angle."""
SWAPPED = 0.15
"""Probability that left and right are swapped on one side of a cut although they were put right before."""
SIDES_SWAPPED = "left and right swapped"
DISTINCT_DEG = 20.0
"""Answers closer together than this are one answer."""
NEGLIGIBLE = 1e-4
FITTED_BODY = 0.2
"""Probability of the fitted body's own rotation."""
SPIN_S = 0.2
"""Span over which a body's angular velocity at a cut is measured, seconds."""
LOST_S, NOTHING_LOST = 0.3, 0.7
"""So much time may be missing between two shots beyond what their time stamps say; probability that none is."""
UNLIKELY = 0.05
"""Hypotheses that are less likely are not followed through lost time."""
SPIN_STEP_DEG = 20.0
"""Rotation of the body from one hypothesis of the lost time to the next."""
SPIN_ERROR = 0.15
"""Error of that rotation, as a fraction of it."""


def hypotheses_of(
    people: Sequence[CutPerson], answers: Sequence[BundleResult], swapped: Sequence[BundleResult], gap_s: float
) -> tuple[CutHypothesis, ...]:
    """All rotations at a cut, likeliest first.

    `answers`, `swapped`: of the bundle adjustments of these people with their sides as found, and with left and right
    swapped after the cut. `gap_s`: time without an observation. The bodies of several people are not consulted.
    """
    one = people[0] if len(people) == 1 else None
    found = _distinct(answers, "people", gap_s)
    if one is not None:
        found = [(cost, _with_fitted_body(hypothesis, one)) for cost, hypothesis in found]
    found += _distinct(swapped, f"people, {SIDES_SWAPPED}", gap_s)
    cost = min(cost for cost, _ in found) / len(people)
    true = (1 - WRONG) * float(np.exp(-gap_s / WRONG_GAP_S)) / (1 + (cost / WRONG_COST) ** 2)
    weighed = _weighed(found)
    if one is not None:
        R_body = fitted_body_rotation(one)
        if R_body is not None:
            weighed = [replace(each, probability=(1 - FITTED_BODY) * each.probability) for each in weighed]
            sigma = float(np.hypot(BIAS_DEG, ROTATION_DEG_S * gap_s))
            weighed.append(CutHypothesis(R_body, sigma, FITTED_BODY, "people, fitted body"))
        weighed = [later for each in weighed for later in _through_lost_time(each, one)]
    weighed.sort(key=lambda each: -each.probability)
    return tuple(
        replace(each, probability=true * each.probability) for each in weighed if each.probability > NEGLIGIBLE
    )


def fitted_body_rotation(person: CutPerson) -> Float[Array, "3 3"] | None:
    """The camera's rotation if the fitted body does not rotate between its last and its first observation."""
    if person.before.R_cam_root is None or person.after.R_cam_root is None:
        return None
    before = person.before.R_cut_cam[-1] @ person.before.R_cam_root[-1]
    return np.asarray(before @ (person.after.R_cut_cam[0] @ person.after.R_cam_root[0]).T)


def _distinct(results: Sequence[BundleResult], source: str, gap_s: float) -> list[tuple[float, CutHypothesis]]:
    """The different answers of one bundle adjustment, each with its cost; their probabilities are still open."""
    kept: list[tuple[float, CutHypothesis]] = []
    for result in results:
        if all(angle_between_deg(result.R_before_after, other.R_before_after) > DISTINCT_DEG for _, other in kept):
            of_cost = DEG_PER_COST * max(result.cost - GOOD_COST, 0.0)
            sigma = min(float(np.linalg.norm([BIAS_DEG, of_cost, ROTATION_DEG_S * gap_s])), MAX_SIGMA_DEG)
            kept.append((result.cost, CutHypothesis(result.R_before_after, sigma, 0.0, source)))
    return kept


def _with_fitted_body(hypothesis: CutHypothesis, person: CutPerson) -> CutHypothesis:
    """The mean of an answer and of the rotation that carries the fitted body over the cut, where the two are near.

    The body is fitted to a whole shot, the answer to the frames at the cut: their errors differ (41 cuts of rendered
    clips: median 12.0° and 11.8°, of the mean 9.5°), and their distance from each other is a measure of their error.
    """
    R_body = fitted_body_rotation(person)
    if R_body is None:
        return hypothesis
    between = rotmat_to_rotvec(hypothesis.R_before_after.T @ R_body)
    apart_deg = float(np.degrees(np.linalg.norm(between)))
    if apart_deg > FAR_DEG:
        return hypothesis
    return replace(
        hypothesis,
        R_before_after=hypothesis.R_before_after @ rotvec_to_rotmat(0.5 * between),
        sigma_deg=float(np.hypot(hypothesis.sigma_deg, 0.5 * apart_deg)),
    )


def _weighed(found: Sequence[tuple[float, CutHypothesis]]) -> list[CutHypothesis]:
    """The hypotheses with their probabilities, if one of them is true."""
    costs = np.array([cost for cost, _ in found])
    prior = np.where([one.source.endswith(SIDES_SWAPPED) for _, one in found], SWAPPED, 1.0)
    weights = prior * np.exp(-COST_TEMPERATURE * (costs - costs.min()))
    weights /= weights.sum()
    return [replace(one, probability=float(weight)) for (_, one), weight in zip(found, weights, strict=True)]


def _through_lost_time(hypothesis: CutHypothesis, person: CutPerson) -> Iterator[CutHypothesis]:
    """The hypothesis, and what it becomes if the body rotated on while nobody filmed.

    A lost time l adds the rotation ω l of the body, half of it at the angular velocity ω before the cut, half at that
    after it. A body that hardly spins, and an unlikely answer, leave one hypothesis.
    """
    before, after = _angular_velocity(person.before, last=True), _angular_velocity(person.after, last=False)
    turned_deg = float(np.degrees(0.5 * LOST_S * (np.linalg.norm(before) + np.linalg.norm(after))))
    steps = int(np.ceil(turned_deg / SPIN_STEP_DEG))
    if steps <= 1 or hypothesis.probability < UNLIKELY:
        yield hypothesis
        return
    yield replace(hypothesis, probability=NOTHING_LOST * hypothesis.probability)
    for part in np.arange(1, steps + 1) / steps:
        half_s = 0.5 * LOST_S * part
        yield replace(
            hypothesis,
            R_before_after=rotvec_to_rotmat(before * half_s)
            @ hypothesis.R_before_after
            @ rotvec_to_rotmat(after * half_s),
            sigma_deg=float(np.hypot(hypothesis.sigma_deg, SPIN_ERROR * turned_deg * part)),
            probability=(1 - NOTHING_LOST) / steps * hypothesis.probability,
        )


def _angular_velocity(track: SideTrack, *, last: bool) -> Float[Array, "3"]:
    """Of the fitted body at the end that faces the cut, by least squares over SPIN_S: rad/s, axes of the camera at the
    cut."""
    if track.R_cam_root is None:
        return np.zeros(3)
    end = -1 if last else 0
    since = track.time_s - track.time_s[end]
    near = np.abs(since) <= SPIN_S
    R = (track.R_cut_cam @ track.R_cam_root)[near]
    rotvec = rotmat_to_rotvec(R @ R[end].T)
    since = since[near]
    return np.asarray(since @ rotvec / max(float(since @ since), 1e-9))
