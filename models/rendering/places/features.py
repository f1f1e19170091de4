"""What a clip says of itself in its truth and in set.json, so that tables can be made by it."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from humanmm.models.body.body24 import load_body
from humanmm.models.geometry.rotations import rotation_angle
from humanmm.models.rendering.places.takes import Performance
from humanmm.models.rendering.script import Clip, Shot

CutKind = Literal["angle", "jump", "return", "match"]


def cuts_of(clips: Sequence[Clip], kinds: Sequence[CutKind], lost_s: Sequence[float]) -> list[dict[str, Any]]:
    """What every cut is: its frame, kind, true angle between the cameras, and the time that it loses."""
    described, before, k = [], 0, 0
    for number, clip in enumerate(clips):
        for place, shot in enumerate(clip.shots):
            if number or place:
                last = clip.shots[place - 1] if place else clips[number - 1].shots[-1]
                R = last.R_world_cam[-1].T @ shot.R_world_cam[0]
                linked = place > 0
                described.append(
                    {
                        "frame": before + shot.start,
                        "kind": kinds[k],
                        "angle_deg": round(float(np.rad2deg(rotation_angle(R))), 1) if linked else None,
                        "lost_s": round(lost_s[k], 3),
                        "linked": linked,
                    }
                )
                k += 1
        before += clip.num_frames
    return described


def person_of(one: Performance) -> dict[str, Any]:
    """Whose motion of which class, on what body."""
    height = float(np.ptp(load_body().rest_vertices(one.actor.betas)[:, 1]))
    return {
        "motion": one.motion, "take": one.take, "subject": one.subject, "body": one.body, "height_m": round(height, 2),
    }  # fmt: skip


def shot_of(shot: Shot) -> dict[str, Any]:
    """The camera, its mean height and the brightness of its picture."""
    height, gain = float(shot.t_world_cam[:, 2].mean()), float(shot.gain.mean())
    return {"camera": shot.kind, "height_m": round(height, 2), "gain": round(gain, 2)}
