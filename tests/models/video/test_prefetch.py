"""Prefetching changes when items are made, and nothing else."""

import threading
import time
import weakref
from collections.abc import Iterator

import pytest

from humanmm.models.video.prefetch import prefetched


class Picture:
    """Something that can be counted while it lives."""

    def __init__(self, number: int) -> None:
        self.number = number


def test_items_come_in_order_and_all() -> None:
    with prefetched(range(100), depth=2) as made:
        assert list(made) == list(range(100))


def test_at_most_depth_items_are_kept_beside_the_one_in_use() -> None:
    alive: weakref.WeakSet[Picture] = weakref.WeakSet()
    most = 0

    def pictures() -> Iterator[Picture]:
        nonlocal most
        for number in range(40):
            picture = Picture(number)
            alive.add(picture)
            most = max(most, len(alive))
            yield picture
            del picture

    with prefetched(pictures(), depth=3) as made:
        for picture in made:
            if picture.number % 10 == 0:
                time.sleep(0.02)  # let the thread run as far ahead as it may
    assert most == 4


def test_while_an_item_is_made_the_one_depth_before_is_no_longer_in_use() -> None:
    buffers = [[-1], [-1], [-1]]

    def filled_in_turn() -> Iterator[list[int]]:
        for number in range(200):
            buffer = buffers[number % len(buffers)]
            buffer[0] = number
            yield buffer

    with prefetched(filled_in_turn(), depth=3) as made:
        for number, buffer in enumerate(made):
            if number % 50 == 0:
                time.sleep(0.01)
            assert buffer == [number]


def test_an_error_comes_where_its_item_would_have_come() -> None:
    def broken() -> Iterator[int]:
        yield 1
        yield 2
        raise ValueError("frame 3 is damaged")

    seen = []
    with prefetched(broken()) as made, pytest.raises(ValueError, match="frame 3"):
        seen.extend(made)
    assert seen == [1, 2]


@pytest.mark.parametrize("how", ["break", "raise", "not used"])
def test_leaving_early_stops_the_thread_and_closes_the_items(how: str) -> None:
    closed = []

    def endless() -> Iterator[int]:
        try:
            number = 0
            while True:
                yield number
                number += 1
        finally:
            closed.append(threading.current_thread().name)

    before = threading.active_count()
    try:
        with prefetched(endless()) as made:
            if how != "not used":
                for item in made:
                    if item == 5 and how == "raise":
                        raise KeyError(item)
                    if item == 5:
                        break
    except KeyError:
        assert how == "raise"
    assert threading.active_count() == before
    assert closed == ["prefetch"]


def test_two_threads_in_a_row_pass_everything_on() -> None:
    with prefetched(range(50)) as made, prefetched((2 * item for item in made), depth=2) as doubled:
        assert list(doubled) == list(range(0, 100, 2))
    with prefetched(range(1000)) as made, prefetched((2 * item for item in made), depth=2) as doubled:
        assert next(doubled) == 0
