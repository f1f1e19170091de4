"""Prefetching: a thread makes the next items while the last ones are used.

Decoding, drawing and the networks leave Python's lock free most of the time, so that two of them side by side take
little longer than the slower one alone.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from queue import SimpleQueue
from threading import Semaphore, Thread
from typing import Generic, TypeVar

T = TypeVar("T")

DEPTH = 3
"""Items that are prefetched by default: pictures of a 1080p video are 6 MB each."""


@dataclass(frozen=True)
class _Prefetched(Generic[T]):
    """What the thread hands over: an item, the end, or the error that came instead of an item."""

    item: T | None = None
    ended: bool = False
    error: BaseException | None = None


@contextmanager
def prefetched(items: Iterable[T], depth: int = DEPTH) -> Iterator[Iterator[T]]:
    """The same items in the same order, made by a thread that runs at most `depth` items ahead.

    Use as `with prefetched(items) as ready: for item in ready: …`. An exception of `items` is raised where its item
    would come. Leaving the block stops the thread and closes `items`, however many are left. While item n is made,
    whoever uses them is done with item n − depth: `depth` buffers, filled in turn, are enough for all.
    """
    made: SimpleQueue[_Prefetched[T]] = SimpleQueue()
    room = Semaphore(depth)
    stopped = False

    def make() -> None:
        source = iter(items)
        try:
            while True:
                room.acquire()
                if stopped:
                    return
                made.put(_Prefetched(next(source)))
        except StopIteration:
            made.put(_Prefetched(ended=True))
        except BaseException as error:  # raised again by `used`, in the thread that wants the item
            made.put(_Prefetched(error=error))
        finally:
            close = getattr(source, "close", None)
            if close is not None:
                close()

    def used() -> Iterator[T]:
        while True:
            one = made.get()
            if one.error is not None:
                raise one.error
            if one.ended:
                return
            yield one.item  # type: ignore[misc]  # an item, since it is neither the end nor an error
            room.release()

    thread = Thread(target=make, name="prefetch", daemon=True)
    thread.start()
    try:
        yield used()
    finally:
        stopped = True
        room.release()
        thread.join()
