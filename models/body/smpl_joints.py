"""Joints of SMPL parameters, for truths that come without joints; the model is the user's own and never shipped.

SMPL's joints are J(β) = J_regressor (v_template + shapedirs β), posed by forward kinematics; transl moves the pelvis
from J₀(β) (Loper et al. 2015, equations 6 and 10, without pose-dependent blend shapes, which move no joint).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.rotations import rotvec_to_rotmat

SMPL_REST_PELVIS = np.array([-0.0018, -0.2233, 0.0282])
SMPLX_REST_PELVIS = np.array([0.00312326, -0.35140747, 0.01203655])
"""Pelvis joint of the neutral bodies of SMPL and SMPL-X with zero betas about their origins, metres, as published with
the models: the pelvis is `transl` plus this, whatever the rotation of the root."""


@dataclass(frozen=True)
class SmplJoints:
    """The part of an SMPL model that places joints."""

    J_template: Float[np.ndarray, "24 3"]
    J_shapedirs: Float[np.ndarray, "24 3 10"]

    @classmethod
    def of_mesh(
        cls,
        regressor: Float[np.ndarray, "24 V"],
        vertices: Float[np.ndarray, "V 3"],
        shapedirs: Float[np.ndarray, "V 3 10"],
    ) -> "SmplJoints":
        """From a model's J_regressor, v_template and shapedirs."""
        return cls(regressor @ vertices, np.einsum("jv,vab->jab", regressor, shapedirs))

    def posed(
        self,
        root_orient: Float[np.ndarray, "F 3"],
        body_pose: Float[np.ndarray, "F 69"],
        betas: Float[np.ndarray, "10"],
        transl: Float[np.ndarray, "F 3"],
    ) -> Float[np.ndarray, "F 24 3"]:
        """Joints in the axes of the parameters, metres."""
        rest = self.J_template + self.J_shapedirs @ betas
        R_root = rotvec_to_rotmat(root_orient)
        return forward_kinematics(rest, R_root, body_pose.reshape(-1, 23, 3), transl + rest[0])[0]
