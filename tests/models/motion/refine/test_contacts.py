"""Contacts of made-up feet whose truth is known."""

import numpy as np
import pytest

from humanmm.models.geometry.intervals import runs_of_true
from humanmm.models.motion.refine.contacts import ContactModel, contact_probabilities, support_height, velocities

SOLE = np.array([0.08, 0.03, 0.08, 0.03])
FORWARD = np.array([0.0, 1.0, 0.0])


def steps(fps: float, seconds: float = 6.0, height: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Feet that stand for 0.6 s and swing for 0.4 s in turn: time, feet (N,4,3), truth (N,4)."""
    time = np.arange(round(seconds * fps)) / fps
    feet, truth = np.zeros((len(time), 4, 3)), np.zeros((len(time), 4), bool)
    for side, late in ((0, 0.0), (1, 0.5)):
        phase = (time + late) % 1.0
        swing = np.clip((phase - 0.6) / 0.4, 0, 1)
        along = 1.2 * (np.floor(time + late) + swing**2 * (3 - 2 * swing))
        lift = 0.25 * np.sin(np.pi * swing) ** 2
        for k in (2 * side, 2 * side + 1):
            feet[:, k, 0], feet[:, k, 2] = along, SOLE[k] + lift + height
            truth[:, k] = phase < 0.6
    return time, feet, truth


def found(time: np.ndarray, feet: np.ndarray, **changes: float) -> np.ndarray:
    n = len(time)
    model = ContactModel(**changes)
    ray, seen = np.tile(FORWARD, (n, 1)), np.ones(n, bool)
    return contact_probabilities(feet, SOLE, time_s=time, ray=ray, observed=seen, model=model) >= 0.5


@pytest.mark.parametrize("fps", [24.0, 30.0, 60.0, 120.0])
def test_walking_feet_stand_when_they_stand_at_every_frame_rate(fps: float) -> None:
    time, feet, truth = steps(fps)
    assert np.mean(found(time, feet) == truth) > 0.93


def test_a_stair_carries_as_well_as_the_floor() -> None:
    time, feet, _ = steps(30.0)
    np.testing.assert_array_equal(found(time, feet + np.array([0.0, 0.0, 2.0])), found(time, feet))


def test_nobody_stands_in_the_air() -> None:
    time = np.arange(60) / 30
    feet = np.tile(SOLE[:, None] * [0.0, 0.0, 1.0], (60, 1, 1))
    air = (time > 0.7) & (time < 1.3)
    feet[air, :, 2] += 4.9 * (0.09 - (time[air] - 1.0) ** 2)[:, None]
    contacts = found(time, feet)
    assert contacts[time < 0.6].all()
    assert contacts[time > 1.4].all()
    assert not contacts[(time > 0.8) & (time < 1.2)].any()


def test_a_lifted_foot_held_still_is_no_contact() -> None:
    time = np.arange(60) / 30
    feet = np.tile(SOLE[:, None] * [0.0, 0.0, 1.0], (60, 1, 1))
    feet[:, 2:, 2] += 0.3
    contacts = found(time, feet)
    assert contacts[:, :2].all()
    assert not contacts[:, 2:].any()


def test_where_nobody_is_seen_nobody_stands() -> None:
    time, feet, _ = steps(30.0)
    seen = time > 2.0
    ray = np.tile(FORWARD, (len(time), 1))
    probability = contact_probabilities(feet, SOLE, time_s=time, ray=ray, observed=seen)
    assert (probability[~seen] == 0).all()
    assert probability[seen].max() <= 1.0


@pytest.mark.parametrize(("moved_m", "gap_s", "stands"), [(0.15, 0.5, True), (0.4, 0.5, False), (0.15, 1.5, False)])
def test_a_foot_that_stands_where_it_stood_has_stood_in_a_short_gap(moved_m: float, gap_s: float, stands: bool) -> None:
    time = np.arange(120) / 30
    feet = np.tile(SOLE[:, None] * [0.0, 0.0, 1.0], (120, 1, 1))
    seen = np.abs(time - 2.0) > gap_s / 2
    feet[:, :2, 0] += moved_m * np.clip((time - 2.0) / gap_s + 0.5, 0, 1)[:, None]  # the left foot, as it is filled in
    contacts = contact_probabilities(feet, SOLE, time_s=time, ray=np.tile(FORWARD, (120, 1)), observed=seen) >= 0.5
    assert contacts[seen].mean() > 0.95
    assert contacts[~seen][:, :2].all() == stands
    assert contacts[~seen][:, 2:].all() == (gap_s < 1)


def test_trembling_along_the_viewing_ray_is_forgiven() -> None:
    time = np.arange(90) / 30
    feet = np.tile(SOLE[:, None] * [0.0, 0.0, 1.0], (90, 1, 1))
    tremble = 0.06 * np.sin(2 * np.pi * 2.5 * time)[:, None]
    along, across = feet.copy(), feet.copy()
    along[..., 1] += tremble
    across[..., 0] += tremble
    assert found(time, along).mean() > found(time, across).mean() + 0.2


def test_a_contact_lasts_and_is_not_interrupted_by_one_frame() -> None:
    rng = np.random.default_rng(0)
    time, feet, truth = steps(60.0)
    contacts = found(time, feet + 0.004 * rng.normal(size=feet.shape))
    for column in contacts.T:
        assert all(end - start >= 6 for start, end in runs_of_true(column))
        assert len(runs_of_true(column)) <= 7
    assert np.mean(contacts == truth) > 0.85


def test_velocities_are_those_of_a_steady_walk_at_uneven_times() -> None:
    time = np.cumsum(np.random.default_rng(1).uniform(0.02, 0.05, 40))
    points = time[:, None, None] * np.array([[1.0, -2.0, 0.5]])
    np.testing.assert_allclose(velocities(points, time, 0.1), np.tile([1.0, -2.0, 0.5], (40, 1, 1)))


def test_the_support_is_looked_for_over_a_time_also_where_frames_are_missing() -> None:
    time = np.arange(90) / 30
    time[45:] += 60.0
    lowest = np.full(90, 1.0)
    lowest[20] = 0.0
    found = support_height(lowest, time, 0.5)
    assert np.flatnonzero(found == 0).tolist() == list(range(5, 36))
    lowest[44] = -1.0
    assert (support_height(lowest, time, 0.5)[46:] == 1).all(), "what was a minute ago carries nobody"
    assert support_height(np.ones(1), np.zeros(1), 0.5).tolist() == [1.0]


def test_one_frame_has_no_speed() -> None:
    assert (velocities(np.ones((1, 4, 3)), np.zeros(1), 0.1) == 0).all()


@pytest.mark.parametrize(("fps", "frames"), [(10.0, 1), (20.0, 2), (30.0, 3), (60.0, 6)])
def test_a_contact_of_the_shortest_duration_counts_wherever_it_is(fps: float, frames: int) -> None:
    time = np.arange(3000) / fps
    for start in range(50, 2900, 37):
        standing = np.isin(np.arange(3000), start + np.arange(frames))
        feet = np.tile(SOLE[:, None] * [0.0, 0.0, 1.0], (3000, 1, 1))
        feet[~standing, 2:, 2] += 0.3
        contacts = found(time, feet, baseline_s=0.0, speed_ms=100.0)
        np.testing.assert_array_equal(contacts[:, 2], standing)
