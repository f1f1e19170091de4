"""Where the world begins and how it is headed, and which change of the focal length is believed."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from three_shots import BETAS, results
from walker import EDGE, scene

from humanmm.models.motion.world import align as module
from humanmm.models.motion.world import witnesses
from humanmm.models.motion.world.align import UNKNOWN_SCALE, _at_origin, _path_scale, align
from humanmm.models.motion.world.solver import solve
from humanmm.models.records.motion import ShotMotion
from humanmm.models.records.shots import Appearance, Person


def test_the_world_begins_above_the_origin_and_looks_along_y() -> None:
    trajectories, rigs, _ = scene()
    R = Rotation.from_euler("zx", [35, -90], degrees=True).as_matrix()
    solution = _at_origin(solve(trajectories, rigs, [EDGE]), trajectories, R)
    np.testing.assert_allclose(solution.pelvis[0][0, :2], 0, atol=1e-9)
    ahead = solution.rotation[0] @ R[:, 2]
    assert abs(ahead[0]) < 1e-9 and ahead[1] > 0.9


def test_the_scale_of_a_path_is_no_less_certain_than_unknown() -> None:
    trajectories, rigs, _ = scene()
    solution = solve(trajectories, rigs, [EDGE])
    for std, said in ((0.2, 0.2), (2e6, UNKNOWN_SCALE), (np.inf, UNKNOWN_SCALE)):
        unsure = replace(solution, log_scale_std=np.full(len(rigs), std))
        assert _path_scale(0, unsure, 0, seen=True).relative_uncertainty == said


@pytest.mark.parametrize(
    ("wanted", "factor", "dispute", "longer"),
    [(1.02, 1.02, 0.0, [1.0]), (1.15, 1.15, 0.0, [1.0, 1.15]), (1.4, 1.0, np.log(1.4), [1.0, 1.0])],
)
def test_a_change_of_the_focal_length_far_from_its_estimate_is_told_and_not_believed(
    monkeypatch: pytest.MonkeyPatch, wanted: float, factor: float, dispute: float, longer: list[float]
) -> None:
    """The estimate is good to 10 %; `longer`: with which focal lengths everything was decided."""
    given = results()
    given = replace(given, intrinsics=replace(given.intrinsics, source="estimated", relative_uncertainty=0.1))
    solved, used = module._aligned, []

    def counted(shots: Any, *rest: Any, focal: float | None = None) -> Any:
        used.append(shots.intrinsics.focal_px / given.intrinsics.focal_px)
        world = solved(shots, *rest, focal=1.0)
        return world if focal else replace(world, focal_factor=wanted)

    monkeypatch.setattr(module, "_aligned", counted)
    world = align(given)
    assert world.focal_factor == pytest.approx(factor) and world.focal_dispute == pytest.approx(dispute)
    assert used == pytest.approx(longer)


@pytest.mark.parametrize("inset", [False, True])
def test_who_is_doubtful_is_delivered_and_moves_no_camera(inset: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody who hangs in the air, as the pictures of three static cameras have him. He looks like the other, who
    could therefore be he: how likely that is would weigh the other's evidence."""
    monkeypatch.setattr(witnesses, "identity_answers", lambda *_: {})
    alone = results()
    doubtful = Person(1, BETAS, 1.0, 0.3, inset=inset)

    def with_him(motion: ShotMotion | None) -> ShotMotion:
        assert motion is not None
        above = replace(
            motion.people[0], person=1, pelvis_cam=motion.people[0].pelvis_cam + np.array([0.3, -0.8, -1.0])
        )
        return replace(motion, people=(*motion.people, above))

    listed = replace(
        alone.shots,
        people=(*alone.shots.people, doubtful),
        shots=tuple(replace(shot, people=(*shot.people, Appearance(1, 0))) for shot in alone.shots.shots),
    )
    both = align(replace(alone, shots=listed, motions=[with_him(motion) for motion in alone.motions]))
    world = align(alone)
    np.testing.assert_allclose(both.R_world_cam, world.R_world_cam, atol=1e-9)
    np.testing.assert_allclose(both.t_world_cam, world.t_world_cam, atol=1e-9)
    np.testing.assert_allclose(both.people[0].pelvis_world, world.people[0].pelvis_world, atol=1e-9)
    assert [one.person for one in both.people] == [0, 1]
    assert both.people[1].pelvis_world[:, 2].min() > world.people[0].pelvis_world[:, 2].max() + 0.3
