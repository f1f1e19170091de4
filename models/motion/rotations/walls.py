"""What straight edges of the background say: where up is in each shot, and how two shots' cameras head apart.

Every shot that shows a built place has a Manhattan frame (`camera.background.manhattan`). Its vertical is a witness of
gravity that no pose of a body bends. Two shots of one place share the frame up to quarter turns: four hypotheses of the
rotation between them, each precise to a degree or two, between which people choose.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from humanmm.models.camera.background.manhattan import QUARTER_TURNS, ManhattanFrame, find_manhattan_frame
from humanmm.models.camera.background.segments import Segments
from humanmm.models.motion.rotations.levelling import UpDirection, vertical_of
from humanmm.models.motion.rotations.rotation_mixtures import (
    QUANTILE_68,
    RotationEdge,
    RotationHypothesis,
    compared,
)
from humanmm.models.motion.rotations.shot_results import ShotResults, camera_of

SURE, MARGIN_HALF = 0.93, 9.0
"""A frame of margin m is the right one with probability SURE / (1 + (MARGIN_HALF / m)⁴). Of 67 shots of development
clips the frames of those with margins below 6, from 6 to 10 and above were right in 1 of 4, 6 of 10 and 50 of 53."""
ONE_PLACE = 0.95
"""Probability that two shots that people or backgrounds connect show walls of one Manhattan frame."""
FRAME_SIGMA_DEG = 1.0
"""Error of a right frame besides what its segments say: focal length, lens, walls that are not at right angles."""
LEAST_PROBABILITY = 0.4
"""Frames that are less likely say nothing."""


@dataclass(frozen=True)
class ShotWalls:
    """A shot's Manhattan frame, and the probability that it is the right one."""

    frame: ManhattanFrame
    probability: float

    @property
    def sigma_deg(self) -> float:
        """Standard deviation of a rotation about one axis, if it is the right one."""
        return float(np.hypot(self.frame.sigma_deg, FRAME_SIGMA_DEG))

    @property
    def up(self) -> UpDirection:
        """Its vertical, shot axes."""
        return UpDirection(self.frame.up, self.sigma_deg)


def walls_of(results: ShotResults, standing: Mapping[int, list[UpDirection]]) -> dict[int, ShotWalls]:
    """By shot, the frames that are likely enough; `standing`: the shots that have a motion, with people's axes."""
    found = {}
    for shot, axes in standing.items():
        camera, key_frames = camera_of(results, shot), results.key_frames_of(shot)
        rows = [frame.frame - camera.start for frame in key_frames]
        if not rows:
            continue
        seen = Segments.of(
            [frame.segments for frame in key_frames], list(camera.K[rows]), list(camera.R_shot_cam[rows])
        )
        upright = vertical_of(camera, axes).upright
        frame = find_manhattan_frame(seen, upright.direction, upright.sigma_deg)
        if frame is None:
            continue
        probability = frame_probability(frame.margin)
        if probability >= LEAST_PROBABILITY:
            found[shot] = ShotWalls(frame, probability)
    return found


def frame_probability(margin: float) -> float:
    """That a Manhattan frame is the right one."""
    return SURE / (1 + (MARGIN_HALF / max(margin, 1e-3)) ** 4)


def wall_edges(walls: Mapping[int, ShotWalls]) -> list[RotationEdge]:
    """Four hypotheses of the rotation between any two shots that have frames; of many shots between those near in
    time."""
    edges = []
    for a, b in compared(sorted(walls)):
        first, second = walls[a], walls[b]
        probability = ONE_PLACE * first.probability * second.probability
        sigma_deg = QUANTILE_68 * float(np.hypot(first.sigma_deg, second.sigma_deg))
        hypotheses = tuple(
            RotationHypothesis(
                first.frame.R_axes_walls @ turn @ second.frame.R_axes_walls.T, sigma_deg, probability / 4, "walls"
            )
            for turn in QUARTER_TURNS
        )
        edges.append(RotationEdge(a, b, hypotheses, "walls", connects=False, pooled=True))
    return edges
