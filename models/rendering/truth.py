"""The exact truth of a rendered clip, as arrays with motion.zarr's names."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.body.body24 import JOINT_NAMES, PARENTS, load_body
from humanmm.models.evaluation.truth import header_arrays
from humanmm.models.geometry.rotations import rotmat_to_rotvec
from humanmm.models.rendering.script import Clip, in_view

Array = np.ndarray

OBSERVED = 0.3
"""Least fraction of visible joints with which a person counts as observed."""


def person_order(boxes: Float[Array, "people F 4"]) -> list[int]:
    """Which actor is person 00, 01, …: the one with the largest summed box first."""
    area = np.prod(boxes[..., 2:] - boxes[..., :2], axis=-1).sum(axis=1)
    return [int(person) for person in np.argsort(-area, kind="stable")]


def truth_arrays(
    clip: Clip, joint_seen: Bool[Array, "F people 24"], boxes: Float[Array, "people F 4"]
) -> dict[str, Array]:
    """The arrays by name. The world's origin lies under the first pelvis of person 00; pixel centres are at .5."""
    order = person_order(boxes[: clip.subjects])
    origin = clip.actors[order[0]].joints[0, 0] * [1, 1, 0]
    shot_index = clip.shot_index()
    shots = [clip.shots[k] for k in shot_index]
    rows = np.arange(clip.num_frames) - [shot.start for shot in shots]
    cuts = [change.at for change in clip.changes]
    size = (clip.width, clip.height)
    arrays = {
        **header_arrays("humanmm.motion/1", JOINT_NAMES, clip.num_frames, cuts, clip.fps, size, PARENTS),
        "world": np.array("z-up, metres, first person's first pelvis above the origin, floor at z=0"),
        "body_model": np.array("body24"),
        "transitions": np.array([(change.start, change.end) for change in clip.changes], np.int32).reshape(-1, 2),
        "shot_kinds": np.array([shot.kind for shot in clip.shots]),
        "shot_index": shot_index.astype(np.int32),
        "cameras/K": np.stack([clip.K(shot, frame) for frame, shot in enumerate(shots)]),
        "cameras/R_world_cam": np.stack([shot.R_world_cam[row] for shot, row in zip(shots, rows, strict=True)]),
        "cameras/t_world_cam": np.stack([shot.t_world_cam[row] for shot, row in zip(shots, rows, strict=True)])
        - origin,
    }
    body = load_body()
    for rank, person in enumerate(order):
        actor, seen = clip.actors[person], joint_seen[:, person]
        pixels = np.empty((clip.num_frames, len(JOINT_NAMES), 2))
        for number, shot in enumerate(clip.shots):
            frames = np.flatnonzero(shot_index == number)
            where = slice(frames[0] - shot.start, frames[-1] + 1 - shot.start)
            pixels[frames], _ = in_view(actor.joints[frames], shot, where, size)
        visibility = seen.mean(axis=1)
        joints = actor.joints - origin
        values = {
            "frame": np.arange(clip.num_frames, dtype=np.int32),
            "observed": visibility >= OBSERVED,
            "root_orient": rotmat_to_rotvec(actor.R_world_root).astype(np.float32),
            "body_pose": actor.body_pose.astype(np.float32),
            "betas": actor.betas.astype(np.float32),
            "transl": (joints[:, 0] - body.rest_joints(actor.betas)[0]).astype(np.float32),
            "joints": joints.astype(np.float32),
            "contacts": actor.contacts.astype(np.float32),
            "keypoints2d": np.concatenate([pixels, seen[..., None]], axis=-1).astype(np.float32),
            "visibility": visibility.astype(np.float32),
            "bbox": boxes[person].astype(np.float32),
            "confidence": visibility.astype(np.float32),
        }
        arrays |= {f"people/{rank:02d}/{name}": value for name, value in values.items()}
    for rank, person in enumerate(range(len(order), len(clip.actors))):
        visibility = joint_seen[:, person].mean(axis=1)
        frames = np.flatnonzero(boxes[person].any(axis=1))
        values = {
            "frame": frames.astype(np.int32),
            "joints": (clip.actors[person].joints[frames] - origin).astype(np.float32),
            "visibility": visibility[frames].astype(np.float32),
            "bbox": boxes[person][frames].astype(np.float32),
        }
        arrays |= {f"passers_by/{rank:02d}/{name}": value for name, value in values.items()}
    return arrays


def joined(
    parts: Sequence[Mapping[str, Array]], *, lost_s: Sequence[float], features: Mapping[str, Any]
) -> dict[str, Array]:
    """The truth of a clip whose parts show different people in different places: each part has a world of its own.

    `linked` (T,) is true at cuts inside a part and false between parts.
    """
    whole = dict(parts[0])
    linked = [True] * len(parts[0]["cut_frames"])
    for part in parts[1:]:
        frames, shots = int(whole["num_frames"]), len(whole["shot_kinds"])
        counts = {
            kind: len({key.split("/")[1] for key in whole if key.startswith(f"{kind}/")}) for kind in _OF_SOME_FRAMES
        }
        linked += [False] + [True] * len(part["cut_frames"])
        first = np.array([frames], np.int32)
        whole["cut_frames"] = np.concatenate([whole["cut_frames"], first, part["cut_frames"] + frames]).astype(np.int32)
        spans = part["transitions"] + frames
        whole["transitions"] = np.concatenate([whole["transitions"], [[frames, frames]], spans]).astype(np.int32)
        whole["shot_index"] = np.concatenate([whole["shot_index"], part["shot_index"] + shots]).astype(np.int32)
        for name in ("shot_kinds", "cameras/K", "cameras/R_world_cam", "cameras/t_world_cam"):
            whole[name] = np.concatenate([whole[name], part[name]])
        whole["num_frames"] = np.array(frames + int(part["num_frames"]))
        whole["time_s"] = np.arange(int(whole["num_frames"])) / float(whole["fps"])
        for key, value in part.items():
            kind, *rest = key.split("/")
            if kind in _OF_SOME_FRAMES:
                shifted = value + np.int32(frames) if rest[1] == "frame" else value
                whole[f"{kind}/{int(rest[0]) + counts[kind]:02d}/{rest[1]}"] = shifted
    whole["linked"] = np.array(linked, bool)
    whole["lost_s"] = np.array(lost_s, np.float64)
    whole["features"] = np.array(json.dumps(features, ensure_ascii=False))
    return whole


_OF_SOME_FRAMES = ("people", "passers_by")
