"""From shots to one world: cuts are joined, failed shots are marked, strangers are kept apart."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from three_shots import LENGTH, camera, results, rotation_error_deg

from humanmm.models.cuts.camera_rotation import align_by_bundle, align_by_eight_point
from humanmm.models.cuts.hypotheses import SIDES_SWAPPED
from humanmm.models.cuts.sides import CutCameras, CutPerson
from humanmm.models.motion.world.align import align
from humanmm.models.records.motion import CutAlignment, ShotMotion
from humanmm.models.records.shots import Transition


def test_exact_shots_give_back_cameras_and_motion() -> None:
    world = align(results())
    assert [cut.linked for cut in world.cuts] == [True, True]
    # The cut is exact up to a degree or two: priors pull motion and bones a little.
    assert max(rotation_error_deg(world, 19, 20), rotation_error_deg(world, 39, 40)) < 4.0
    person = world.people[0]
    assert person.observed.all() and len(person.frame) == 3 * LENGTH
    np.testing.assert_allclose(person.pelvis_world, np.tile([0, 0, 0.95], (60, 1)), atol=0.08)
    forward = world.R_world_cam[0][:, 2]
    assert abs(forward[0]) < 1e-6 and forward[1] > 0.9


def test_reported_rotations_are_those_of_the_cameras() -> None:
    world = align(results())
    for cut in world.cuts:
        R = world.R_world_cam[cut.cut_frame - 1].T @ world.R_world_cam[cut.cut_frame]
        np.testing.assert_allclose(cut.R_before_after, R)


def test_every_piece_of_evidence_is_reported_and_how_certain_a_cut_is() -> None:
    world = align(results())
    assert [(one.shot_a, one.shot_b, one.source, one.used) for one in world.evidence] == [
        (0, 1, "person 0", True),
        (1, 2, "person 0", True),
    ]
    assert all(cut.uncertainty_deg < 30 and cut.probability > 0.8 for cut in world.cuts) and not world.warnings


def test_somebody_whose_sides_do_not_fit_the_rest_is_reported() -> None:
    def torn(people: Sequence[CutPerson], cameras: CutCameras, **when: Any) -> CutAlignment:
        cut = align_by_bundle(people, cameras, **when)
        swapped = replace(cut.hypotheses[0], source=f"people, {SIDES_SWAPPED}")
        return replace(cut, hypotheses=(swapped,))

    world = align(results(), method=torn)
    assert world.evidence[0].source == "person 0, left and right swapped"
    assert any("face the wrong way" in warning for warning in world.warnings)


@pytest.mark.parametrize("lost", [0, 1, 2])
def test_a_failed_shot_is_marked_and_the_others_keep_together(lost: int) -> None:
    whole = results()
    cameras = [None if k == lost else c for k, c in enumerate(whole.cameras)]
    motions = [None if k == lost else m for k, m in enumerate(whole.motions)]
    world = align(replace(whole, cameras=cameras, motions=motions))
    codes = world.camera_source.reshape(3, LENGTH)
    assert (codes[lost] == 4).all() and (np.delete(codes, lost, axis=0) == 0).all()
    assert np.isfinite(world.t_world_cam).all()
    person = world.people[0]
    assert not person.observed[(person.frame // LENGTH) == lost].any()
    assert person.observed.sum() == 2 * LENGTH
    if lost == 1:  # two thirds of a second are lost between them
        assert any("uncertain" in warning for warning in world.warnings)


def test_a_shot_of_somebody_else_keeps_gravity_and_floor_and_says_so() -> None:
    world = align(results((0, 0, 1)))
    assert [cut.linked for cut in world.cuts] == [True, False]
    assert world.cuts[1].method == "none"
    stranger = world.people[1]
    np.testing.assert_allclose(stranger.pelvis_world[0], [0, 0, 0.95], atol=0.1)
    up = world.R_world_cam[40].T @ np.array([0, 0, 1.0])
    true = camera(2)[0].T @ np.array([0, 0, 1.0])
    assert np.degrees(np.arccos(np.clip(up @ true, -1, 1))) < 6.0


def within(motion: ShotMotion, clear: tuple[int, int]) -> ShotMotion:
    """The motion in the clear frames of its shot, as `hmr` gives it."""
    (person,) = motion.people
    rows = (person.frame >= clear[0]) & (person.frame < clear[1])
    kept = {f.name: getattr(person, f.name)[rows] for f in fields(person) if f.name not in ("person", "betas")}
    return replace(motion, people=(replace(person, **kept),))


def test_the_middle_of_a_dissolve_is_not_observed_on_either_side() -> None:
    whole = results()
    dissolve = Transition("dissolve", 14, 26, "scene")
    first, second = replace(whole.shots.shots[0], ending=dissolve), replace(whole.shots.shots[1], transition=dissolve)
    shots = replace(whole.shots, shots=(first, second, whole.shots.shots[2]))
    motions = [within(m, shot.clear) for m, shot in zip(whole.motions, shots.shots, strict=True) if m is not None]
    world = align(replace(whole, shots=shots, motions=motions))
    hidden = np.flatnonzero(~world.people[0].observed)
    np.testing.assert_array_equal(hidden, np.arange(17, 23))
    assert world.cuts[0].gap_s > 0.2


def test_a_shot_with_nobody_in_it_keeps_its_camera() -> None:
    whole = results()
    middle = whole.motions[1]
    assert middle is not None
    empty = replace(whole.shots.shots[1], people=())
    shots = replace(whole.shots, shots=(whole.shots.shots[0], empty, whole.shots.shots[2]))
    motions = (whole.motions[0], replace(middle, people=()), whole.motions[2])
    world = align(replace(whole, shots=shots, motions=motions))
    assert [cut.linked for cut in world.cuts] == [False, True]
    assert np.isfinite(world.R_world_cam).all() and np.isfinite(world.t_world_cam).all()
    assert (world.camera_source[20:40] == 0).all()


def test_the_papers_method_is_there_too() -> None:
    world = align(results(), method=align_by_eight_point)
    assert {cut.method for cut in world.cuts} == {"eight-point"}
    assert max(rotation_error_deg(world, 19, 20), rotation_error_deg(world, 39, 40)) < 25.0


def test_a_rotation_that_is_known_is_taken_as_it_is_and_the_other_cut_is_still_solved() -> None:
    known = camera(0)[0].T @ camera(1)[0]
    world = align(results(), known_rotations={LENGTH: known})
    assert [cut.method for cut in world.cuts] == ["given", "bundle"]
    assert rotation_error_deg(world, 19, 20) < 0.1  # levelling all shots together moves it by nothing
    assert rotation_error_deg(world, 39, 40) < 4.0
