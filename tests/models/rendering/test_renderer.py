"""What is rendered is what the truth says: joints, silhouettes, occlusion."""

import numpy as np

from humanmm.models.rendering.renderer import Frame
from humanmm.models.rendering.script import Clip, in_view


def test_visible_joints_lie_on_their_own_silhouette(clip: Clip, rendered: dict[int, Frame]) -> None:
    fractions = []
    for number, frame in rendered.items():
        for person, actor in enumerate(clip.actors):
            pixels, _ = in_view(actor.joints[[number]], clip.shots[0], slice(number, number + 1), (256, 144))
            seen = frame.joint_seen[person]
            x, y = np.clip(pixels[0, seen].astype(int).T, 0, [[255], [143]])
            fractions.append(frame.masks[person][y, x].mean())
    assert np.mean(fractions) > 0.95


def test_silhouettes_do_not_overlap(rendered: dict[int, Frame]) -> None:
    for frame in rendered.values():
        assert frame.masks.sum(axis=0).max() <= 1
        assert frame.masks.any(axis=(1, 2))[0]
