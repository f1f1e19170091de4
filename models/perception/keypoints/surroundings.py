"""What the pose networks' inner layers show about each landmark: the refiner's input.

Positions are pixels of the crop (256 × 256), left and right named as the crop shows them.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.perception.blazepose import Inside as BlazePoseInside
from humanmm.models.perception.blazepose import sigmoid
from humanmm.models.perception.movenet import Inside as ThunderInside
from humanmm.models.records.landmarks import COCO_LANDMARKS, INDEX, LIMBS, NUM_LANDMARKS, SWAP

Array = np.ndarray

WEIGHTS = "keypoint_refiner.safetensors"
REFINED = (*LIMBS, *range(INDEX["left_heel"], NUM_LANDMARKS), *range(INDEX["left_pinky"], INDEX["left_hip"]))
"""Landmarks that are refined, in the refiner's order: limbs, feet and hands. Of the face BlazePose alone is as good."""
COUNT = len(REFINED)
LIMB_ROWS, HANDS = range(len(LIMBS)), range(COUNT - 6, COUNT)
"""Rows of REFINED."""
CHANNELS = 48 + 24 + 2
"""Of a cell: BlazePose's and Thunder's features, and the heat of the landmark itself in either's heat maps."""
COARSE_CHANNELS = 96
WINDOW = 7
"""Cells of a window, a side; its middle is the landmark."""
_CELL, _COARSE_CELL = 4, 8
"""Pixels of the crop from one cell to the next."""
_AROUND = np.arange(-(WINDOW // 2), WINDOW // 2 + 2)
_REFINED = np.array(REFINED)
_OF_THUNDER = np.array([COCO_LANDMARKS.index(k) if k in COCO_LANDMARKS else -1 for k in REFINED])
_OPPOSITE = np.array([REFINED.index(SWAP[k]) for k in REFINED])


@dataclass(frozen=True, eq=False)
class Seen:
    """One crop as both networks see it; the rows of arrays are REFINED's landmarks."""

    blazepose: Float[Array, "22 2"]
    thunder: Float[Array, "22 2"]
    """Its keypoints, left and right named as BlazePose does; BlazePose's of hands and feet, which it does not know."""
    fused: Float[Array, "22 2"]
    """Where the windows are."""
    visibility: Float[Array, " 22"]
    sigma: Float[Array, " 22"]
    """BlazePose's expected errors, sides of the crop."""
    score: Float[Array, " 22"]
    """Thunder's; 0 of hands and feet."""
    is_crossed: Bool[Array, " 22"]
    """Thunder names this landmark's left and right otherwise."""
    blazepose_inside: BlazePoseInside
    thunder_inside: ThunderInside

    def windows(self) -> Float[Array, "22 7 7 74"]:
        """What the layers show about each landmark, between their cells linearly; 0 outside the crop."""
        at = self.fused / _CELL - 0.5
        first = np.floor(at).astype(int)
        columns, rows = (first[:, axis, None] + _AROUND for axis in (0, 1))
        cells = 64
        is_inside = ((columns >= 0) & (columns < cells))[:, None, :] & ((rows >= 0) & (rows < cells))[:, :, None]
        rows, columns = np.clip(rows, 0, cells - 1)[:, :, None], np.clip(columns, 0, cells - 1)[:, None, :]
        heat = sigmoid(self.blazepose_inside.heat_logits[rows, columns, _REFINED[:, None, None]])
        channel = np.where(self.is_crossed, _OF_THUNDER[_OPPOSITE], _OF_THUNDER)
        other = sigmoid(self.thunder_inside.heat_logits[rows, columns, channel[:, None, None]])
        other = other * (_OF_THUNDER >= 0)[:, None, None]
        shown = np.concatenate(
            [
                self.blazepose_inside.fine[rows, columns], self.thunder_inside.features[rows, columns],
                heat[..., None], other[..., None],
            ],
            axis=-1,
        ) * is_inside[..., None]  # fmt: skip
        x, y = (at - first).astype(np.float32).T[:, :, None, None, None]
        between_columns = (1 - x) * shown[:, :, :-1] + x * shown[:, :, 1:]
        return np.asarray((1 - y) * between_columns[:, :-1] + y * between_columns[:, 1:], np.float32)

    def coarse(self) -> Float[Array, "22 96"]:
        """The features of the coarse cell in which each landmark lies, or of the nearest one."""
        column, row = np.clip((self.fused / _COARSE_CELL).astype(int), 0, 31).T
        return np.asarray(self.blazepose_inside.coarse[row, column])

    def numbers(self) -> Float[Array, "22 13"]:
        """What the networks say of each landmark, in numbers of about one."""
        apart, to_thunder = self.thunder - self.blazepose, self.thunder - self.fused
        from_middle = (self.fused - 128) / 64
        return np.column_stack([
            (self.blazepose - self.fused) / 8, to_thunder / 8, np.clip(to_thunder / 32, -2, 2), from_middle,
            self.visibility, self.score, np.log(self.sigma + 1e-4) / 2 + 2.5,
            np.linalg.norm(apart, axis=1) / 8, np.linalg.norm(from_middle, axis=1),
        ]).astype(np.float32)  # fmt: skip
