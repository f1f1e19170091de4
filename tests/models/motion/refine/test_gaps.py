"""Who is not seen for long does not hang in the air meanwhile."""

import numpy as np

from humanmm.models.motion.refine.gaps import HELD_S, LANDED_S, landed, landings
from humanmm.models.motion.refine.smoothing import smooth

N = 300
TIME = np.arange(N) / 30
OBSERVED = (np.arange(N) < 60) | (np.arange(N) >= 200)


def standing(*rows: slice) -> np.ndarray:
    contacts = np.zeros((N, 4))
    for one in rows:
        contacts[one, 0] = 0.9
    return contacts


def test_who_leaves_in_the_air_and_comes_back_so_stands_meanwhile() -> None:
    before, after = landings(OBSERVED, standing(slice(0, 40), slice(230, 300)), TIME)
    assert (before.like, before.edge, after.like, after.edge) == (39, 59, 230, 200)
    np.testing.assert_allclose(TIME[before.rows[[0, -1]]] - TIME[59], [LANDED_S, LANDED_S + HELD_S], atol=0.04)
    np.testing.assert_allclose(TIME[200] - TIME[after.rows[[-1, 0]]], [LANDED_S, LANDED_S + HELD_S], atol=0.04)


def test_who_stands_at_the_ends_or_never_or_is_away_for_a_moment_only_is_left_alone() -> None:
    assert landings(OBSERVED, standing(slice(0, 60), slice(200, 300)), TIME) == []
    assert landings(OBSERVED, standing(), TIME) == []
    assert landings(OBSERVED, standing(slice(0, 40), slice(230, 300)), TIME / 3) == []
    assert landings(np.arange(N) < 60, standing(slice(0, 40)), TIME) == [], "nobody knows of him any more"


def test_a_body_comes_down_where_it_was_seen_last() -> None:
    jump = np.clip(np.arange(N) - 39, 0, 20) / 20
    pelvis = np.stack([0.01 * np.arange(N), np.zeros(N), 0.9 + np.where(np.arange(N) < 60, jump, 0.0)], axis=1)
    vectors = np.zeros((N, 24, 3))
    vectors[40:60, 0, 0] = np.linspace(0, 2.5, 20)
    found = landings(OBSERVED, standing(slice(0, 40), slice(200, 300)), TIME)
    poses, places, weight = landed(vectors, pelvis, OBSERVED * 1.0, found)
    filled = smooth(places, weight, TIME, cutoff_hz=8.0)
    assert pelvis[59, 2] > 1.85 and np.abs(filled[90:195, 2] - 0.9).max() < 0.05
    assert filled[84, 0] == np.clip(filled[84, 0], pelvis[59, 0] - 0.05, pelvis[59, 0] + 0.05)
    assert (poses[found[0].rows] == 0).all()
    np.testing.assert_array_equal(places[OBSERVED], pelvis[OBSERVED])
