"""Toes bend where the floor is in their way, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.motion.fit.state import LongMotion, Skeleton
from humanmm.models.motion.refine.footlock import LEGS, contact_positions
from humanmm.models.motion.refine.refine import sole_heights
from humanmm.models.motion.refine.toes import bent_toes, toe_length

BODY, BETAS = load_body(), np.zeros(10)
SOLES, LENGTH_M = sole_heights(BODY, BETAS), toe_length(BODY, BETAS)
TOES = [leg[-1] for leg in LEGS]
N = 40
TIME_S = np.arange(N) / 30


def on_toes(down_rad: float, above_m: float) -> LongMotion:
    """A motion whose feet point down, their toe bases so far above the floor on which flat feet would have them."""
    vectors = np.zeros((N, 24, 3), np.float32)
    vectors[:, 0, 0] = np.pi / 2  # the rest pose's y is up
    vectors[:, [leg[2] for leg in LEGS], 0] = down_rad
    rest = Skeleton(BODY.rest_joints(BETAS), np.zeros(0, int), np.zeros((0, 3)))
    motion = LongMotion(rest, vectors, np.zeros((N, 3)))
    up = np.zeros((N, 3))
    up[:, 2] = SOLES[1] + above_m - contact_positions(motion)[:, 1, 2]
    return replace(motion, pelvis_ref=up)


@pytest.mark.parametrize("down_rad", [0.0, 0.3, 0.7])
def test_toes_lie_on_the_floor_while_the_heel_rises(down_rad: float) -> None:
    motion = on_toes(down_rad, 0.0)
    bent = bent_toes(motion, SOLES, LENGTH_M, TIME_S)
    assert np.allclose(bent.vectors[:, TOES, 0], -down_rad, atol=1e-5)
    assert np.array_equal(np.delete(bent.vectors, TOES, axis=1), np.delete(motion.vectors, TOES, axis=1))


def test_toes_of_a_foot_in_the_air_are_straight() -> None:
    motion = on_toes(0.7, 1.1 * LENGTH_M)
    assert not bent_toes(motion, SOLES, LENGTH_M, TIME_S).vectors[:, TOES].any()


def test_toes_do_not_snap_when_the_foot_leaves_the_floor() -> None:
    motion = on_toes(0.7, 0.0)
    pelvis = motion.pelvis_ref.copy()
    pelvis[N // 2 :, 2] += 0.2
    bent = bent_toes(replace(motion, pelvis_ref=pelvis), SOLES, LENGTH_M, TIME_S)
    assert np.abs(np.diff(bent.vectors[:, TOES, 0], axis=0)).max() < 0.3


def test_toes_are_a_few_centimetres_long() -> None:
    assert 0.04 < LENGTH_M < 0.09
