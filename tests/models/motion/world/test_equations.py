"""The banded solve of places and cameras, against the same least squares solved densely."""

import numpy as np

from humanmm.models.motion.world.equations import CAMERA_UNKNOWNS, WorldEquations, links_of

STRANDS = ((0, 0, 6), (0, 1, 1), (0, 2, 2), (0, 1, 5), (1, 0, 4), (1, 2, 3))
"""Person, shot, frames: strands shorter than the reach of an acceleration, and a shot seen twice."""
SHOTS = 3


def test_the_step_is_the_one_that_a_dense_solve_finds() -> None:
    rng = np.random.default_rng(0)
    persons, shots, counts = (list(column) for column in zip(*STRANDS, strict=True))
    times = [np.arange(count) / 30 + k for k, count in enumerate(counts)]
    links = links_of(persons, shots, times)
    equations, places = WorldEquations(links, SHOTS), sum(counts)
    rows, right = [], []

    def note(residual: np.ndarray, blocks: dict[int, np.ndarray]) -> None:
        row = np.zeros((len(residual), 3 * places + CAMERA_UNKNOWNS * SHOTS))
        for first, block in blocks.items():
            row[:, first : first + block.shape[1]] += block
        rows.append(row)
        right.append(residual)

    def camera(shot: int) -> int:
        return 3 * places + CAMERA_UNKNOWNS * shot

    for link in links:
        n = link.stop - link.start
        residual, by_place, by_camera = (rng.normal(size=(n, 2, *size)) for size in ((), (3,), (CAMERA_UNKNOWNS,)))
        equations.add_places(link.start, link.shot, residual, by_place, by_camera)
        for k in range(n):
            note(residual[k], {3 * (link.start + k): by_place[k], camera(link.shot): by_camera[k]})
        weight, moved, lever = rng.uniform(size=n - 1), rng.normal(size=(n - 1, 3)), rng.normal(size=(n - 1, 3, 3))
        equations.add_still(link.start, link.shot, weight, moved, lever)
        for k, w in enumerate(weight):
            at, turn = 3 * (link.start + k), camera(link.shot) + 3
            note(w * moved[k], {at: -w * np.eye(3), at + 3: w * np.eye(3), turn: w * lever[k]})
    for person in (0, 1):
        own = [link for link, owner in zip(links, persons, strict=True) if owner == person]
        at = np.arange(own[0].start, own[-1].stop - 2)
        shares, residual = rng.normal(size=(len(at), 3)), rng.normal(size=(len(at), 3))
        equations.add_chain(at, shares, residual)
        for k, first in enumerate(at):
            note(residual[k], {3 * (first + d): shares[k, d] * np.eye(3) for d in range(3)})
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
    first, second, other = links_of([0, 0, 1], [0, 1, 0], times)
    assert 60 + 15 * 30 - 5 < first.echo < 60 + 15 * 30 + 5
    assert second.echo == second.stop == other.start
    assert other.echo == other.stop
