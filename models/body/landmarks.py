"""Where the 33 BlazePose landmarks sit on body24: each rides on one joint with a fixed offset in that joint's axes.

In space they sit where the lifter was taught to put them (`load_landmarks`), in the picture where the pose networks do
(`load_keypoints`).

A landmark of the face, hands or feet is a point of the skin: the mean of the mesh vertices nearest to a point of the
template named here by its anatomy, so that it moves with the shape. Shoulders, elbows, wrists, hips, knees and ankles
are body24's own joints.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.body.body24 import JOINT_NAMES, Body, load_body
from humanmm.models.records.landmarks import NUM_LANDMARKS, SWAP

Array = np.ndarray

_JOINTS = {
    11: "L_Shoulder", 12: "R_Shoulder", 13: "L_Elbow", 14: "R_Elbow", 15: "L_Wrist", 16: "R_Wrist",
    23: "L_Hip", 24: "R_Hip", 25: "L_Knee", 26: "R_Knee", 27: "L_Ankle", 28: "R_Ankle",
}  # fmt: skip

_SKIN = {
    0: ("Head", (0.0, 0.661, 0.157), 6),  # nose: its tip
    1: ("Head", (0.018, 0.697, 0.124), 8),  # left eye: inner corner,
    2: ("Head", (0.031, 0.700, 0.131), 8),  # middle,
    3: ("Head", (0.046, 0.697, 0.113), 8),  # outer corner
    7: ("Head", (0.078, 0.680, 0.040), 8),  # left ear: tragus
    9: ("Head", (0.025, 0.628, 0.134), 8),  # left corner of the mouth
    17: ("L_Wrist", (0.792, 0.440, -0.026), 16),  # left little finger: knuckle at its base
    19: ("L_Wrist", (0.802, 0.455, 0.040), 16),  # left index finger: knuckle at its base
    21: ("L_Wrist", (0.775, 0.445, 0.085), 16),  # left thumb: its middle knuckle
    29: ("L_Ankle", (0.155, -0.915, -0.070), 8),  # left heel: back of the sole
    31: ("L_Foot", (0.145, -0.930, 0.178), 8),  # left foot index: tips of first and second toe
}
"""Landmark -> joint it rides on, position on the template (metres), number of nearest vertices averaged.

Middle and left side; the right side is the mirror picture (x → −x).
"""

Shifts = dict[int, tuple[int, int, int]]
"""Of the landmarks of the middle and the left side, less where anatomy has them, in the joint's axes, mm."""

_LANDMARK_SHIFT_MM: Shifts = {
    0: (0, 9, -20), 1: (-4, 3, -8), 2: (-6, -1, -18), 3: (-11, 3, -6), 7: (-24, 4, 19), 9: (-8, 8, -18),
    11: (-15, 0, 12), 13: (3, 6, 12), 15: (18, 0, 9), 17: (-12, 9, 22), 19: (-8, 2, -21), 21: (-5, 5, -53),
    23: (-16, -31, 17), 25: (8, -12, -13), 27: (2, 28, 7), 29: (-8, 15, 21), 31: (21, 7, -39),
}  # fmt: skip
"""Where BlazePose full puts them, and with it the truth that the lifter was taught: hips lower and further in than the
joint centres, ankles higher, thumbs and toes shorter.

Measured on renderings of body24 (130 random shapes, clothes, views and training sequences of motion capture; robust
least squares of the 2D residuals, left and right averaged).
"""
_KEYPOINT_SHIFT_MM: Shifts = _LANDMARK_SHIFT_MM | {
    0: (0, 20, -14), 1: (-3, 14, -10), 2: (-4, 9, -22), 3: (-8, 13, -9), 7: (-18, 12, 10), 9: (-7, 17, -13),
    11: (-24, 12, 3), 13: (-1, 10, 14), 23: (-5, -28, 20), 25: (5, 3, -6), 27: (7, 21, 4), 29: (1, 5, 10),
    31: (-11, 9, -14),
}  # fmt: skip
"""Where BlazePose heavy's heat maps and Thunder together (`perception.keypoints.fusion`) put them: shoulders and faces
10 mm higher than BlazePose full alone. Wrists and hands are those above: on real people these fit.

Faces, shoulders and hips were measured in the same way on 6,218 tracked people of 120 rendered development clips
before heat maps were read, elbows, knees, ankles and feet on 1,093 of 23 since (scripts/measure_keypoints;
docs/measurements/perception.md). The others moved by up to 12 mm; bodies were not better with new ones.
"""


@dataclass(frozen=True, eq=False)
class LandmarkModel:
    """Landmark = joint position + R_joint @ offset; the offset is linear in the shape."""

    joint: Int[Array, " 33"]
    offset_template: Float[Array, "33 3"]
    offset_shapedirs: Float[Array, "B 33 3"]

    def offsets(self, betas: Float[Array, " B"]) -> Float[Array, "33 3"]:
        """Offsets of one shape in the axes of the joints, metres."""
        return self.offset_template + np.tensordot(np.asarray(betas, np.float64), self.offset_shapedirs, axes=1)

    def place(
        self, betas: Float[Array, " B"], joints: Float[Array, "frames 24 3"], R: Float[Array, "frames 24 3 3"]
    ) -> Float[Array, "frames 33 3"]:
        """Landmark positions of a posed body, in the frame of `joints` and `R` (see `kinematics`)."""
        return np.asarray(joints[:, self.joint] + np.einsum("nkab,kb->nka", R[:, self.joint], self.offsets(betas)))


@lru_cache(maxsize=1)
def load_landmarks() -> LandmarkModel:
    """The shipped body's landmarks as the lifter has them in space."""
    return landmark_model(load_body(), _LANDMARK_SHIFT_MM)


@lru_cache(maxsize=1)
def load_keypoints() -> LandmarkModel:
    """The shipped body's landmarks as the shipped pose networks see them in the picture."""
    return landmark_model(load_body(), _KEYPOINT_SHIFT_MM)


def landmark_model(body: Body, shifts_mm: Shifts) -> LandmarkModel:
    """Landmarks of a body: skin points from its mesh, the others at its joints, each shifted."""
    joint = np.zeros(NUM_LANDMARKS, np.int64)
    template = np.zeros((NUM_LANDMARKS, 3))
    shapedirs = np.zeros((body.num_betas, NUM_LANDMARKS, 3))
    for landmark, name in _JOINTS.items():
        joint[landmark] = JOINT_NAMES.index(name)
    for left, (name, place, count) in _SKIN.items():
        for landmark, sign in {left: 1.0, SWAP[left]: 1.0 if SWAP[left] == left else -1.0}.items():
            side_name = name if landmark == left else name.replace("L_", "R_")
            j = joint[landmark] = JOINT_NAMES.index(side_name)
            distance = np.linalg.norm(body.v_template - np.array(place) * (sign, 1, 1), axis=1)
            nearest = np.sort(np.argpartition(distance, count)[:count])
            template[landmark] = body.v_template[nearest].mean(0) - body.J_template[j]
            shapedirs[:, landmark] = body.shapedirs[:, nearest].mean(1) - body.J_shapedirs[:, j]
    for left, shift_mm in shifts_mm.items():
        for landmark, sign in {left: 1, SWAP[left]: 1 if SWAP[left] == left else -1}.items():
            template[landmark] += np.array(shift_mm) * (sign, 1, 1) / 1000
    return LandmarkModel(joint, template, shapedirs)
