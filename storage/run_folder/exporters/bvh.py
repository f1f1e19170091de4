"""Biovision's hierarchy (BVH): one person's own skeleton, and its rotations frame by frame in degrees.

A file begins with the person's first frame and has no place to say which one that is: exports.json says it. The root's
offset is zero, and its position stands in its channels, because readers disagree about their sum.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import Body
from humanmm.models.body.fingers import NUM_BODY_JOINTS, body_of
from humanmm.models.body.kinematics import chunks
from humanmm.models.geometry.rotations import unit
from humanmm.models.motion.excerpt import Excerpt
from humanmm.models.records.recording import RecordedPerson

_TIPS = {"Head": (0, 1, 0), "L_Foot": (0, 0, 1), "R_Foot": (0, 0, 1), "L_Hand": (1, 0, 0), "R_Hand": (-1, 0, 0)}
"""Direction from the last joint of a limb to its end, in the axes of the body; a finger goes on as it is."""


def write_bvh(excerpt: Excerpt, person: RecordedPerson, path: Path) -> None:
    """One person as bvh: the pelvis' position and every joint's angles about z, x, y, in this order (R = Rz Rx Ry)."""
    body, rest = body_of(person), excerpt.rest_joints(person)
    offsets = np.array([rest[j] - rest[parent] if j else np.zeros(3) for j, parent in enumerate(body.parents)])
    order = list(_depth_first(body, 0))
    num_frames = len(person.frame)
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("\n".join(["HIERARCHY", *_joint_lines(body, 0, offsets, _tips(excerpt, person), 0)]))
        file.write(f"\nMOTION\nFrames: {num_frames}\nFrame Time: {1 / excerpt.fps:.9f}\n")
        angles = np.zeros(3 * len(order))
        for rows in chunks(num_frames):
            zxy = euler_zxy_deg(excerpt.local_rotations(person, rows)[:, order])
            positions = excerpt.points(person.pelvis[rows])
            for row in range(len(zxy)):
                angles = nearest_angles(zxy[row], angles.reshape(-1, 3)).reshape(-1)
                file.write(" ".join(f"{value:.6f}" for value in (*positions[row], *angles)) + "\n")


def euler_zxy_deg(R: Float[np.ndarray, "*n 3 3"]) -> Float[np.ndarray, "*n 3"]:
    """Angles a, b, c with R = Rz(a) Rx(b) Ry(c), degrees, b in −90..90; where b is ±90, c is zero."""
    cosine = np.hypot(R[..., 2, 0], R[..., 2, 2])
    locked = cosine < 1e-7
    b = np.arctan2(R[..., 2, 1], cosine)
    a = np.where(locked, np.arctan2(R[..., 1, 0], R[..., 0, 0]), np.arctan2(-R[..., 0, 1], R[..., 1, 1]))
    c = np.where(locked, 0.0, np.arctan2(-R[..., 2, 0], R[..., 2, 2]))
    return np.asarray(np.rad2deg(np.stack([a, b, c], axis=-1)))


def nearest_angles(zxy: Float[np.ndarray, "n 3"], before: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """The angles of the same rotations that are nearest to those before: curves without jumps, where there is a choice.

    (a, b, c) and (a + 180, 180 − b, c + 180) are one rotation, and so is every angle with a full turn more or less.
    """
    both = np.stack([zxy, zxy * (1, -1, 1) + 180])
    both += 360 * np.round((before - both) / 360)
    better = np.abs(both - before).sum(-1).argmin(0)
    return np.asarray(both[better, np.arange(len(zxy))])


def _depth_first(body: Body, joint: int) -> Iterator[int]:
    yield joint
    for child, parent in enumerate(body.parents):
        if parent == joint:
            yield from _depth_first(body, child)


def _joint_lines(body: Body, joint: int, offsets: np.ndarray, tips: dict[int, np.ndarray], depth: int) -> Iterator[str]:
    indent = "\t" * depth
    channels = "Zrotation Xrotation Yrotation"
    yield f"{indent}{'JOINT' if depth else 'ROOT'} {body.joint_names[joint]}"
    yield f"{indent}{{"
    yield f"{indent}\tOFFSET {_numbers(offsets[joint])}"
    yield f"{indent}\tCHANNELS " + (f"3 {channels}" if depth else f"6 Xposition Yposition Zposition {channels}")
    for child in (child for child, parent in enumerate(body.parents) if parent == joint):
        yield from _joint_lines(body, child, offsets, tips, depth + 1)
    if joint in tips:
        yield from (
            f"{indent}\tEnd Site",
            f"{indent}\t{{",
            f"{indent}\t\tOFFSET {_numbers(tips[joint])}",
            f"{indent}\t}}",
        )
    yield f"{indent}}}"


def _tips(excerpt: Excerpt, person: RecordedPerson) -> dict[int, np.ndarray]:
    """From each last joint to the furthest point of its skin along the limb."""
    body = body_of(person)
    vertices, joints = body.rest_vertices(person.betas), body.rest_joints(person.betas)
    owner = body.skin_joint[np.arange(len(vertices)), body.skin_weight.argmax(axis=1)]
    directions = {j: np.array(_TIPS[name]) for j, name in enumerate(body.joint_names) if name in _TIPS}
    last_of_fingers = range(NUM_BODY_JOINTS + 2, len(joints), 3) if person.hand_pose is not None else ()
    directions |= {j: unit(joints[j] - joints[j - 1]) for j in last_of_fingers}
    tips = {}
    for joint, direction in directions.items():
        reach = ((vertices[owner == joint] - joints[joint]) @ direction).max()
        tips[joint] = excerpt.scale * excerpt.R_file_body @ (reach * direction)
    return tips


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{value:.6f}" for value in values)
