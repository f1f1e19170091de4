"""A person whom something hides altogether leaves no mark."""

import numpy as np

from humanmm.models.body.body24 import load_body
from humanmm.models.rendering.people import draw_person
from humanmm.models.rendering.renderer import ClothedActor
from humanmm.models.rendering.script import Clip
from humanmm.models.rendering.view import FIRST_PERSON, Sample, View


def test_a_person_behind_something_near_leaves_no_mark(clip: Clip) -> None:
    shot = clip.shots[0]
    view = View(shot.R_world_cam[0], shot.t_world_cam[0], clip.K(shot, 0), clip.width, clip.height)
    person = ClothedActor(clip.actors[0], load_body(), np.random.default_rng(0)).at(0)
    shape = (clip.height, clip.width)
    sample = Sample(np.zeros((*shape, 3), np.uint8), np.full(shape, 10, np.float32), np.zeros(shape, np.uint8))
    draw_person(sample, view, person, clip.scene.light, FIRST_PERSON)
    assert not sample.image.any()
    assert not sample.owner.any()
