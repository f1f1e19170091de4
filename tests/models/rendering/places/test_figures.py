"""People as pictures: where they are, and how large."""

import numpy as np

from humanmm.models.rendering.places.figures import FIGURE_M, Model, cut_out, picture
from humanmm.models.synthetic.mocap import Actor


def test_a_cut_out_stands_on_its_lower_edge_and_is_as_tall_as_the_person(actor: Actor) -> None:
    model = Model.dressed(actor, np.random.default_rng(0))
    texture = cut_out(model, 5, np.random.default_rng(1), height_px=110)
    rows = np.flatnonzero((texture.image[..., 3] > 127).any(axis=1))
    assert rows[-1] >= 106
    tall = (rows[-1] + 1 - rows[0]) / 110 * FIGURE_M
    assert abs(tall - np.ptp(actor.joints[5, :, 2]) - 0.15) < 0.15


def test_a_picture_has_a_frame_and_no_holes(actor: Actor) -> None:
    texture = picture(Model.dressed(actor, np.random.default_rng(0)), 5, np.random.default_rng(1))
    assert texture.image.shape == (160, 112, 3)
    assert (texture.image[0] == 25).all()
