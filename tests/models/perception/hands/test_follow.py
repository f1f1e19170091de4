"""Which hands are looked at when, and what counts as one."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.motion.hands.over_time import over_time
from humanmm.models.perception.hands import follow
from humanmm.models.perception.hands.crops import of_body, of_points
from humanmm.models.perception.hands.follow import NUMBERS, due_frames, hand_tracks, look_at_hands
from humanmm.models.perception.hands.network import Hand
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region
from humanmm.models.records.landmarks import WRISTS

BLACK = Picture((np.zeros((64, 64), np.uint8), np.zeros((32, 32), np.uint8), np.zeros((32, 32), np.uint8)))
BODY = np.ones((33, 3))
BODY[[15, 17, 19], :2] = (10, 30), (14, 12), (6, 12)
BODY[[16, 18, 20], :2] = (50, 30), (46, 12), (54, 12)
LEFT = np.array([True, False])
SHAPE = np.linspace([0, 0], [0, -20], 21) + np.sin(np.arange(21))[:, None] * (3, 0)


class Seen:
    """Stands in for the network: a left hand whose wrist is at a place, whatever the region; notes the regions."""

    def __init__(self, wrist: tuple[float, float] = (10, 30), presence: float = 0.9, right: float = 0.1) -> None:
        self.hand = Hand(SHAPE + wrist - SHAPE[0], np.zeros((21, 3)), presence, right)
        self.regions: list[Region] = []

    def __call__(self, image: Picture, region: Region) -> Hand:
        self.regions.append(region)
        return self.hand


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> Seen:
    found = Seen()
    monkeypatch.setattr(follow, "look", found)
    return found


@pytest.mark.parametrize(("rate_hz", "looks_per_frame"), [(24, 1), (30, 1), (60, 0.5), (120, 0.25)])
def test_one_hand_a_frame_at_most_each_fifteen_times_a_second(rate_hz: float, looks_per_frame: float) -> None:
    due = due_frames(np.arange(rate_hz * 4) / rate_hz)
    assert due.sum(axis=1).max() == 1
    assert due.sum() / len(due) == pytest.approx(looks_per_frame, rel=0.05)
    assert abs(int(due[:, 0].sum()) - int(due[:, 1].sum())) <= 1


@pytest.mark.parametrize("rate_hz", [12.5, 8, 3])
def test_both_hands_are_looked_at_in_frames_that_are_further_apart_than_looks(rate_hz: float) -> None:
    assert due_frames(np.arange(12) / rate_hz).all()


def test_both_hands_are_looked_at_in_a_picture_that_stays_and_in_one_that_is_alone() -> None:
    interval_s = np.full(40, 1 / 30)
    interval_s[20] = 0.5
    due = due_frames(np.cumsum(interval_s) - interval_s)
    assert np.flatnonzero(due.all(axis=1)).tolist() == [20]
    assert due_frames(np.array([2.0])).all()


def test_a_fist_stays_one_at_any_frame_rate() -> None:
    for rate_hz in (2, 5, 8, 15, 30):
        time_s = np.arange(12) / rate_hz
        seen = np.where(due_frames(time_s)[:, 0], 0.9, np.nan)
        fist, certain = over_time(time_s, time_s, np.ones((12, 1)), seen, np.zeros(1))
        assert (fist == pytest.approx(1)) and (certain == pytest.approx(0.9))


def test_a_new_hand_is_looked_at_where_the_body_has_it(seen: Seen) -> None:
    looks = look_at_hands(BLACK, BODY, LEFT, [])
    assert seen.regions == [of_body(BODY, 0)]
    assert looks.shape == (2, NUMBERS)
    assert looks[0, 0] == pytest.approx(0.81) and np.isnan(looks[1, 0])


def test_a_known_hand_is_looked_at_where_it_was_moved_with_the_wrist(seen: Seen) -> None:
    looks = look_at_hands(BLACK, BODY, LEFT, [])
    seen.regions.clear()
    later = BODY.copy()
    later[WRISTS[0], :2] += (2, 1)
    other = look_at_hands(BLACK, BODY, ~LEFT, [])  # of the right hand alone: says nothing of the left one
    seen.regions.clear()
    look_at_hands(BLACK, later, LEFT, [(BODY, other), (BODY, looks)])
    (region,) = seen.regions
    expected = of_points(seen.hand.points).moved(2, 1)
    assert (region.x, region.y, region.side) == pytest.approx((expected.x, expected.y, expected.side), abs=1e-3)


@pytest.mark.parametrize(
    "wrong", [{"presence": 0.2}, {"right": 0.9}, {"wrist": (50, 30)}], ids=["no hand", "other hand", "elsewhere"]
)
def test_what_is_no_hand_the_other_hand_or_elsewhere_is_not_taken(
    wrong: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(follow, "look", Seen(**wrong))  # type: ignore[arg-type]
    assert not look_at_hands(BLACK, BODY, LEFT, [])[0].any()


def test_hands_whose_wrist_is_not_seen_are_not_looked_for(seen: Seen) -> None:
    hidden = BODY.copy()
    hidden[WRISTS[0], 2] = 0.05
    assert not look_at_hands(BLACK, hidden, LEFT, [])[0].any()
    assert not seen.regions


def test_a_hand_that_was_lost_is_looked_for_where_the_body_has_it(seen: Seen) -> None:
    lost = np.zeros((2, NUMBERS), np.float32)
    look_at_hands(BLACK, BODY, LEFT, [(BODY, lost)])
    assert seen.regions[0] == of_body(BODY, 0)


def test_looks_of_a_track_are_unpacked(seen: Seen) -> None:
    seen.hand = replace(seen.hand, points3d=np.random.default_rng(0).normal(size=(21, 3)))
    tracks = hand_tracks([None, look_at_hands(BLACK, BODY, LEFT, [])])
    assert np.isnan(tracks.confidence[0]).all() and np.isnan(tracks.confidence[1, 1])
    np.testing.assert_allclose(tracks.points[1, 0], seen.hand.points, atol=1e-4)
    np.testing.assert_allclose(tracks.points3d[1, 0], seen.hand.points3d, atol=1e-6)
    assert not tracks.points[0].any()
