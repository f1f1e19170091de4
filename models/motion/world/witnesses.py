"""What speaks for the rotations of all shots, and the rotations that it gives together.

First what needs no vertical: people at cuts, where they stand to one another, backgrounds, walls. Where up is decides
where a shadow falls and how a floor looks from above: all shots have said first where it is, then these speak too.
"""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.cuts.camera_rotation import CutMethod
from humanmm.models.motion.rotations.floors import ALIKE_TILES, floor_edges
from humanmm.models.motion.rotations.levelling import ShotVertical, standing_axes, upright_together, vertical_of
from humanmm.models.motion.rotations.positions import position_edge
from humanmm.models.motion.rotations.rotation_mixtures import RotationEdge, Upright
from humanmm.models.motion.rotations.shadows import light_edges, shot_lights
from humanmm.models.motion.rotations.shot_graph import (
    ALIKE_WALLS,
    BackgroundEdges,
    CutEdge,
    background_edges,
    cut_edge,
    people_edges,
    with_alike,
)
from humanmm.models.motion.rotations.shot_results import ShotResults, camera_of, usable
from humanmm.models.motion.rotations.shot_rotations import ShotRotations, solve_rotations
from humanmm.models.motion.rotations.walls import wall_edges, walls_of
from humanmm.models.shots.identity import identity_answers
from humanmm.models.video.progress import Progress

Array = np.ndarray

WITNESSES = frozenset({"people", "positions", "background", "walls", "shadows", "floors"})
"""What may speak for a camera's rotation between two shots: bodies seen on both sides, where people stand to one
another, a background that both show, the straight edges of built places, the shadows that people cast, the floor."""


@dataclass(frozen=True)
class FoundRotations:
    """The rotations of all shots, and the part of their evidence that the positions need as well."""

    cuts: tuple[CutEdge, ...]
    """What people say at each cut before a usable shot."""
    background: BackgroundEdges
    verticals: Mapping[int, ShotVertical]
    """Of every usable shot."""
    rotations: ShotRotations


def find_rotations(
    results: ShotResults,
    method: CutMethod,
    known_rotations: Mapping[int, Float[Array, "3 3"]],
    witnesses: Set[str],
    progress: Progress,
) -> FoundRotations:
    """The rotations of all shots by these witnesses; see `align`."""
    cuts = _cut_edges(results, method, known_rotations, progress)
    background = background_edges(results) if "background" in witnesses else BackgroundEdges((), ())
    num_shots = len(results.shots.shots)
    standing = {shot: standing_axes(results, shot) for shot in range(num_shots) if usable(results, shot)}
    walls = walls_of(results, standing) if "walls" in witnesses else {}
    verticals = {
        shot: vertical_of(camera_of(results, shot), axes, walls[shot].up if shot in walls else None)
        for shot, axes in standing.items()
    }
    upright = [verticals[shot].upright if shot in verticals else None for shot in range(num_shots)]
    spoken = [
        *_edges_of_people(results, cuts, verticals, witnesses),
        *with_alike(background.edges, upright, ALIKE_WALLS, "another wall"),
        *wall_edges(walls),
    ]
    rotations = solve_rotations(num_shots, spoken, upright)
    on_ground = _edges_on_ground(results, rotations, verticals, upright, witnesses)
    if on_ground:
        rotations = solve_rotations(num_shots, [*spoken, *on_ground], upright)
    return FoundRotations(cuts, background, verticals, rotations)


def _cut_edges(
    results: ShotResults, method: CutMethod, known_rotations: Mapping[int, Float[Array, "3 3"]], progress: Progress
) -> tuple[CutEdge, ...]:
    """What people say at each cut before a usable shot."""
    edges = []
    for later, shot in enumerate(results.shots.shots):
        if later > 0 and usable(results, later):
            edges.append(cut_edge(results, later, method, known_rotations))
            progress(shot.start, len(results.time_s))
    return tuple(edges)


def _edges_of_people(
    results: ShotResults, cuts: Sequence[CutEdge], verticals: Mapping[int, ShotVertical], witnesses: Set[str]
) -> list[RotationEdge]:
    """By people seen on both sides of a cut (silent where they are no witnesses: they connect shots all the same), and
    by where they stand to one another."""
    linked = [edge for edge in cuts if edge.cut.linked]
    answers = identity_answers(results.shots.shots, results.scenes, results.time_s)
    identities = {who: answer.probability for who, answer in answers.items()}
    from_people = [one for edge in linked for one in people_edges(results, edge, identities)]
    if "people" not in witnesses:
        from_people = [edge.silent() for edge in from_people]
    if "positions" not in witnesses:
        return from_people
    placed = (position_edge(results, edge.earlier, edge.later, verticals, identities) for edge in linked)
    return [*from_people, *(edge for edge in placed if edge is not None)]


def _edges_on_ground(
    results: ShotResults,
    rotations: ShotRotations,
    verticals: Mapping[int, ShotVertical],
    upright: Sequence[Upright | None],
    witnesses: Set[str],
) -> list[RotationEdge]:
    """By shadows and by floors, upright as all shots together have it."""
    shadows, floors = "shadows" in witnesses and results.ground, "floors" in witnesses and results.pictures
    if not (shadows or floors):
        return []
    together = upright_together(results, rotations, verticals)
    edges: list[RotationEdge] = []
    if shadows:
        edges += light_edges(shot_lights(results, together))
    if floors:
        edges += with_alike(floor_edges(results, together), upright, ALIKE_TILES, "other tiles")
    return edges
