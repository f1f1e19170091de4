"""The plan of a clip in a real place: who, where, how it is filmed and cut. Seeded; says what it drew.

Places, motions and angles of cuts are not drawn at random: the clips of a set go through them in turn.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from humanmm.models.rendering.background_scene import BackgroundScene, Block, faces_of_block
from humanmm.models.rendering.places import figures, surfaces
from humanmm.models.rendering.places.cameras import (
    CAMERA_KINDS,
    PROBABILITIES,
    CameraKind,
    Lens,
    again,
    film_shot,
    fraction_in_view,
    holds,
)
from humanmm.models.rendering.places.features import CutKind, cuts_of, person_of, shot_of
from humanmm.models.rendering.places.furnishing import Ground
from humanmm.models.rendering.places.sites import HIGH, PLACES, build_place
from humanmm.models.rendering.places.takes import (
    AWAY_M,
    MOTIONS,
    Library,
    Performance,
    choose_take,
    chosen_frames,
    duration_s,
    perform,
    rotated,
)
from humanmm.models.rendering.script import MOST_HIDDEN, Change, Clip, ClipPlan, Shot, hidden_fraction
from humanmm.models.synthetic.mocap import Actor

Array = np.ndarray

SIZES = ((480, 270), (640, 360), (576, 324), (360, 480))
SIZE_PROBABILITIES = (0.3, 0.4, 0.2, 0.1)
RATES_HZ = (24.0, 25.0, 30000 / 1001, 30.0)
SHORTEST_SHOT_S = 1.1
GOLDEN = (math.sqrt(5) - 1) / 2
MATCH_CUT = 0.1
"""How often the last cut goes to another person in another place."""
CROWDED = 0.6
"""How often a place that may have a crowd has one."""
LOST_S = (0.04, 0.3)
JUMP_LOST_S = (0.15, 0.9)
LEAST_LOST = 3
"""Frames without which nobody sees a cut of a camera that stays."""
ANOTHER_CAMERA_M = 0.8


@dataclass(frozen=True)
class Cut:
    """One change of shot."""

    kind: CutKind
    lost_frames: int
    """Of the motion, which are not shown."""


@dataclass(frozen=True, eq=False)
class Edit:
    """A clip of one part, or of two whose people and places have nothing to do with each other."""

    parts: tuple[Clip, ...]
    features: Mapping[str, Any]
    """What the clip has, as json."""
    lost_s: tuple[float, ...]
    """Time lost at every cut."""


def plan_edit(library: Library, plan: ClipPlan, *, split: str = "") -> Edit:
    """Everything about a clip but its pixels; `split` is only written down."""
    rng = np.random.default_rng(plan.seed)
    number = plan.seed[-1]
    size = plan.size or SIZES[int(rng.choice(len(SIZES), p=SIZE_PROBABILITIES))]
    fps = RATES_HZ[int(rng.integers(len(RATES_HZ)))]
    view_deg = math.radians(rng.uniform(40, 75))
    lens = Lens(*size, max(size) / 2 / math.tan(view_deg / 2), fps)
    motion = MOTIONS[(3 * number + number // len(MOTIONS)) % len(MOTIONS)]
    place = tuple(PLACES)[number % len(PLACES)]
    take = choose_take(library, motion, rng, shortest_s=plan.seconds[0])
    cuts = _plan_cuts(plan, fps, rng)
    lost = sum(cut.lost_frames for cut in cuts)
    frames = int(min(rng.uniform(*plan.seconds) * fps, duration_s(take) * fps - lost - 1))
    cuts = cuts[: max(1, int(frames / fps / SHORTEST_SHOT_S) - 1)]
    lengths = _lengths(frames, len(cuts) + 1, int(SHORTEST_SHOT_S * fps), rng)
    match = len(cuts) if cuts[-1].kind == "match" else None
    firsts = slice(0, match)
    one = _part(library, plan, take, place, lens, lengths[firsts], cuts[: len(lengths[firsts]) - 1], number, rng)
    parts = [one]
    if match is not None:
        elsewhere = tuple(PLACES)[(number + 3) % len(PLACES)]
        parts.append(_part(library, plan, take, elsewhere, lens, lengths[match:], [], number, rng))
    clips = tuple(part[0] for part in parts)
    rate = int(rng.integers(31, 38)) if rng.random() < 0.35 else int(rng.integers(20, 29))
    shutter, noise = rng.uniform(0.15, 0.9), rng.uniform(0.5, 3.5)
    clips = tuple(replace(clip, crf=rate, shutter=shutter, noise=noise) for clip in clips)
    kinds = [kind for number, part in enumerate(parts) for kind in ["match"] * (number > 0) + part[1].pop("kinds")]
    features = {
        "split": split,
        "parts": [part[1] for part in parts],
        "cuts": cuts_of(clips, kinds, [cut.lost_frames / fps for cut in cuts]),
        "crf": rate,
        "shutter": round(shutter, 2),
        "noise": round(noise, 1),
    }
    return Edit(clips, features, tuple(cut.lost_frames / fps for cut in cuts))


def _plan_cuts(plan: ClipPlan, fps: float, rng: np.random.Generator) -> list[Cut]:
    cuts: list[Cut] = []
    count = int(rng.integers(plan.transitions[0], plan.transitions[1] + 1))
    for number in range(count):
        draw = rng.random()
        kind: CutKind = "angle"
        if number == count - 1 and rng.random() < MATCH_CUT:
            kind = "match"
        elif draw < 0.14:
            kind = "jump"
        elif draw < 0.32 and number > 0:
            kind = "return"
        seconds = 0.0 if rng.random() < 0.4 else rng.uniform(*LOST_S)
        if kind == "jump" and rng.random() < 0.7:
            seconds = rng.uniform(*JUMP_LOST_S)
        cuts.append(Cut(kind, 0 if kind == "match" else round(seconds * fps)))
    return cuts


def _lengths(frames: int, count: int, shortest: int, rng: np.random.Generator) -> list[int]:
    """Frames of every shot."""
    spare = max(0, frames - count * shortest)
    bounds = np.sort(rng.integers(0, spare + 1, count - 1))
    return [shortest + int(part) for part in np.diff([0, *bounds, spare])]


def _part(
    library: Library,
    plan: ClipPlan,
    take: Any,
    place: str,
    lens: Lens,
    lengths: Sequence[int],
    cuts: Sequence[Cut],
    number: int,
    rng: np.random.Generator,
) -> tuple[Clip, dict[str, Any]]:
    """The shots of one place, and what it has."""
    rows = _shown_rows(lengths, cuts)
    seconds = (rows[-1] + 1) / lens.fps
    cast = [perform(take, seconds, lens.fps, rng)]
    for _ in range(int(rng.choice([0, 1, 2], p=[0.62, 0.28, 0.1]))):
        other = choose_take(library, MOTIONS[int(rng.integers(len(MOTIONS)))], rng, shortest_s=2.0)
        placed = _beside(perform(other, seconds, lens.fps, rng), cast, rng)
        cast += [placed] if placed else []
    origin = cast[0].actor.joints[0, 0, :2]
    cast = [_shifted(one, -origin) for one in cast]
    actors = [chosen_frames(one.actor, rows) for one in cast]
    shots, kinds = _film_all(actors, lengths, cuts, place, lens, number, rng)
    passing = _passers_by(library, shots, actors, lens, rng)
    scene, near = _place(library, place, actors, passing, shots, rng)
    starts = np.cumsum([0, *lengths])
    clip = Clip(
        plan, lens.width, lens.height, lens.fps, (*actors, *passing), tuple(shots),
        tuple(Change("cut", int(at), int(at)) for at in starts[1:-1]), scene,
        shutter=0.5, noise=1.0, crf=23, texture_seed=(*plan.seed, 1, int(rng.integers(1 << 30))),
        subjects=len(actors), mesh="drawn", loose=float(rng.choice([1.0, 1.0, 2.2])),
    )  # fmt: skip
    figures_about = sum(panel.texture.image.shape[2] == 4 for panel in scene.cutouts)
    features = {
        "place": place,
        "people": [person_of(one) for one in cast],
        "passers_by": len(passing),
        "standing_about": figures_about,
        "near_objects": near,
        "loose_clothes": clip.loose > 1.0,
        "shots": [shot_of(shot) for shot in shots],
        "kinds": kinds,
    }
    return clip, features


def _shown_rows(lengths: Sequence[int], cuts: Sequence[Cut]) -> Array:
    """Which frames of the motion are shown: those that a cut loses are left out."""
    shown, at = [], 0
    for length, lost in zip(lengths, [*(cut.lost_frames for cut in cuts), 0], strict=True):
        shown.append(np.arange(at, at + length))
        at += length + lost
    return np.concatenate(shown)


def _beside(one: Performance, cast: Sequence[Performance], rng: np.random.Generator) -> Performance | None:
    """Near the first actor, clear of everybody; None if there is no room."""
    first = cast[0].actor.joints[:, 0, :2]
    middle = (first.min(axis=0) + first.max(axis=0)) / 2
    for _ in range(200):
        away = rng.uniform(0, 2 * np.pi)
        spot = middle + rng.uniform(0.7, 2.2) * np.array([np.cos(away), np.sin(away)])
        moved = rotated(one.actor, rng.uniform(0, 2 * np.pi), spot)
        gaps = [np.linalg.norm((moved.joints - other.actor.joints)[:, 0, :2], axis=1) for other in cast]
        if min(gap.min() for gap in gaps) > 0.75 and gaps[0].mean() < 2.6:
            return replace(one, actor=moved)
    return None


def _shifted(one: Performance, shift: Array) -> Performance:
    return replace(one, actor=replace(one.actor, joints=one.actor.joints + np.append(shift, 0.0)))


def _film_all(
    actors: list[Actor],
    lengths: Sequence[int],
    cuts: Sequence[Cut],
    place: str,
    lens: Lens,
    number: int,
    rng: np.random.Generator,
) -> tuple[list[Shot], list[CutKind]]:
    """A shot after the other, and what the cuts between them are in the end.

    Angles of the cuts of a set spread evenly over 0 to 180 degrees. A camera that lost the person would not return.
    """
    starts = np.cumsum([0, *lengths])
    azimuth = rng.uniform(0, 2 * np.pi)
    shots: list[Shot] = []
    kinds: list[CutKind] = []
    for k, (start, end) in enumerate(pairwise(starts)):
        span = (int(start), int(end))
        if k:
            repeated = _repeated(shots, cuts[k - 1], span, rng)
            kept = repeated is not None and fraction_in_view(actors[0].joints[slice(*span)], repeated, lens) > 0.7
            if repeated is not None and kept and holds([actors[0]], repeated, lens):
                shots.append(repeated)
                kinds.append(cuts[k - 1].kind)
                continue
            angle, kind = np.pi * ((0.5 + GOLDEN * (4 * number + k)) % 1.0), cuts[k - 1].kind
            if kind == "jump":
                angle = np.deg2rad(rng.uniform(8, 28))
            azimuth += angle * rng.choice([-1, 1])
            kinds.append("jump" if kind == "jump" else "angle")
        allowed = [one for one in CAMERA_KINDS if one != "drone" or place in HIGH]
        weights = np.array([p for one, p in zip(CAMERA_KINDS, PROBABILITIES, strict=True) if one in allowed])
        camera_kind: CameraKind = allowed[int(rng.choice(len(allowed), p=weights / weights.sum()))]
        shots.append(film_shot(actors, span, azimuth, camera_kind, lens, rng))
    return shots, kinds


def _repeated(shots: Sequence[Shot], cut: Cut, span: tuple[int, int], rng: np.random.Generator) -> Shot | None:
    """The camera of the shot before, with time lost or rotated a little, or one that the shot before did not have."""
    last = shots[-1]
    if cut.kind == "jump":
        yaw_deg = 0.0 if cut.lost_frames >= LEAST_LOST else rng.uniform(3, 7) * rng.choice([-1, 1])
        return again(last, span, rng, rotated_deg=yaw_deg)
    if cut.kind == "return":
        others = [
            shot
            for shot in shots[:-1]
            if np.linalg.norm(shot.t_world_cam[-1] - last.t_world_cam[-1]) > ANOTHER_CAMERA_M
        ]
        return again(others[-1], span, rng) if others else None
    return None


def _passers_by(
    library: Library, shots: Sequence[Shot], actors: Sequence[Actor], lens: Lens, rng: np.random.Generator
) -> list[Actor]:
    """People who walk through the picture, before the first actor or behind, each in one shot."""
    walks = [
        take
        for take in library.of("walk")
        if duration_s(take) >= 2.0 and np.ptp(take.pelvis[:, :2], axis=0).max() > 1.5
    ]
    passing: list[Actor] = []
    for shot in shots:
        if not walks or rng.random() > 0.3:
            continue
        take = walks[int(rng.integers(len(walks)))]
        n = shot.end - shot.start
        seconds = min(n / lens.fps, duration_s(take))
        walker = perform(take, seconds, lens.fps, rng).actor
        eye, chest = shot.t_world_cam[n // 2, :2], actors[0].joints[(shot.start + shot.end) // 2, 0, :2]
        fraction = rng.uniform(0.4, 0.65) if rng.random() < 0.4 else rng.uniform(1.3, 1.8)
        travel = walker.joints[-1, 0, :2] - walker.joints[0, 0, :2]
        across = (chest - eye)[::-1] * [1, -1] * rng.choice([-1, 1])
        yaw = np.arctan2(across[1], across[0]) - np.arctan2(travel[1], travel[0]) + rng.normal(0, 0.2)
        spot = eye + fraction * (chest - eye)
        moved = rotated(walker, float(yaw), spot)
        count = len(moved.joints)
        first = shot.start + (n - count) // 2
        rows = np.clip(np.arange(len(actors[0].joints)) - first, 0, count - 1)
        there = (np.arange(len(rows)) >= first) & (np.arange(len(rows)) < first + count)
        whole = chosen_frames(moved, rows)
        away = np.where(there, 0.0, -AWAY_M)[:, None, None] * np.array([0, 0, 1.0])
        near = [np.linalg.norm((whole.joints - one.joints)[there, 0, :2], axis=1).min() for one in actors]
        if min(near) > 0.7 and np.linalg.norm(whole.joints[there, 0, :2] - eye, axis=1).min() > 1.0:
            passing.append(replace(whole, joints=whole.joints + away))
    return passing


def _place(
    library: Library,
    place: str,
    actors: Sequence[Actor],
    passing: Sequence[Actor],
    shots: Sequence[Shot],
    rng: np.random.Generator,
) -> tuple[BackgroundScene, int]:
    """The place around them, and how many things stand beside the cameras' tracks."""
    everybody = np.concatenate([actor.joints[::4, 0] for actor in (*actors, *passing)])
    everybody = everybody[everybody[:, 2] > -AWAY_M / 2]
    eyes = np.concatenate([shot.t_world_cam[::5] for shot in shots])
    subject = actors[0].joints[:, 0, :2]
    clear = [] if rng.random() < 0.3 else [
        f * shot.t_world_cam[::8, :2] + (1 - f) * subject[shot.start : shot.end : 8]
        for shot in shots
        for f in (0.2, 0.4, 0.6, 0.8)
    ]  # fmt: skip
    walked = np.concatenate([everybody[:, :2], eyes[:, :2]])
    models = [
        figures.Model.dressed(perform(choose_take(library, kind, rng, shortest_s=2.0), 2.0, 10.0, rng).actor, rng)
        for kind in ("everyday", "dance", "kick")
    ]
    crowd = [] if rng.random() > CROWDED else [
        figures.cut_out(one, frame, rng) for one in models for frame in (3, 14)
    ]  # fmt: skip
    shown = [figures.picture(one, int(rng.integers(2, 18)), rng) for one in models]
    ground = Ground(np.concatenate([everybody, eyes]), np.concatenate([walked, *clear]), walked, crowd, shown)
    scene = build_place(place, ground, rng)
    scene, near = _with_near_objects(scene, shots, actors[0], rng)
    kept = [block for block in scene.blocks if hidden_fraction(block, actors[0], shots) < MOST_HIDDEN]
    return replace(scene, blocks=tuple(kept)), near


def _with_near_objects(
    scene: BackgroundScene, shots: Sequence[Shot], actor: Actor, rng: np.random.Generator
) -> tuple[BackgroundScene, int]:
    """Posts or plants close to the track of every camera that moves past objects."""
    blocks: list[Block] = []
    for shot in shots:
        if not shot.kind.startswith("past objects"):
            continue
        texture = surfaces.tiling(rng) if rng.random() < 0.5 else surfaces.bricks(rng)
        for fraction in rng.uniform(0.25, 0.5, 2):
            row = int(rng.integers(0, len(shot.t_world_cam)))
            eye, person = shot.t_world_cam[row, :2], actor.joints[shot.start + row, 0, :2]
            side = (person - eye)[::-1] * [1, -1] / np.linalg.norm(person - eye)
            spot = eye + fraction * (person - eye) + side * rng.uniform(0.5, 1.0) * rng.choice([-1, 1])
            half, height = np.array([rng.uniform(0.06, 0.2)] * 2), float(rng.uniform(0.7, 2.3))
            far = min(np.linalg.norm(s.t_world_cam[:, :2] - spot, axis=1).min() for s in shots)
            if far > 0.6 and np.linalg.norm(actor.joints[:, 0, :2] - spot, axis=1).min() > 0.7:
                faces = faces_of_block(spot, half, height, 0.3, texture, scene.light)
                blocks.append(Block(spot, half, height, 0.3, faces))
    return replace(scene, blocks=(*scene.blocks, *blocks)), len(blocks)
