"""Takes and bodies: classes by name, sizes by kind, nobody below the floor, short takes there and back."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.body.body24 import load_body
from humanmm.models.rendering.places.takes import (
    BODIES,
    Library,
    choose_take,
    duration_s,
    lowest_point,
    motion_of,
    perform,
    rotated,
    shape,
)
from humanmm.models.synthetic.choreography import KINDS, choreography
from humanmm.models.synthetic.mocap import Actor


@pytest.mark.parametrize(
    ("name", "action", "motion"),
    [
        ("11_01", "soccer - kick ball", "kick"), ("martial_03", "martial arts", "kick"), ("06_01", "walk", "walk"),
        ("Female1_D6_CartWheel", "CartWheel", "acrobatics"), ("Male1_A11_CrawlForward", "CrawlForward", "floor"),
        ("05_02", "dance - expressive arms, pirouette", "dance"), ("13_11", "forward jump", "jump"),
        ("acted_001#0", "stand idle", "everyday"), ("06_10", "basketball - forward dribble", "walk"),
    ],
)  # fmt: skip
def test_takes_are_of_the_class_that_their_words_name(library: Library, name: str, action: str, motion: str) -> None:
    assert motion_of(replace(library.takes[0], name=name, action=action)) == motion


@pytest.mark.parametrize("kind", KINDS)
def test_a_routine_is_of_its_own_class(library: Library, kind: str) -> None:
    empty = Library(())
    assert motion_of(choose_take(empty, kind, np.random.default_rng(0), shortest_s=3.0)) == kind


def test_bodies_are_as_large_as_they_are_called() -> None:
    rng, body = np.random.default_rng(0), load_body()
    heights = {k: [float(np.ptp(body.rest_vertices(shape(k, rng))[:, 1])) for _ in range(8)] for k in BODIES}
    assert max(heights["child"]) < min(heights["short"]) < max(heights["short"]) < min(heights["tall"])
    assert max(heights["child"]) < 1.5
    assert min(heights["tall"]) > 1.85
    belly = np.abs(body.v_template[:, 1] - 0.15) < 0.1
    depth = {
        kind: np.mean([np.ptp(body.rest_vertices(shape(kind, rng))[belly, 2]) for _ in range(8)])
        for kind in ("adult", "heavy")
    }
    assert depth["heavy"] > 1.15 * depth["adult"]


def test_nobody_sinks_into_the_floor() -> None:
    rng = np.random.default_rng(1)
    done = perform(choreography("floor", "routine: floor", 4.0, rng), 4.0, 10.0, rng, body="heavy")
    assert done.motion == "floor"
    assert lowest_point(done.actor, load_body()).min() > -1e-6


def test_a_short_take_is_played_there_and_back_without_a_jump(library: Library) -> None:
    take = library.takes[0].cropped(0, 30)
    actor = perform(take, 3.0, take.fps, np.random.default_rng(0), body="adult").actor
    assert duration_s(take) < 1.0
    assert len(actor.joints) == 90
    steps = np.linalg.norm(np.diff(actor.joints, axis=0), axis=-1)
    assert steps.max() < 0.2


def test_rotating_keeps_the_pose_and_puts_the_path_where_requested(actor: Actor) -> None:
    moved = rotated(actor, 1.0, np.array([2.0, -3.0]))
    path = moved.joints[:, 0, :2]
    np.testing.assert_allclose((path.min(axis=0) + path.max(axis=0)) / 2, [2, -3], atol=1e-9)
    np.testing.assert_allclose(moved.joints[..., 2], actor.joints[..., 2], atol=1e-12)
