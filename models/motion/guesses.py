"""How sure a recording is of what no picture shows by itself: where the floor is, and who is who across cuts.

The uncertainty of the focal length is that of its estimate (`camera.intrinsics`), the scale is that of the bodies
(`HEIGHT_ERROR`).
"""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.body.body24 import load_body
from humanmm.models.motion.assemble import world_joints
from humanmm.models.motion.refine.contacts import STANDS
from humanmm.models.motion.refine.refine import FEWEST_STANDING, sole_heights
from humanmm.models.records.landmarks import INDEX, VISIBLE
from humanmm.models.records.motion import PersonMotion, WorldMotion
from humanmm.models.records.recording import CONTACT_JOINTS, Guesses, IdentityGuess, OffFloor, RecordedPerson, Recording
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.shots.identity import identity_answers
from humanmm.models.video.frame_times import shown_s

Array = np.ndarray
FURNITURE_M = 0.5
"""Soles farther from the floor stand on something else."""
OFF_FLOOR_M, OFF_FLOOR_S = 0.12, 0.25
"""Whose soles stand so far from the floor for so long is misplaced, or stands on something. Of 125 people of rendered
clips (`standard` 2811, 3611, 3711, `places` 2812, 3712) 16 do; of these one truly stands on something."""
FOOT_LANDMARKS = tuple(INDEX[f"{side}_{name}"] for side in ("left", "right") for name in ("ankle", "foot_index"))
"""Where each of `CONTACT_JOINTS` is seen."""


def guesses_of(
    shot_list: ShotList,
    scenes: Sequence[ScenePeople | None],
    aligned: WorldMotion,
    recording: Recording,
    *,
    time_s: Float[Array, " F"],
) -> Guesses:
    """What a recording guesses; `aligned`: the world before feet are put on the floor (stage `align`).

    `scenes`: what the detector saw, one a scene, None where it failed.
    """
    witnesses = shot_list.witnesses(person.person for person in aligned.people)
    recorded = {person.person: person for person in recording.people}
    soles = standing_soles([person for person in aligned.people if person.person in witnesses], recorded)
    low, high = np.percentile(soles, (16, 84)) if len(soles) >= FEWEST_STANDING else (np.nan, np.nan)
    return Guesses(
        floor_m=float(high - low) / 2,
        standing_soles=len(soles),
        identities=tuple(identity_guesses(shot_list, scenes, time_s=time_s)),
        off_floor=tuple(one for one in (off_floor(person, time_s) for person in recording.people) if one is not None),
    )


def standing_soles(people: Sequence[PersonMotion], recorded: Mapping[int, RecordedPerson]) -> Float[Array, " n"]:
    """Heights above z = 0 of all soles that are seen and stand near the floor, metres; `recorded`: the same people by
    their numbers."""
    body, found = load_body(), [np.zeros(0)]
    for person in people:
        heights = _soles_m(world_joints(person, body.rest_joints(person.betas)), person.betas)
        found.append(heights[(person.contacts >= STANDS) & seen_soles(recorded[person.person])])
    soles = np.concatenate(found)
    return np.asarray(soles[np.abs(soles) < FURNITURE_M])


def _soles_m(joints: Float[Array, "N 24 3"], betas: Float[Array, " 10"]) -> Float[Array, "N 4"]:
    """Heights of the four soles above z = 0, metres."""
    return np.asarray(joints[:, list(CONTACT_JOINTS), 2] - sole_heights(load_body(), betas))


def seen_soles(person: RecordedPerson) -> Bool[Array, "N 4"]:
    """Which of the four soles the pose network sees: legs that are out of the picture say nothing about the floor."""
    return np.asarray(person.observed[:, None] & (person.keypoints2d[:, list(FOOT_LANDMARKS), 2] >= VISIBLE))


def off_floor(person: RecordedPerson, time_s: Float[Array, " F"]) -> OffFloor | None:
    """Where somebody's soles are seen to stand, and not on the floor."""
    heights = _soles_m(person.joints, person.betas)
    stands = (person.contacts >= STANDS) & seen_soles(person)
    off = stands & (np.abs(heights) > OFF_FLOOR_M) & (np.abs(heights) < FURNITURE_M)
    frames = person.frame[off.any(axis=1)]
    if not len(frames) or shown_s(time_s, frames).sum() < OFF_FLOOR_S:
        return None
    return OffFloor(person.person, int(frames[0]), int(frames[-1]) + 1, float(np.median(heights[off])))


def identity_guesses(
    shot_list: ShotList, scenes: Sequence[ScenePeople | None], *, time_s: Float[Array, " F"]
) -> list[IdentityGuess]:
    """For everybody in each shot after the first in which anybody is seen: how sure it is that he is who he is said to
    be."""
    found = identity_answers(shot_list.shots, scenes, time_s)
    return [IdentityGuess(person, shot, one.probability, one.other) for (person, shot), one in found.items()]
