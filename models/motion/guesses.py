"""How sure a recording is of what no picture shows by itself: where the floor is, and who is who across cuts.

The uncertainty of the focal length is that of its estimate (`camera.intrinsics`), the scale is that of the bodies
(`HEIGHT_ERROR`).
"""

from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import load_body
from humanmm.models.motion.assemble import world_joints
from humanmm.models.motion.refine.refine import FEWEST_STANDING, sole_heights
from humanmm.models.records.motion import PersonMotion, WorldMotion
from humanmm.models.records.recording import CONTACT_JOINTS, Guesses, IdentityGuess
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.shots.identity import identity_probabilities

Array = np.ndarray
STANDING = 0.5
"""Probability from which a sole stands on something."""
FURNITURE_M = 0.5
"""Soles farther from the floor stand on something else."""


def guesses_of(
    shot_list: ShotList, scenes: Sequence[ScenePeople | None], aligned: WorldMotion, *, time_s: Float[Array, " F"]
) -> Guesses:
    """What a recording guesses; `aligned`: the world before feet are put on the floor (stage `align`).

    `scenes`: what the detector saw, one a scene, None where it failed.
    """
    witnesses = shot_list.witnesses(person.person for person in aligned.people)
    soles = standing_soles([person for person in aligned.people if person.person in witnesses])
    low, high = np.percentile(soles, (16, 84)) if len(soles) >= FEWEST_STANDING else (np.nan, np.nan)
    return Guesses(
        floor_m=float(high - low) / 2,
        standing_soles=len(soles),
        identities=tuple(identity_guesses(shot_list, scenes, time_s=time_s)),
    )


def standing_soles(people: Iterable[PersonMotion]) -> Float[Array, " n"]:
    """Heights above z = 0 of all observed soles that stand near the floor, metres."""
    body, found = load_body(), [np.zeros(0)]
    for person in people:
        joints = world_joints(person, body.rest_joints(person.betas))
        heights = joints[:, list(CONTACT_JOINTS), 2] - sole_heights(body, person.betas)
        found.append(heights[(person.contacts >= STANDING) & person.observed[:, None]])
    soles = np.concatenate(found)
    return np.asarray(soles[np.abs(soles) < FURNITURE_M])


def identity_guesses(
    shot_list: ShotList, scenes: Sequence[ScenePeople | None], *, time_s: Float[Array, " F"]
) -> list[IdentityGuess]:
    """For everybody in each shot after the first in which anybody is seen: how sure it is that he is who he is said to
    be."""
    found = identity_probabilities(shot_list.shots, scenes, time_s)
    return [IdentityGuess(person, shot, probability) for (person, shot), probability in found.items()]
