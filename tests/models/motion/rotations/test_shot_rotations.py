"""Rotations of all shots from hypotheses: exact evidence is met, no hypothesis decides alone, doubt is a warning."""

import numpy as np
import roma
import torch

from humanmm.models.geometry.rotations import rotation_angle, rotvec_to_rotmat
from humanmm.models.motion.rotations.rotation_mixtures import Mixtures, RotationEdge, RotationHypothesis, Upright
from humanmm.models.motion.rotations.shot_rotations import ShotRotations, _Group, solve_rotations


def rotations(count: int, seed: int = 0) -> np.ndarray:
    torch.manual_seed(seed)
    R = roma.random_rotmat(count, dtype=torch.float64).numpy()
    R[0] = np.eye(3)
    return R


def about_y(angle_deg: float) -> np.ndarray:
    return rotvec_to_rotmat(np.array([0.0, np.radians(angle_deg), 0.0]))


def hypothesis(R_a_b: np.ndarray, sigma_deg: float, probability: float, off_deg: float = 0.0) -> RotationHypothesis:
    return RotationHypothesis(R_a_b @ about_y(off_deg), sigma_deg, probability)


def people(R: np.ndarray, a: int, b: int, *, sigma_deg: float = 10.0, off_deg: float = 0.0) -> RotationEdge:
    return RotationEdge(a, b, (hypothesis(R[a].T @ R[b], sigma_deg, 0.85, off_deg),))


def background(R: np.ndarray, a: int, b: int, *off_deg: float, probability: float = 0.8) -> RotationEdge:
    """An edge from 60 points; each of its hypotheses is this far from the truth."""
    hypotheses = tuple(hypothesis(R[a].T @ R[b], 3.0, probability / len(off_deg), off) for off in off_deg)
    return RotationEdge(a, b, hypotheses, source="plane", num_inliers=60)


def error_deg(found: ShotRotations, R: np.ndarray, shot: int) -> float:
    return float(np.degrees(rotation_angle(found.R_group_shot[shot].T @ R[found.group[shot]].T @ R[shot])))


def test_consistent_edges_are_met_exactly() -> None:
    R = rotations(5)
    found = solve_rotations(5, [*(people(R, k, k + 1) for k in range(4)), background(R, 0, 4, 0.0)])
    assert max(error_deg(found, R, shot) for shot in range(5)) < 1e-3
    assert set(found.group) == {0} and not found.refused


def test_one_edge_alone_decides_and_says_how_surely() -> None:
    R = rotations(2)
    found = solve_rotations(2, [people(R, 0, 1)])
    certainty = found.certainty[1]
    assert error_deg(found, R, 1) < 1e-3 and certainty is not None and 0.6 < certainty.probability < 0.8


def test_a_background_takes_the_error_out_of_a_cut() -> None:
    R = rotations(2)
    found = solve_rotations(2, [people(R, 0, 1, off_deg=12.0), background(R, 0, 1, 0.0)])
    assert error_deg(found, R, 1) < 2.0
    assert found.certainty[1] is not None and found.certainty[1].probability > 0.9


def test_of_a_planes_two_rotations_the_people_choose() -> None:
    R = rotations(2)
    found = solve_rotations(2, [people(R, 0, 1, off_deg=8.0), background(R, 0, 1, 70.0, 0.0)])
    assert error_deg(found, R, 1) < 2.0
    assert found.believed[1].hypothesis is found.believed[1].edge.hypotheses[1]


def test_a_background_that_contradicts_everybody_is_refused_however_many_points_it_has() -> None:
    R = rotations(3)
    honest = [people(R, 0, 1), people(R, 1, 2), RotationEdge(0, 2, people(R, 0, 2).hypotheses)]
    wrong = background(R, 0, 1, 90.0, probability=0.85)
    found = solve_rotations(3, [*honest, wrong])
    assert [one.edge for one in found.refused] == [wrong] and abs(found.refused[0].off_deg - 90) < 1
    assert error_deg(found, R, 1) < 1e-2


def test_backgrounds_that_agree_with_one_another_do_not_overrule_all_people() -> None:
    """A room with four equal walls: a camera rotated by 90° agrees with every other camera's background."""
    R = rotations(5)
    aliased = R.copy()
    aliased[2] = R[2] @ about_y(90.0)
    honest = [people(R, a, a + 1) for a in range(4)] + [people(R, 0, 2)]
    walls = [background(aliased, a, b, 0.0) for b in range(5) for a in range(b)]
    found = solve_rotations(5, [*honest, *walls])
    assert max(error_deg(found, R, shot) for shot in range(5)) < 2.0


def test_gravity_chooses_between_two_rotations() -> None:
    R = rotations(2)
    tilted = rotvec_to_rotmat(np.array([np.radians(50.0), 0.0, 0.0]))
    edge = RotationEdge(0, 1, tuple(hypothesis(T @ R[1], 8.0, 0.45) for T in (tilted, np.eye(3))))
    ups = [Upright(rotation.T @ np.array([0.0, -1.0, 0.0]), 10.0) for rotation in R]
    found = solve_rotations(2, [edge], ups)
    assert error_deg(found, R, 1) < 1e-3


def test_swapped_sides_are_found_by_the_rest_of_the_video() -> None:
    R = rotations(3)
    swapped = RotationEdge(
        0, 1, (hypothesis(R[0].T @ R[1], 10.0, 0.7, 175.0), hypothesis(R[0].T @ R[1], 10.0, 0.15, 5.0))
    )
    found = solve_rotations(3, [swapped, people(R, 1, 2), background(R, 0, 2, 0.0), background(R, 0, 1, 60.0, 0.0)])
    assert error_deg(found, R, 1) < 3.0


def test_two_rotations_that_are_as_likely_are_reported() -> None:
    R = rotations(2)
    torn = RotationEdge(0, 1, tuple(hypothesis(R[0].T @ R[1], 8.0, 0.45, off) for off in (0.0, 120.0)))
    certainty = solve_rotations(2, [torn]).certainty[1]
    assert certainty is not None and certainty.probability < 0.6 and certainty.sigma_deg > 60
    assert certainty.within_95_deg > certainty.sigma_deg


def test_one_good_witness_alone_is_believed_less_than_it_says() -> None:
    """People say 0.9 of themselves, and are right less often where nobody else speaks (docs/measurements/cuts.md)."""
    R = rotations(2)
    certainty = solve_rotations(2, [people(R, 0, 1, sigma_deg=9.0)]).certainty[1]
    assert certainty is not None and 12.0 < certainty.sigma_deg < 25.0 and 0.6 < certainty.probability < 0.8


def test_shots_that_share_nothing_stay_in_groups_of_their_own() -> None:
    R = rotations(4)
    unsure = RotationEdge(1, 2, background(R, 1, 2, 0.0).hypotheses, "plane", 15, connects=False)
    found = solve_rotations(4, [people(R, 0, 1), people(R, 2, 3), unsure])
    assert found.group == (0, 0, 2, 2)
    assert [one.edge for one in found.refused] == [unsure] and np.isnan(found.refused[0].off_deg)
    assert found.certainty[2] is None and found.certainty[0] is None


def test_a_long_video_is_solved_shot_by_shot() -> None:
    R = rotations(60)
    found = solve_rotations(60, [people(R, k, k + 1, off_deg=0.0) for k in range(59)])
    assert error_deg(found, R, 59) < 0.1 and len(found.believed) == 59


def test_what_is_doubtful_is_still_the_answer_rather_than_no_hypothesis_at_all() -> None:
    """Bodies that tilt differently on the two sides make it likelier that nobody is right; the doubt is told. Of the
    hypothesis the answer has the heading; its tilt is nearer to that of the verticals, which are more certain of it."""
    R, tilt = about_y(50.0), np.radians(30.0)
    upright = [Upright(np.array([0.0, -1.0, 0.0]), 5.0), Upright(np.array([np.sin(tilt), -np.cos(tilt), 0.0]), 8.0)]
    level = about_y(170.0) @ rotvec_to_rotmat(np.array([0.0, 0.0, -tilt]))
    edge = RotationEdge(0, 1, (RotationHypothesis(R, 25.0, 0.3), RotationHypothesis(level, 25.0, 1e-4)))
    found = solve_rotations(2, [edge], upright)
    with_level = R @ rotvec_to_rotmat(np.array([0.0, 0.0, -tilt]))
    off, off_level = (error_deg(found, np.stack([np.eye(3), one]), 1) for one in (R, with_level))
    assert off_level < 8.0 and abs(off + off_level - 30.0) < 0.1
    assert found.certainty[1] is not None and found.certainty[1].probability < 0.6


def test_people_who_lean_at_a_cut_do_not_tilt_what_verticals_know() -> None:
    """A hypothesis of 12 degrees that is off by 10 about a level axis, verticals of 1.5 degrees that are right."""
    R = np.stack([np.eye(3), about_y(50.0)])
    leaning = R[1] @ rotvec_to_rotmat(np.array([np.radians(10.0), 0.0, 0.0]))
    upright = [Upright(np.array([0.0, -1.0, 0.0]), 1.5)] * 2
    found = solve_rotations(2, [RotationEdge(0, 1, (RotationHypothesis(leaning, 12.0, 0.8),))], upright)
    assert error_deg(found, R, 1) < 1.5


def test_averaging_takes_out_what_rounding_has_left_of_a_rotation() -> None:
    R = rotations(4)
    edges = [people(R, k, k + 1) for k in range(3)]
    group = _Group(range(4), Mixtures.of(edges, [None] * 4), [None] * 4)
    found = group._averaged((R @ (np.eye(3) + 1e-5))[None])
    assert np.abs(np.swapaxes(found, -1, -2) @ found - np.eye(3)).max() < 1e-12


def test_a_vertical_that_is_wrong_however_sure_of_itself_does_not_turn_a_shot() -> None:
    R = rotations(4)
    tilted = rotvec_to_rotmat(np.array([1.2, 0.0, 0.0]))
    as_tilted = [R[0], R[1], R[2] @ tilted.T, R[3]]  # the third shot as its wrong vertical would have it
    edges = [
        RotationEdge(
            a, a + 1, tuple(hypothesis(of[a].T @ of[a + 1], 8.0, p) for of, p in ((R, 0.8), (as_tilted, 0.001)))
        )
        for a in range(3)
    ]
    right = [Upright(R[k].T @ np.array([0.0, -1.0, 0.0]), 1.0) for k in range(4)]
    wrong = [*right[:2], Upright(tilted @ right[2].direction, 1.0), right[3]]
    for upright in (right, wrong):
        found = solve_rotations(4, edges, upright)
        assert max(error_deg(found, R, shot) for shot in range(1, 4)) < 3


def test_a_cut_is_as_certain_however_many_shots_come_before_and_after() -> None:
    R = rotations(10)
    for upright in ([], [Upright(R[k].T @ np.array([0.0, 0.0, 1.0]), 6.0) for k in range(10)]):
        sure = []
        for num in (2, 5, 10):
            edges = [RotationEdge(k, k + 1, (hypothesis(R[k].T @ R[k + 1], 10.0, 0.6),)) for k in range(num - 1)]
            certainty = solve_rotations(num, edges, upright[:num]).certainty
            sure += [one.probability for one in (certainty[1], certainty[num - 1]) if one is not None]
        assert len(sure) == 6 and np.ptp(sure) < 0.02
