"""Edges between shots: who joins which shots at cuts, and what the background says of any two."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from three_shots import LENGTH, camera, results

from humanmm.models.camera.background.frame_edges import FrameEdge, ViewHypothesis
from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.camera.background.shot_edges import ShotEdge
from humanmm.models.cuts.camera_rotation import CutCameras, CutPerson, align_by_bundle
from humanmm.models.geometry.rotations import rotation_angle, rotvec_to_rotmat
from humanmm.models.motion.rotations import shot_graph
from humanmm.models.motion.rotations.rotation_mixtures import RotationEdge, RotationHypothesis, Upright
from humanmm.models.motion.rotations.shot_graph import (
    ALIKE_WALLS,
    CutEdge,
    background_edges,
    cut_edge,
    people_edges,
    with_alike,
)
from humanmm.models.motion.rotations.shot_results import ShotResults
from humanmm.models.motion.rotations.shot_rotations import solve_rotations
from humanmm.models.records.motion import CutAlignment, CutHypothesis


def rotation(*degrees: float) -> np.ndarray:
    return np.asarray(rotvec_to_rotmat(np.radians(degrees)))


def panned(whole: ShotResults, shot: int, R_last: np.ndarray) -> ShotResults:
    """The results, with a camera that has rotated by R_last in the last frame of a shot."""
    found = whole.cameras[shot]
    assert found is not None
    R = found.R_shot_cam.copy()
    R[-1] = R_last
    cameras = [replace(found, R_shot_cam=R) if k == shot else one for k, one in enumerate(whole.cameras)]
    return replace(whole, cameras=cameras)


def unused(people: Sequence[CutPerson], cameras: CutCameras, **when: Any) -> CutAlignment:
    raise AssertionError("nothing was left to estimate")


# ---- people


def test_a_person_seen_on_both_sides_of_a_cut_gives_the_rotation_of_the_camera() -> None:
    edge = cut_edge(results(), 1, align_by_bundle, {})
    assert (edge.earlier, edge.later, edge.people, edge.cut.linked) == (0, 1, (0,), True)
    true = camera(0)[0].T @ camera(1)[0]
    assert np.degrees(rotation_angle(edge.cut.R_before_after.T @ true)) < 4.0


def test_who_was_away_joins_the_shot_in_which_he_was_last_seen() -> None:
    edge = cut_edge(results((0, 1, 0)), 2, align_by_bundle, {})
    assert (edge.earlier, edge.later, edge.people) == (0, 2, (0,))
    assert edge.cut.gap_s > 0.6  # the shot between


def test_shots_that_share_nobody_are_not_linked() -> None:
    edge = cut_edge(results((0, 1, 1)), 1, align_by_bundle, {})
    assert (edge.earlier, edge.people, edge.cut.linked) == (0, (), False)
    assert people_edges(results((0, 1, 1)), edge, {}) == []


def test_a_rotation_that_the_user_gives_is_taken_without_an_estimate() -> None:
    given = rotation(0, 70, 0)
    edge = cut_edge(results(), 1, unused, {LENGTH: given})
    assert edge.cut.method == "given" and edge.cut.R_before_after is given
    (found,) = people_edges(results(), edge, {})
    assert [(one.probability, one.source) for one in found.hypotheses] == [(1.0, "given")]


def test_a_cut_is_expressed_in_the_axes_of_its_shots_and_believed_as_far_as_the_identity() -> None:
    R_cut, R_last = rotation(0, 40, 10), rotation(0, 25, 0)
    hypothesis = CutHypothesis(R_cut, 7.0, 0.8, "people, bundle")
    cut = CutAlignment(LENGTH, "bundle", R_cut, 7.0, 0.0, 0.03, True, hypotheses=(hypothesis,))
    (edge,) = people_edges(panned(results(), 0, R_last), CutEdge(0, 1, (cut,), (3,)), {(3, 1): 0.5})
    (one,) = edge.hypotheses
    np.testing.assert_allclose(one.R_a_b, R_last @ R_cut, atol=1e-12)
    assert (one.sigma_deg, one.probability, one.source, edge.source) == (7.0, 0.4, "person 3, bundle", "person 3")


# ---- backgrounds


def features(frame: int, scene: int) -> FrameFeatures:
    """What a static camera sees of one background in any frame."""
    random = np.random.default_rng(scene)
    xy = random.uniform([0, 0], [960, 540], (60, 2)).astype(np.float32)
    descriptors = random.integers(0, 256, (60, 128)).astype(np.uint8)
    return FrameFeatures(frame, xy, descriptors, np.zeros((0, 4), np.float32))


def test_a_camera_that_returns_is_recognised_and_a_failed_shot_has_no_edge() -> None:
    whole = replace(results(), key_frames=[(features(10, 7),), (features(30, 8),), (features(50, 7),)])
    found = background_edges(whole)
    (edge,) = found.edges
    assert (edge.a, edge.b, edge.source, edge.connects) == (0, 2, "same camera", True)
    np.testing.assert_allclose(edge.hypotheses[0].R_a_b, np.eye(3), atol=1e-12)
    assert [(one.shot_a, one.shot_b) for one in found.same] == [(0, 2)]
    failed = background_edges(replace(whole, cameras=[None, *whole.cameras[1:]]))
    assert failed.edges == () and failed.same == ()


def test_a_shot_with_a_longer_lens_is_compared_as_if_it_had_the_others() -> None:
    whole = results()
    wide = features(0, 1)
    K = np.array(whole.cameras[1].K)
    middle = np.float32(K[0, :2, 2])
    closer = replace(wide, frame=LENGTH, xy=middle + np.float32(1.5) * (wide.xy - middle))
    K[:, [0, 1], [0, 1]] *= 1.5
    cameras = [whole.cameras[0], replace(whole.cameras[1], K=K), whole.cameras[2]]
    seen = replace(whole, key_frames=[(wide,), (closer,), ()])
    assert background_edges(replace(seen, cameras=cameras)).edges[0].source == "same camera"
    assert background_edges(seen).same == ()


def test_hypotheses_that_agree_are_one_and_their_probabilities_never_exceed_that_of_the_edge(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    R, other = rotation(0, 20, 0), rotation(0, -60, 0)
    views = (
        ViewHypothesis(R, 150, 0.6, "essential matrix"),
        ViewHypothesis(rotation(0, 22, 0), 60, 0.5, "plane"),
        ViewHypothesis(other, 40, 0.2, "plane"),
    )
    shot_edge = ShotEdge(0, 1, (FrameEdge(5, LENGTH + 5, views),))
    monkeypatch.setattr(shot_graph, "find_shot_edges", lambda key_frames, K: (shot_edge,))
    (edge,) = background_edges(results()).edges
    first, second = edge.hypotheses
    np.testing.assert_allclose(first.R_a_b, R, atol=1e-12)  # that of the more inliers
    np.testing.assert_allclose(second.R_a_b, other, atol=1e-12)
    total = 1 - (1 - 0.6) * (1 - 0.5) ** 0.5 + 0.2
    share = (1 - 0.4 * 0.5 * 0.8) / total
    assert first.probability == pytest.approx((total - 0.2) * share)
    assert second.probability == pytest.approx(0.2 * share)
    assert edge.connects and edge.num_inliers == 150 and edge.source == "essential matrix and plane"
    assert background_edges(results()).same == ()


# ---- walls that look alike

UP = Upright(np.array([0.0, -1.0, 0.0]), 1.0)


def background_off_by(angle_deg: float, *, source: str = "plane") -> RotationEdge:
    """Two shots whose cameras are not rotated against each other, and a background that says otherwise."""
    R = rotation(0, angle_deg, 0)
    return RotationEdge(0, 1, (RotationHypothesis(R, 1.5, 0.9, source),), source, num_inliers=200)


def witness(a: int, b: int) -> RotationEdge:
    return RotationEdge(a, b, (RotationHypothesis(np.eye(3), 10.0, 0.7, "person 0"),), "person 0")


@pytest.mark.parametrize("turn_deg", [90.0, -90.0, 180.0])
def test_another_wall_that_looks_alike_does_not_overrule_a_person(turn_deg: float) -> None:
    wrong, ups = [background_off_by(turn_deg)], [UP, UP]
    believed = solve_rotations(2, [*wrong, witness(0, 1)], ups).R_group_shot[1]
    assert abs(np.degrees(rotation_angle(believed)) - abs(turn_deg)) < 1
    doubted = solve_rotations(2, [*with_alike(wrong, ups, ALIKE_WALLS, "another wall"), witness(0, 1)], ups)
    assert np.degrees(rotation_angle(doubted.R_group_shot[1])) < 2
    assert {one.hypothesis.source for one in doubted.believed} == {"plane, another wall", "person 0"}


def test_a_background_alone_and_one_that_is_wrong_otherwise_are_as_they_were() -> None:
    ups = [UP, UP]
    alone = solve_rotations(2, with_alike([background_off_by(40.0)], ups, ALIKE_WALLS, "another wall"), ups)
    assert abs(np.degrees(rotation_angle(alone.R_group_shot[1])) - 40) < 1
    contradicted = solve_rotations(
        2, [*with_alike([background_off_by(40.0)], ups, ALIKE_WALLS, "another wall"), witness(0, 1)], ups
    )
    assert abs(np.degrees(rotation_angle(contradicted.R_group_shot[1])) - 40) < 1


def test_one_camera_that_returns_and_a_shot_without_a_vertical_have_no_other_walls() -> None:
    returned, unknown = background_off_by(0.0, source="same camera"), background_off_by(0.0)
    assert with_alike([returned], [UP, UP], ALIKE_WALLS, "another wall") == [returned]
    assert with_alike([unknown], [None, UP], ALIKE_WALLS, "another wall") == [unknown]
    (edge,) = with_alike([unknown], [UP, UP], ALIKE_WALLS, "another wall")
    assert sum(one.probability for one in edge.hypotheses) == pytest.approx(0.9)
