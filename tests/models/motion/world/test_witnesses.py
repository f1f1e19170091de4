"""What is believed of the rotations of shots where witnesses disagree."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from shadowed_ground import shadowed
from three_shots import LENGTH, camera, results, rotation_error_deg

from humanmm.models.cuts.camera_rotation import align_by_bundle
from humanmm.models.cuts.sides import CutCameras, CutPerson
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.world.align import align
from humanmm.models.motion.world.witnesses import WITNESSES
from humanmm.models.records.motion import CutAlignment


def backwards(people: Sequence[CutPerson], cameras: CutCameras, **when: Any) -> CutAlignment:
    """Front and back of people are hard to tell: the wrong way round is a little likelier."""
    cut = align_by_bundle(people, cameras, **when)
    true = cut.hypotheses[0]
    up = cameras_up(int(when["cut_frame"]))
    turned = replace(true, R_before_after=rotvec_to_rotmat(np.pi * up) @ true.R_before_after, probability=0.5)
    return replace(cut, hypotheses=(turned, replace(true, probability=0.4)))


def cameras_up(cut_frame: int) -> np.ndarray:
    """In the axes of the camera before a cut."""
    return np.asarray(camera(cut_frame // LENGTH - 1)[0].T @ [0.0, 0.0, 1.0])


def test_shadows_choose_between_headings_that_people_leave_open() -> None:
    whole = results()
    whole = replace(whole, ground=shadowed(whole, [camera(k) for k in range(3)], azimuth_deg=200.0))
    blind = align(whole, method=backwards, witnesses=WITNESSES - {"shadows"})
    assert min(rotation_error_deg(blind, 19, 20), rotation_error_deg(blind, 39, 40)) > 150
    world = align(whole, method=backwards)
    assert max(rotation_error_deg(world, 19, 20), rotation_error_deg(world, 39, 40)) < 12
    assert all(cut.probability > 0.8 for cut in world.cuts) and not world.warnings
    assert [(one.shot_a, one.shot_b) for one in world.evidence if one.source == "shadows" and one.used] == [
        (0, 1),
        (0, 2),
        (1, 2),
    ]


def test_what_everything_else_agrees_on_is_not_overruled_by_shadows() -> None:
    whole = results()
    lying = [*shadowed(whole, [camera(k) for k in range(3)], azimuth_deg=200.0)]
    lying[1] = shadowed(whole, [camera(k) for k in range(3)], azimuth_deg=20.0)[1]
    world = align(replace(whole, ground=lying))
    assert max(rotation_error_deg(world, 19, 20), rotation_error_deg(world, 39, 40)) < 12
    assert any(one.source == "shadows" and not one.used for one in world.evidence)
