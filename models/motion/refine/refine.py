"""One motion over all shots (paper section 3.4): no discontinuities, no gaps, smooth, feet on one floor.

In order: the poses of neighbouring shots are made one at the cut; rotations are smoothed and gaps filled in; feet that
stand are found, and the floor is put under them; the body is fitted once more to the evidence of all shots together,
with those feet held, and with the root's velocity as the trajectory networks read it from the limbs; then they are
found again and locked by inverse kinematics. Cameras keep their rotations; their centres move with the floor and the
origin alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from jaxtyping import Float

from humanmm.config import RefineConfig
from humanmm.machine import single_threaded
from humanmm.models.body.body24 import NUM_JOINTS, Body, load_body
from humanmm.models.body.kinematics import by_chunks
from humanmm.models.geometry.projection import inverse_pose
from humanmm.models.geometry.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from humanmm.models.motion.fit.evidence import LongEvidence, person_skeleton
from humanmm.models.motion.fit.state import CameraPath, LongMotion
from humanmm.models.motion.networks.interfaces import MotionNetworks
from humanmm.models.motion.refine.contacts import STANDS, ContactModel, contact_probabilities
from humanmm.models.motion.refine.discontinuities import close_discontinuities
from humanmm.models.motion.refine.fit import fit_world, gather_clip
from humanmm.models.motion.refine.footlock import LockSettings, contact_positions, lock_feet
from humanmm.models.motion.refine.gaps import landed, landings
from humanmm.models.motion.refine.learned import Learned
from humanmm.models.motion.refine.smoothing import smooth, smooth_rotations
from humanmm.models.motion.refine.toes import bent_toes, toe_length
from humanmm.models.motion.refine.worlds import WorldMembers, members_of
from humanmm.models.records.motion import PersonMotion, WorldMotion
from humanmm.models.records.recording import CONTACT_JOINTS
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.video.progress import Progress, parts_of, silent
from humanmm.parts import load

Array = np.ndarray

FLOOR_NEAR_M = 0.10
"""Standing soles this near to the floor found so far say where it really is; others stand on something."""

FILL_HZ = 12.0
"""Band limit of what fills a gap after the fit: it meets the frames beside it almost exactly."""

FEWEST_STANDING = 10
"""Fewer soles and frames than this say nothing about the floor."""


@dataclass(frozen=True)
class RefineSettings:
    """What can be set, and what can be left out (for ablations)."""

    cutoff_hz: float = 8.0
    remove_discontinuities: bool = True
    refit: bool = True
    foot_lock: bool = True
    floor_m: float = 0.0
    """How much higher the floor is than the standing feet say, metres; the user knows."""
    networks: MotionNetworks | None = None
    """What they say of the root's velocity, and of poses if they correct these, has a part in the fit; None: the
    shipped networks of the trajectory."""
    contacts: ContactModel = field(default_factory=ContactModel)
    lock: LockSettings = field(default_factory=LockSettings)

    @classmethod
    def chosen(cls, config: RefineConfig, *, floor_m: float = 0.0) -> "RefineSettings":
        """Those of the user's configuration; `floor_m` comes from his corrections, and is 0 without any."""
        return cls(
            cutoff_hz=config.cutoff_hz,
            remove_discontinuities=config.remove_discontinuities,
            refit=config.refit,
            foot_lock=config.foot_lock,
            networks=load("refine.networks", config.networks),
            floor_m=floor_m,
        )


@dataclass(frozen=True)
class Observations:
    """What was seen, for the fit over the whole clip."""

    shots: ShotList
    scenes: Sequence[ScenePeople | None]
    """One a scene; None where it failed."""


def refine(
    world: WorldMotion,
    shots: ShotList,
    people: Sequence[ScenePeople | None],
    *,
    time_s: Float[Array, " F"],
    settings: RefineSettings | None = None,
    progress: Progress = silent,
) -> WorldMotion:
    """One smooth motion over all shots: contacts, planted feet, filled gaps; floor at z = 0.

    `people`: what was seen, one a scene, None where it failed; `time_s`: times of all frames of the video, seconds.
    """
    cut_frames = tuple(shot.start for shot in shots.shots[1:])
    seen = Observations(shots, people)
    return refine_world(world, seen, time_s=time_s, cut_frames=cut_frames, settings=settings, progress=progress)


@single_threaded
def refine_world(
    world: WorldMotion,
    observations: Observations | None,
    *,
    time_s: Float[Array, " F"],
    cut_frames: tuple[int, ...],
    settings: RefineSettings | None = None,
    progress: Progress = silent,
) -> WorldMotion:
    """All people refined; in every world the floor at z = 0, its first person's first pelvis above the origin.

    Without observations the motion is not fitted again, and all is taken for one world.
    """
    if not world.people:
        return world
    settings = settings or RefineSettings()
    members = members_of(world, observations.shots if observations is not None else None)
    drafts = {
        person.person: draft(person, world, time_s[person.frame], cut_frames=cut_frames, settings=settings)
        for person in world.people
        if person.observed.any()
    }
    rise = {}
    for number in set(members.of_person.values()):
        own = {person: one for person, one in drafts.items() if members.of_person[person] == number}
        rise[number] = floor_height(_on_floor(own, observations)) + settings.floor_m
    people = []
    parts = parts_of(progress, len(time_s), [len(person.frame) for person in world.people])
    for person, part in zip(world.people, parts, strict=True):
        one = drafts.pop(person.person, None)
        if one is None:
            people.append(person)
            continue
        one = one.raised(-rise[members.of_person[person.person]])
        if observations is not None and settings.refit:
            clip = gather_clip(
                person.person,
                person.frame,
                shots=observations.shots,
                scenes=observations.scenes,
                time_s=time_s,
                K=world.K,
            )
            if clip is not None:
                learned = one.learned(settings.networks or _shipped_networks(), cut_frames)
                one = one.fitted(clip, learned, floor_m=-settings.floor_m, progress=part)
                one = one.with_contacts(settings.contacts)
        people.append(finish(one, settings=settings))
    sunk = members.each_frame({number: np.array([0.0, 0.0, by]) for number, by in rise.items()})
    return at_origin(replace(world, people=tuple(people), t_world_cam=world.t_world_cam - sunk), members)


def _on_floor(drafts: Mapping[int, "Draft"], observations: Observations | None) -> list["Draft"]:
    """Those by whose feet the floor is found."""
    witnesses = drafts.keys() if observations is None else observations.shots.witnesses(drafts)
    return [one for person, one in drafts.items() if person in witnesses]


def _shipped_networks() -> MotionNetworks:
    from humanmm.models.motion.networks.integrate import trajectory  # only now: torch takes two seconds to import

    return trajectory


@dataclass(frozen=True, eq=False)
class Draft:
    """One person between two steps: smooth poses without gaps, and feet that stand."""

    person: PersonMotion
    time_s: Float[Array, " N"]
    camera_centre: Float[Array, "N 3"]
    R_world_cam: Float[Array, "N 3 3"]
    K: Float[Array, "N 3 3"]
    sole_height: Float[Array, " 4"]
    motion: LongMotion
    feet: Float[Array, "N 4 3"]
    """Positions of `CONTACT_JOINTS`."""
    contacts: Float[Array, "N 4"]

    @property
    def soles(self) -> Float[Array, "N 4"]:
        """Heights of the soles above z = 0."""
        return np.asarray(self.feet[..., 2] - self.sole_height)

    def raised(self, by: float) -> "Draft":
        """The same in a world whose floor is lower by so much."""
        up = np.array([0.0, 0.0, by])
        return replace(
            self,
            camera_centre=self.camera_centre + up,
            motion=replace(self.motion, pelvis_ref=self.motion.pelvis_ref + up),
            feet=self.feet + up,
        )

    def with_contacts(self, model: ContactModel) -> "Draft":
        """Contacts found on the motion as it is now."""
        sight = self.motion.pelvis_ref - self.camera_centre
        found = contact_probabilities(
            self.feet,
            self.sole_height,
            time_s=self.time_s,
            ray=sight / np.maximum(np.linalg.norm(sight, axis=-1, keepdims=True), 1e-6),
            observed=self.person.observed,
            model=model,
        )
        return replace(self, contacts=found)

    def learned(self, networks: MotionNetworks, cut_frames: tuple[int, ...]) -> Learned:
        """The networks, ready for this person."""
        shot = np.searchsorted(np.array(cut_frames, int), self.person.frame, side="right")
        confidence = np.clip(self.person.confidence, 0.0, 1.0)
        return Learned(networks, self.time_s, self.person.observed, confidence, shot)

    def fitted(
        self, clip: LongEvidence, learned: Learned, *, floor_m: float = 0.0, progress: Progress = silent
    ) -> "Draft":
        """Fitted once more to the evidence of all shots, standing feet at the height `floor_m`; frames without any are
        filled in again."""
        camera = CameraPath(*inverse_pose(self.R_world_cam, self.camera_centre), self.K)
        seen, found = self.person.observed, learned.read(self.motion)
        terms = partial(learned.terms, found)
        standing = self.sole_height + floor_m
        motion = fit_world(
            self.motion,
            self.person.betas,
            clip.believed(seen),
            camera,
            self.contacts,
            standing,
            learned=terms,
            progress=progress,
        )
        if not seen.all():
            on_feet = landings(seen, self.contacts, self.time_s)
            vectors, pelvis, weight = landed(motion.vectors, motion.pelvis_ref, seen * 1.0, on_feet)
            motion.vectors[~seen] = smooth_rotations(vectors, weight, self.time_s, cutoff_hz=FILL_HZ)[~seen]
            motion.pelvis_ref[~seen] = smooth(pelvis, weight, self.time_s, cutoff_hz=FILL_HZ)[~seen]
        if found is not None and found.rotations is not None:
            motion = learned.corrected(motion)
        return replace(self, motion=motion, feet=contact_positions(motion))


def draft(
    person: PersonMotion,
    world: WorldMotion,
    time_s: Float[Array, " N"],
    *,
    cut_frames: tuple[int, ...],
    settings: RefineSettings,
) -> Draft:
    """Discontinuities at cuts closed, rotations smoothed, gaps filled, feet that stand found once."""
    vectors = np.empty((len(person.frame), NUM_JOINTS, 3), np.float32)
    vectors[:, 0], vectors[:, 1:] = by_chunks(rotmat_to_rotvec, person.R_world_root), person.body_pose
    if settings.remove_discontinuities:
        vectors = close_discontinuities(
            vectors, frame=person.frame, observed=person.observed, time_s=time_s, cut_frames=cut_frames
        )
    weight = np.where(person.observed, np.clip(person.confidence, 0.05, 1.0), 0.0)
    motion = LongMotion(
        person_skeleton(person.betas),
        smooth_rotations(vectors, weight, time_s, cutoff_hz=settings.cutoff_hz),
        smooth(person.pelvis_world, weight, time_s, cutoff_hz=settings.cutoff_hz),
    )
    frames = slice(int(person.frame[0]), int(person.frame[-1]) + 1)
    one = Draft(
        person=person,
        time_s=time_s,
        camera_centre=world.t_world_cam[frames],
        R_world_cam=world.R_world_cam[frames],
        K=world.K[frames],
        sole_height=sole_heights(load_body(), person.betas),
        motion=motion,
        feet=contact_positions(motion),
        contacts=np.zeros((len(time_s), 4)),
    ).with_contacts(settings.contacts)
    found = landings(person.observed, one.contacts, time_s)
    if not found:
        return one
    vectors, pelvis, weight = landed(vectors, person.pelvis_world, weight, found)
    motion = LongMotion(
        motion.skeleton,
        smooth_rotations(vectors, weight, time_s, cutoff_hz=settings.cutoff_hz),
        smooth(pelvis, weight, time_s, cutoff_hz=settings.cutoff_hz),
    )
    return replace(one, motion=motion, feet=contact_positions(motion)).with_contacts(settings.contacts)


def finish(one: Draft, *, settings: RefineSettings) -> PersonMotion:
    """Feet locked, and their toes on the floor."""
    motion = one.motion
    if settings.foot_lock:
        motion = lock_feet(motion, one.contacts, one.sole_height, time_s=one.time_s, settings=settings.lock)
        motion = bent_toes(motion, one.sole_height, toe_length(load_body(), one.person.betas), one.time_s)
    return replace(
        one.person,
        R_world_root=by_chunks(rotvec_to_rotmat, motion.vectors[:, 0]),
        body_pose=motion.vectors[:, 1:],
        pelvis_world=motion.pelvis_ref,
        contacts=one.contacts.astype(np.float32),
    )


def floor_height(drafts: Sequence[Draft]) -> float:
    """Height of the floor under the standing feet, metres: the median of the soles that stand near z = 0."""
    soles = np.concatenate([one.soles[one.contacts >= STANDS] for one in drafts] or [np.zeros(0)])
    floor = 0.0
    for _ in range(2):
        near = soles[np.abs(soles - floor) < FLOOR_NEAR_M]
        if len(near) < FEWEST_STANDING:
            return floor
        floor = float(np.median(near))
    return floor


def sole_heights(body: Body, betas: Float[Array, " 10"]) -> Float[Array, " 4"]:
    """Height above the ground of left ankle, left toe base, right ankle, right toe base of the rest pose, metres."""
    ground = float(body.rest_vertices(betas)[:, 1].min())
    return np.asarray(body.rest_joints(betas)[list(CONTACT_JOINTS), 1] - ground)


def at_origin(world: WorldMotion, members: WorldMembers) -> WorldMotion:
    """The same, the origin of each world under its first person's first pelvis."""
    shift: dict[int, Array] = {}
    for person in world.people:
        shift.setdefault(members.of_person[person.person], person.pelvis_world[0] * [1.0, 1.0, 0.0])
    people = tuple(
        replace(person, pelvis_world=person.pelvis_world - shift[members.of_person[person.person]])
        for person in world.people
    )
    return replace(world, people=people, t_world_cam=world.t_world_cam - members.each_frame(shift))
