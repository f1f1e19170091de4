"""Clothes that are drawn quickly, for clips of which tests look at nothing that somebody wears."""

import numpy as np

from humanmm.models.body.body24 import Body
from humanmm.models.rendering.clothing import HEIGHT, WIDTH, Clothing


def grey_clothing(body: Body, rng: np.random.Generator) -> Clothing:
    """In place of `renderer.random_clothing`."""
    return Clothing(np.full((HEIGHT, 2 * WIDTH, 3), 128, np.uint8), np.zeros(len(body.v_template)))
