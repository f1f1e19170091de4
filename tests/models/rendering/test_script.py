"""Plans of clips: repeatable, the person in view, changes of shot where the truth says."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.rendering.actors import NEAREST_M
from humanmm.models.rendering.script import CLEAR_M, Clip, ClipPlan, in_view, plan_clip
from humanmm.models.synthetic.mocap import MocapSequence, resample

PLAN = ClipPlan("plan", (0, 0), seconds=(3.0, 4.0))


@pytest.fixture(scope="module")
def clips(sequences: tuple[MocapSequence, ...]) -> list[Clip]:
    return [plan_clip(sequences, replace(PLAN, seed=(1, seed))) for seed in range(10)]


def test_the_same_seed_plans_the_same_clip_and_another_seed_another(sequences: tuple[MocapSequence, ...]) -> None:
    one, same, other = (plan_clip(sequences, replace(PLAN, seed=(0, k))) for k in (1, 1, 2))
    assert np.array_equal(one.shots[0].t_world_cam, same.shots[0].t_world_cam)
    assert one.changes == same.changes
    assert one.actors[0].joints.shape != other.actors[0].joints.shape or not np.array_equal(
        one.actors[0].joints, other.actors[0].joints
    )


def test_every_shot_holds_the_first_person_and_no_camera_runs_into_anybody(clips: list[Clip]) -> None:
    held = []
    for clip in clips:
        for shot in clip.shots:
            rows = slice(shot.start, shot.end)
            pixels, depth = in_view(clip.actors[0].joints[rows], shot, slice(None), (clip.width, clip.height))
            held.append(((pixels > 0) & (pixels < (clip.width, clip.height))).all(-1).mean())
            gaps = [np.linalg.norm((a.joints[rows, 0] - shot.t_world_cam)[:, :2], axis=1).min() for a in clip.actors]
            assert min(gaps) > 0.8 * CLEAR_M
            assert depth.min() > 0
    assert np.mean(np.array(held) > 0.8) > 0.9


def test_people_do_not_walk_through_each_other(clips: list[Clip]) -> None:
    counts = []
    for clip in clips:
        counts.append(len(clip.actors))
        roots = np.stack([actor.joints[:, 0, :2] for actor in clip.actors])
        for i in range(len(roots)):
            for j in range(i):
                assert np.linalg.norm(roots[i] - roots[j], axis=1).min() > NEAREST_M
    assert max(counts) > 1


def test_shots_meet_at_a_cut_and_overlap_in_a_dissolve(clips: list[Clip]) -> None:
    kinds = set()
    for clip in clips:
        for change, before, after in zip(clip.changes, clip.shots[:-1], clip.shots[1:], strict=True):
            kinds.add(change.type)
            assert (after.start, before.end) == (change.start, change.end)
            assert (change.start == change.end) == (change.type == "cut")
            assert clip.shot_index()[change.at] == clip.shot_index()[change.at - 1] + 1
    assert kinds == {"cut", "dissolve"}


def test_a_sequence_at_its_own_rate_stays_as_it_is(sequences: tuple[MocapSequence, ...]) -> None:
    sequence = sequences[0].cropped(0, 40)
    again = resample(sequence, 0.0, 40, sequence.fps)
    assert np.allclose(again.pelvis, sequence.pelvis)
    assert np.allclose(again.R_world_root, sequence.R_world_root, atol=1e-9)


def test_too_short_takes_are_reported(sequences: tuple[MocapSequence, ...]) -> None:
    with pytest.raises(ValueError, match="no sequence is as long"):
        plan_clip(sequences, replace(PLAN, seconds=(60.0, 61.0)))
