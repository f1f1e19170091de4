"""What an evaluation compares: a motion with its cameras and cuts, whoever made it.

World: z up, metres. Camera: x right, y down, z forward. Names R_a_b map b to a.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int


class UndefinedFigureError(ValueError):
    """A figure cannot be had from these sequences; the message says why, in a clause."""


@dataclass(frozen=True)
class BodyParameters:
    """One person's body model parameters over N frames."""

    model: str
    root_orient: Float[np.ndarray, "frames 3"]
    """Axis-angle, body to world."""
    body_pose: Float[np.ndarray, "frames 23 3"]
    betas: Float[np.ndarray, "10"]
    transl: Float[np.ndarray, "frames 3"]


@dataclass(frozen=True)
class PersonSequence:
    """One person; N frames, strictly increasing. Joints are NaN where they are not known."""

    person: int
    frame: Int[np.ndarray, "frames"]
    observed: Bool[np.ndarray, "frames"]
    joints: Float[np.ndarray, "frames joints 3"]
    """World, metres, named by MotionSequence.joint_names."""
    R_world_root: Float[np.ndarray, "frames 3 3"] | None = None
    """Pelvis (body) axes to world; None: to be had from hips and shoulders."""
    contacts: Float[np.ndarray, "frames 4"] | None = None
    """Probability: left ankle, left toe base, right ankle, right toe base."""
    bbox_xyxy: Float[np.ndarray, "frames 4"] | None = None
    """Source pixels."""
    body: BodyParameters | None = None


@dataclass(frozen=True)
class CameraSequence:
    """The camera of every frame of the video; NaN where it is not known."""

    R_world_cam: Float[np.ndarray, "frames 3 3"]
    t_world_cam: Float[np.ndarray, "frames 3"]
    K: Float[np.ndarray, "frames 3 3"]


@dataclass(frozen=True)
class MotionSequence:
    """One video's people, cameras and cuts: a truth or a prediction."""

    num_frames: int
    fps: float
    joint_names: tuple[str, ...]
    people: tuple[PersonSequence, ...]
    transitions: tuple[tuple[int, int], ...]
    """[start, end) of every change of shot, in order; a hard cut has start == end == first frame of the new shot."""
    cameras: CameraSequence | None = None
    notes: tuple[str, ...] = ()
    """Sentences about what was left out on reading."""
    unlinked_cuts: tuple[int, ...] = ()
    """First frames of shots that show other people in another place: nothing joins them to the shot before."""

    @property
    def cut_frames(self) -> tuple[int, ...]:
        """First frame of each new shot."""
        return tuple((start + end) // 2 for start, end in self.transitions)

    @property
    def shots(self) -> tuple[tuple[int, int], ...]:
        """[start, end) of every shot."""
        starts = [0, *self.cut_frames]
        return tuple(zip(starts, [*starts[1:], self.num_frames], strict=True))

    @property
    def shots_outside_transitions(self) -> tuple[tuple[int, int], ...]:
        """[start, end) of every shot without the frames that show another one too."""
        starts = [0, *(end for _, end in self.transitions)]
        return tuple(zip(starts, [*(start for start, _ in self.transitions), self.num_frames], strict=True))


def part_of(sequence: MotionSequence, start: int, end: int) -> MotionSequence:
    """Frames [start, end) of a sequence, which lie within one shot, as a sequence of its own; everybody stays in it."""
    people = tuple(_rows_of(person, start, end) for person in sequence.people)
    cameras = sequence.cameras
    if cameras is not None:
        cameras = CameraSequence(*(of[start:end] for of in (cameras.R_world_cam, cameras.t_world_cam, cameras.K)))
    return MotionSequence(end - start, sequence.fps, sequence.joint_names, people, (), cameras)


def _rows_of(person: PersonSequence, start: int, end: int) -> PersonSequence:
    rows = slice(*np.searchsorted(person.frame, [start, end]))
    R, contacts, bbox, body = person.R_world_root, person.contacts, person.bbox_xyxy, person.body
    return replace(
        person,
        frame=person.frame[rows] - start,
        observed=person.observed[rows],
        joints=person.joints[rows],
        R_world_root=None if R is None else R[rows],
        contacts=None if contacts is None else contacts[rows],
        bbox_xyxy=None if bbox is None else bbox[rows],
        body=None
        if body is None
        else replace(
            body, root_orient=body.root_orient[rows], body_pose=body.body_pose[rows], transl=body.transl[rows]
        ),
    )
