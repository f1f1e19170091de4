"""The banded solve of positions, cameras and sizes, against the same least squares solved densely."""

import numpy as np

from humanmm.models.motion.world.equations import CAMERA_UNKNOWNS, SHARED_UNKNOWNS, Segment, WorldEquations, segments_of

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

    num_shared = CAMERA_UNKNOWNS * SHOTS + 2 + 1
    focal = 3 * places + num_shared - 1

    def note(residual: np.ndarray, blocks: dict[int, np.ndarray]) -> None:
        row = np.zeros((len(residual), 3 * places + num_shared))
        for first, block in blocks.items():
            row[:, first : first + block.shape[1]] += block
        rows.append(row)
        right.append(residual)

    def camera(shot: int) -> int:
        return 3 * places + CAMERA_UNKNOWNS * shot

    def shared_by(segment: Segment, by_shared: np.ndarray) -> dict[int, np.ndarray]:
        size = 3 * places + CAMERA_UNKNOWNS * SHOTS + segment.person
        return {camera(segment.shot): by_shared[:, :-2], size: by_shared[:, -2:-1], focal: by_shared[:, -1:]}

    for number, segment in enumerate(segments):
        n = segment.stop - segment.start
        residual, by_position, by_shared = (rng.normal(size=(n, 2, *size)) for size in ((), (3,), (SHARED_UNKNOWNS,)))
        equations.add_positions(number, residual, by_position, by_shared)
        for k in range(n):
            at = 3 * (segment.start + k)
            note(residual[k], {at: by_position[k], **shared_by(segment, by_shared[k])})
        whiten, moved, by_shared = (rng.normal(size=(n - 1, 2, *s)) for s in ((3, 3), (3,), (3, SHARED_UNKNOWNS)))
        equations.add_moves(number, whiten, moved, by_shared)
        for k, foot in np.ndindex(moved.shape[:2]):
            W, at = whiten[k, foot], 3 * (segment.start + k)
            note(W @ moved[k, foot], {at: -W, at + 3: W, **shared_by(segment, W @ by_shared[k, foot])})
    for person in (0, 1):
        own = [segment for segment, owner in zip(segments, persons, strict=True) if owner == person]
        at = np.arange(own[0].start, own[-1].stop - 2)
        coefficients, residual = rng.normal(size=(len(at), 3)), rng.normal(size=(len(at), 3))
        equations.add_chain(at, coefficients, residual)
        for k, first in enumerate(at):
            note(residual[k], {3 * (first + d): coefficients[k, d] * np.eye(3) for d in range(3)})
    between = rng.normal(size=(2, 3, CAMERA_UNKNOWNS))
    equations.add_shared(np.ones(3), (equations.camera(0), between[0]), (equations.camera(2), between[1]))
    note(np.ones(3), {camera(0): between[0], camera(2): between[1]})

    extra = rng.uniform(0.1, 1, num_shared)
    J, r = np.concatenate(rows), np.concatenate(right)
    dense = np.linalg.solve(J.T @ J + np.diag([*np.full(3 * places, 0.2), *extra]), -J.T @ r)
    moved, shared = equations.step(0.2, extra)
    # Strands lie one second apart, far less than a camera's echo is followed: nothing is left out.
    np.testing.assert_allclose(np.concatenate([moved.ravel(), shared]), dense, atol=1e-10)


def test_an_echo_ends_with_its_person() -> None:
    times = [np.arange(60) / 30, 2 + np.arange(900) / 30, np.arange(30) / 30]
    first, second, other = segments_of([0, 0, 1], [0, 1, 0], times)
    assert 60 + 15 * 30 - 5 < first.horizon < 60 + 15 * 30 + 5
    assert second.horizon == second.stop == other.start
    assert other.horizon == other.stop
