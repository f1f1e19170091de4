"""The banded solve of places and cameras, against the same least squares solved densely."""

import numpy as np

from humanmm.models.motion.world.equations import CAMERA_UNKNOWNS, WorldEquations, segments_of

STRANDS = ((0, 0, 6), (0, 1, 1), (0, 2, 2), (0, 1, 5), (1, 0, 4), (1, 2, 3))
"""Person, shot, frames: strands shorter than the reach of an acceleration, and a shot seen twice."""
SHOTS = 3


def test_the_step_is_the_one_that_a_dense_solve_finds() -> None:
    rng = np.random.default_rng(0)
    persons, shots, counts = (list(column) for column in zip(*STRANDS, strict=True))
    times = [np.arange(count) / 30 + k for k, count in enumerate(counts)]
    segments = segments_of(persons, shots, times)
    equations, places = WorldEquations(segments, SHOTS), sum(counts)
    rows, right = [], []

    def note(residual: np.ndarray, blocks: dict[int, np.ndarray]) -> None:
        row = np.zeros((len(residual), 3 * places + CAMERA_UNKNOWNS * SHOTS))
        for first, block in blocks.items():
            row[:, first : first + block.shape[1]] += block
        rows.append(row)
        right.append(residual)

    def camera(shot: int) -> int:
        return 3 * places + CAMERA_UNKNOWNS * shot

    for segment in segments:
        n = segment.stop - segment.start
        residual, by_position, by_camera = (rng.normal(size=(n, 2, *size)) for size in ((), (3,), (CAMERA_UNKNOWNS,)))
        equations.add_positions(segment.start, segment.shot, residual, by_position, by_camera)
        for k in range(n):
            note(residual[k], {3 * (segment.start + k): by_position[k], camera(segment.shot): by_camera[k]})
        weight, moved, lever = rng.uniform(size=(n - 1, 2)), *(rng.normal(size=(n - 1, 2, *s)) for s in ((3,), (3, 3)))
        equations.add_still(segment.start, segment.shot, weight, moved, lever)
        for k, foot in np.ndindex(weight.shape):
            w, at, rotation = weight[k, foot], 3 * (segment.start + k), camera(segment.shot) + 3
            note(w * moved[k, foot], {at: -w * np.eye(3), at + 3: w * np.eye(3), rotation: w * lever[k, foot]})
    for person in (0, 1):
        own = [segment for segment, owner in zip(segments, persons, strict=True) if owner == person]
        at = np.arange(own[0].start, own[-1].stop - 2)
        coefficients, residual = rng.normal(size=(len(at), 3)), rng.normal(size=(len(at), 3))
        equations.add_chain(at, coefficients, residual)
        for k, first in enumerate(at):
            note(residual[k], {3 * (first + d): coefficients[k, d] * np.eye(3) for d in range(3)})
    between = rng.normal(size=(2, 3, CAMERA_UNKNOWNS))
    equations.add_cameras(np.ones(3), (0, between[0]), (2, between[1]))
    note(np.ones(3), {camera(0): between[0], camera(2): between[1]})

    extra = rng.uniform(0.1, 1, (SHOTS, CAMERA_UNKNOWNS))
    J, r = np.concatenate(rows), np.concatenate(right)
    dense = np.linalg.solve(J.T @ J + np.diag([*np.full(3 * places, 0.2), *extra.ravel()]), -J.T @ r)
    moved, cameras = equations.step(0.2, extra)
    # Strands lie one second apart, far less than a camera's echo is followed: nothing is left out.
    np.testing.assert_allclose(np.concatenate([moved.ravel(), cameras.ravel()]), dense, atol=1e-10)


def test_an_echo_ends_with_its_person() -> None:
    times = [np.arange(60) / 30, 2 + np.arange(900) / 30, np.arange(30) / 30]
    first, second, other = segments_of([0, 0, 1], [0, 1, 0], times)
    assert 60 + 15 * 30 - 5 < first.horizon < 60 + 15 * 30 + 5
    assert second.horizon == second.stop == other.start
    assert other.horizon == other.stop
