"""Cameras: they hold the first person, and do what their kind says."""

import numpy as np
import pytest

from humanmm.models.rendering.places.cameras import CAMERA_KINDS, CameraKind, Lens, again, film_shot, fraction_in_view
from humanmm.models.rendering.script import LEAST_IN_VIEW
from humanmm.models.synthetic.mocap import Actor

LENS = Lens(480, 270, 420.0, 25.0)


@pytest.mark.parametrize("kind", CAMERA_KINDS)
def test_a_camera_holds_the_person_and_moves_as_its_kind_says(actor: Actor, kind: CameraKind) -> None:
    shot = film_shot([actor], (0, 20), 1.0, kind, LENS, np.random.default_rng(2))
    assert fraction_in_view(actor.joints, shot, LENS) >= LEAST_IN_VIEW
    moved = np.ptp(shot.t_world_cam, axis=0).max()
    assert (moved < 1e-9) == (kind in ("static", "pan"))
    assert kind != "drone" or shot.t_world_cam[:, 2].min() > 2.5


def test_a_camera_that_returns_stands_where_it_was(actor: Actor) -> None:
    shot = film_shot([actor], (0, 10), 1.0, "dolly", LENS, np.random.default_rng(2))
    back = again(shot, (10, 20), np.random.default_rng(0))
    np.testing.assert_array_equal(back.t_world_cam, np.tile(shot.t_world_cam[-1], (10, 1)))
    np.testing.assert_allclose(back.R_world_cam[3], shot.R_world_cam[-1])
