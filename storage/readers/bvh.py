"""Reads motion capture in Biovision's BVH with the joints of ReActIdle, and turns it into a pack.

Rest poses of both skeletons are T-poses that face +z with y up, so every joint of body24 takes the world rotation of
the joint that it corresponds to. Bones that change their length (ReActIdle's have positions in every frame) do not.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from humanmm.errors import InputError
from humanmm.models.body.body24 import JOINT_NAMES, NUM_JOINTS, PARENTS
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.records.recording import CONTACT_JOINTS

Array = np.ndarray

SOURCES = {
    "Pelvis": "pelvis", "Spine1": "spine", "Spine2": "spine", "Spine3": "spine.001", "Neck": "neck", "Head": "face",
    "Collar": "shoulder", "Shoulder": "upper_arm", "Elbow": "forearm", "Wrist": "forearm", "Hand": "forearm",
    "Hip": "thigh", "Knee": "shin", "Ankle": "foot", "Foot": "foot",
}  # fmt: skip
"""body24's joints, without L_ and R_, and ReActIdle's, without .L and .R."""
STANDING_MS = 0.25
_LEGS = ("thigh.L", "shin.L", "foot.L")


@dataclass(frozen=True)
class BvhMotion:
    """One file: rotations of all joints in the world, y up, as the file's metres."""

    fps: float
    names: tuple[str, ...]
    R_world_joint: Float[Array, "N J 3 3"]
    pelvis: Float[Array, "N 3"]
    leg_m: float
    """Thigh and shank."""


def parse_bvh(text: str) -> BvhMotion:
    """A file's motion. InputError if it is no BVH with a rotation at every joint."""
    head, _, body = text.partition("MOTION")
    tokens = re.findall(r"(ROOT|JOINT|End Site|OFFSET|CHANNELS|\{|\})[ \t]*([^\n{}]*)", head)
    names: list[str] = []
    parents: list[int] = []
    offsets: list[Array] = []
    channels: list[list[str]] = []
    stack: list[int] = []
    in_end = False
    for word, rest in tokens:
        if word in ("ROOT", "JOINT"):
            parents.append(stack[-1] if stack else -1)
            stack.append(len(names))
            names.append(rest.strip())
        elif word == "End Site":
            in_end = True
        elif word == "OFFSET" and not in_end:
            offsets.append(np.array(rest.split(), float))
        elif word == "CHANNELS":
            channels.append(rest.split()[1:])
        elif word == "}":
            if in_end:
                in_end = False
            else:
                stack.pop()
    found = re.search(r"Frames:\s*(\d+)\s*Frame Time:\s*([\d.]+)\s*(.*)", body, re.DOTALL)
    if not found or not len(names) == len(offsets) == len(channels) > 0:
        raise InputError("no BVH: it lacks a hierarchy with channels, or its frames")
    count, width = int(found[1]), sum(map(len, channels))
    values = np.array(found[3].split(), float)
    if len(values) != count * width:
        raise InputError(f"{len(values)} numbers for {count} frames with {width} channels")
    rows = values.reshape(count, width)
    R, position, at = np.empty((count, len(names), 3, 3)), offsets[0], 0
    for joint, own in enumerate(channels):
        turns = [at + k for k, name in enumerate(own) if name.endswith("rotation")]
        order = "".join(name[0] for name in own if name.endswith("rotation"))
        if joint == 0:
            position = offsets[0] + rows[:, [at + k for k, name in enumerate(own) if name.endswith("position")]]
        local = Rotation.from_euler(order, rows[:, turns], degrees=True).as_matrix()
        R[:, joint] = local if parents[joint] < 0 else R[:, parents[joint]] @ local
        at += len(own)
    legs = [names.index(name) for name in _LEGS if name in names]
    leg_m = float(sum(np.linalg.norm(offsets[joint]) for joint in legs[1:]))
    return BvhMotion(1 / float(found[2]), tuple(names), R, position, leg_m)


def pack_arrays(motion: BvhMotion, rest_joints: Float[Array, "24 3"], leg_m: float) -> Mapping[str, Array]:
    """poses, trans and contacts of a pack, on a skeleton with legs of this length (thigh and shank)."""
    R = np.stack([motion.R_world_joint[:, motion.names.index(_source(name))] for name in JOINT_NAMES], axis=1)
    local = [R[:, 0], *(np.swapaxes(R[:, PARENTS[j]], 1, 2) @ R[:, j] for j in range(1, NUM_JOINTS))]
    poses = np.concatenate([rotmat_to_rotvec(one) for one in local], axis=1)
    trans = motion.pelvis * (leg_m / motion.leg_m)
    pose = poses.reshape(-1, NUM_JOINTS, 3)
    joints, _ = forward_kinematics(rest_joints, rotvec_to_rotmat(pose[:, 0]), pose[:, 1:], trans)
    feet = joints[:, list(CONTACT_JOINTS)]
    speed = np.linalg.norm(np.gradient(feet, axis=0), axis=-1) * motion.fps
    near = feet[..., 1] < np.median(feet[..., 1], axis=0) + 0.04
    return {"poses": poses, "trans": trans, "contacts": (speed < STANDING_MS) & near}


def _source(joint: str) -> str:
    side, _, name = joint.rpartition("_")
    return SOURCES[name] + (f".{side}" if side else "")
