"""Who moves how in a clip: takes of motion capture and routines by what they show, on bodies of all sizes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.body.body24 import Body, load_body
from humanmm.models.body.kinematics import skinning_transforms
from humanmm.models.drawing.surface import dense_weights, load_drawn_mesh
from humanmm.models.rendering.actors import with_contacts
from humanmm.models.synthetic.choreography import KINDS, choreography
from humanmm.models.synthetic.mocap import Actor, MocapSequence, pose_actor, random_shape, resample

Array = np.ndarray

MOTIONS = ("kick", "walk", "spin", "floor", "dance", "jump", "everyday", "acrobatics")
BODIES = ("adult", "tall", "short", "heavy", "child")
BODY_PROBABILITIES = (0.5, 0.12, 0.12, 0.14, 0.12)
ROUTINES = 2
"""So many takes of a class are shown as often as routines: few takes are not shown again and again."""
AWAY_M = 5000.0
"""Who is not in the scene is so far below it."""

_ROUTINE = "routine: "
_KINDS_OF_TAKES = (
    ("acrobatics", r"cartwheel|handstand"),
    ("floor", r"crawl|lie\b|lieto|tolie|liedown|liet2|sit|ground"),
    ("kick", r"kick|martial|punch|sword|box(ing)?\b|form|extended|roundhouse|strike"),
    ("dance", r"dance|salsa|charleston|lambada|pirouette|jete"),
    ("jump", r"jump|hop|leap|skip|bounce"),
    ("spin", r"spin|turnaround|turn around"),
    ("walk", r"walk|run|dribble|sidestep|advance|retreat"),
)
"""Classes of takes by their name or description; what fits none is `everyday`."""
_PROPS = "climb|hang|stool|ladder|playground|steps|uneven"
"""What is done with things that are not drawn."""


@dataclass(frozen=True)
class Performance:
    """What one actor does."""

    motion: str
    take: str
    subject: str
    """Whose motion it is; nobody's if it is a routine."""
    body: str
    actor: Actor


@dataclass(frozen=True)
class Library:
    """The takes of one split, by class of motion."""

    takes: tuple[MocapSequence, ...]

    def of(self, motion: str) -> list[MocapSequence]:
        """The takes that show a class of motion on an empty floor."""
        return [take for take in self.takes if motion_of(take) == motion and not re.search(_PROPS, take.action.lower())]


def motion_of(take: MocapSequence) -> str:
    """The class of a take."""
    if take.name.startswith(_ROUTINE):
        return take.name.removeprefix(_ROUTINE)
    text = f"{take.name} {take.action}".lower()
    return next((kind for kind, pattern in _KINDS_OF_TAKES if re.search(pattern, text)), "everyday")


def choose_take(library: Library, motion: str, rng: np.random.Generator, *, shortest_s: float) -> MocapSequence:
    """A captured take of a class of motion, or a routine where there is none, or by chance."""
    fits = [take for take in library.of(motion) if duration_s(take) >= shortest_s]
    if fits and (motion not in KINDS or rng.random() < len(fits) / (len(fits) + ROUTINES)):
        return fits[int(rng.integers(len(fits)))]
    kind = motion if motion in KINDS else KINDS[int(rng.integers(len(KINDS)))]
    return choreography(kind, f"{_ROUTINE}{kind}", 12.0, rng)


def perform(
    take: MocapSequence, seconds: float, fps: float, rng: np.random.Generator, *, body: str | None = None
) -> Performance:
    """Somebody who moves like a part of the take; a take that is too short is played there and back."""
    if duration_s(take) < seconds:
        take = _there_and_back(take, seconds)
    start = rng.uniform(0, max(0.0, duration_s(take) - seconds))
    part = resample(take, start, round(seconds * fps), fps)
    chosen = body or random_body(rng)
    actor = on_the_floor(pose_actor(part, rng, betas=shape(chosen, rng)), fps)
    return Performance(motion_of(take), take.name, take.subject or "nobody", chosen, actor)


def duration_s(take: MocapSequence) -> float:
    """From the first frame to the last."""
    return (take.num_frames - 1) / take.fps


def random_body(rng: np.random.Generator) -> str:
    """A kind of body, as often as it is among people who are filmed."""
    return BODIES[int(rng.choice(len(BODIES), p=BODY_PROBABILITIES))]


def shape(body: str, rng: np.random.Generator) -> Float[Array, " 10"]:
    """Shape components of a kind of body."""
    betas = random_shape(load_body(), rng)
    if body == "adult":
        return betas
    ranges = {"tall": (0.6, 1.0), "short": (-0.95, -0.6), "child": (-1.9, -1.2), "heavy": (-0.4, 0.5)}
    betas[0] = rng.uniform(*ranges[body])
    if body == "heavy":
        betas[[1, 3]], betas[4] = rng.uniform(-2.0, -1.4, 2), rng.uniform(1.4, 2.0)
    return betas


def _there_and_back(take: MocapSequence, seconds: float) -> MocapSequence:
    """The take forwards and backwards until it is long enough."""
    order = np.concatenate([np.arange(take.num_frames), np.arange(take.num_frames - 2, 0, -1)])
    rows = np.tile(order, int(np.ceil((seconds * take.fps + 2) / len(order))))
    return replace(
        take, R_world_root=take.R_world_root[rows], body_pose=take.body_pose[rows], pelvis=take.pelvis[rows],
        contacts=take.contacts[rows],
    )  # fmt: skip


def on_the_floor(actor: Actor, fps: float) -> Actor:
    """The actor lifted where its skin would be below the floor, with contacts of its own."""
    body = load_body()
    low = lowest_point(actor, body)
    raised = np.maximum(0.0, -low)
    return with_contacts(replace(actor, joints=actor.joints + raised[:, None, None] * [0, 0, 1]), fps)


def lowest_point(actor: Actor, body: Body) -> Float[Array, " N"]:
    """Height of the lowest vertex in every frame, metres."""
    kept = load_drawn_mesh().vertices
    rest, weights = body.rest_vertices(actor.betas)[kept], dense_weights(body, kept)
    transforms = skinning_transforms(body.rest_joints(actor.betas), actor.joints, actor.R_world_joint)
    lowest = np.empty(len(transforms))
    for frame, T in enumerate(transforms):
        rows = (weights @ T.reshape(24, 12)[:, 8:12]).astype(np.float64)
        lowest[frame] = ((rows[:, :3] * rest).sum(axis=1) + rows[:, 3]).min()
    return lowest


def rotated(actor: Actor, yaw: float, middle: Float[Array, "2"]) -> Actor:
    """The actor rotated about the vertical, the middle of its path at a point of the floor."""
    c, s = np.cos(yaw), np.sin(yaw)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    joints = actor.joints @ R.T
    shift = np.append(middle - (joints[:, 0, :2].min(axis=0) + joints[:, 0, :2].max(axis=0)) / 2, 0.0)
    return replace(
        actor, R_world_root=R @ actor.R_world_root, joints=joints + shift, R_world_joint=R @ actor.R_world_joint
    )


def chosen_frames(actor: Actor, rows: Sequence[int] | Array) -> Actor:
    """Only some frames: what is between them was not filmed."""
    return replace(
        actor,
        R_world_root=actor.R_world_root[rows],
        body_pose=actor.body_pose[rows],
        joints=actor.joints[rows],
        R_world_joint=actor.R_world_joint[rows],
        contacts=actor.contacts[rows],
    )
