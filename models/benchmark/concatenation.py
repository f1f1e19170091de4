"""The baseline of the paper (section 4): shots recovered one by one, laid one after the other."""

from dataclasses import replace

import numpy as np

from humanmm.models.motion.rotations.shot_results import ShotResults
from humanmm.models.motion.world.align import align
from humanmm.models.records.motion import PersonMotion, WorldMotion

Array = np.ndarray


def concatenated(results: ShotResults) -> WorldMotion:
    """The paper's baseline: each shot in its own gravity world, headed by that shot's first camera; these worlds are
    taken for one without any rotation, and the root is shifted so that it goes on where the shot before ended."""
    alone = align(_strangers(results))
    num_people = max((person.person for person in results.shots.people), default=0) + 1
    parts: dict[int, list[PersonMotion]] = {}
    for motion in sorted(alone.people, key=lambda motion: int(motion.frame[0])):
        parts.setdefault(motion.person % num_people, []).append(motion)
    t_world_cam = alone.t_world_cam.copy()
    people = []
    for number, motions in sorted(parts.items()):
        joined = motions[0]
        for motion in motions[1:]:
            shift = joined.pelvis_world[-1] - motion.pelvis_world[0]
            if number == 0:
                shot = next(s for s in results.shots.shots if s.start <= motion.frame[0] < s.end)
                t_world_cam[shot.start : shot.end] += shift
            joined = _appended(joined, replace(motion, pelvis_world=motion.pelvis_world + shift))
        people.append(replace(joined, person=number))
    return replace(alone, people=tuple(people), t_world_cam=t_world_cam)


def _strangers(results: ShotResults) -> ShotResults:
    """The same results, with nobody known to be in more than one shot: every shot then gets a world of its own."""
    num_people = max((person.person for person in results.shots.people), default=0) + 1
    shots, motions = [], []
    for index, (shot, motion) in enumerate(zip(results.shots.shots, results.motions, strict=True)):
        first = index * num_people
        shots.append(replace(shot, people=tuple(replace(a, person=first + a.person) for a in shot.people)))
        people = motion.people if motion is not None else ()
        renamed = tuple(replace(person, person=first + person.person) for person in people)
        motions.append(replace(motion, people=renamed) if motion is not None else None)
    return replace(results, shots=replace(results.shots, shots=tuple(shots)), motions=motions)


def _appended(first: PersonMotion, second: PersonMotion) -> PersonMotion:
    """One motion after the other; frames between them keep the last posture and are not observed."""
    gap = int(second.frame[0] - first.frame[-1]) - 1

    def held(before: Array, after: Array) -> Array:
        return np.concatenate([before, np.repeat(before[-1:], gap, axis=0), after])

    return PersonMotion(
        person=first.person,
        frame=np.arange(first.frame[0], second.frame[-1] + 1, dtype=np.int32),
        observed=np.concatenate([first.observed, np.zeros(gap, bool), second.observed]),
        R_world_root=held(first.R_world_root, second.R_world_root),
        body_pose=held(first.body_pose, second.body_pose),
        betas=first.betas,
        pelvis_world=held(first.pelvis_world, second.pelvis_world),
        contacts=held(first.contacts, second.contacts),
        confidence=held(first.confidence, second.confidence),
    )
