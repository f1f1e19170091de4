"""What is rendered is what the truth says: joints, silhouettes, occlusion."""

from dataclasses import replace

import numpy as np

from humanmm.models.rendering.renderer import Frame, render_frames
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


def test_few_triangles_give_the_same_silhouettes(clip: Clip, rendered: dict[int, Frame]) -> None:
    coarse = next(iter(render_frames(replace(clip, mesh="drawn"))))
    for one, other in zip(coarse.masks, rendered[0].masks, strict=True):
        assert (one & other).sum() > 0.9 * (one | other).sum()


def test_the_blur_of_a_motion_ends_at_a_cut(clip: Clip) -> None:
    """Somebody who is elsewhere after the cut leaves no ghost before it."""
    cut = clip.changes[0].at
    people = []
    for actor in clip.actors:
        joints = actor.joints.copy()
        joints[cut:] += [0, 0, 50.0]
        people.append(replace(actor, joints=joints))
    moved = replace(clip, actors=tuple(people), shutter=0.9, mesh="drawn")
    for number, frame in enumerate(render_frames(moved)):
        if number == cut - 1:
            last = frame
        if number == cut:
            break
    assert last.masks.any(axis=(1, 2))[0]
    assert not frame.masks.any()
