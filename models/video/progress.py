"""How far a function is that goes through the frames of a video, for whoever watches."""

from collections.abc import Callable, Sequence

Progress = Callable[[int, int], None]
"""Called with the number of frames done, and of all."""


def silent(done: int, total: int) -> None:
    """Progress that nobody reads."""


def parts_of(progress: Progress, num_frames: int, sizes: Sequence[float]) -> list[Progress]:
    """A progress for each of several parts of one work on `num_frames` frames, done one after the other.

    `sizes` says how much of the work each is. What is reported rises, even where a part begins again.
    """
    whole, most = max(sum(sizes), 1e-9), 0

    def part(before: float, size: float) -> Progress:
        def report(done: int, total: int) -> None:
            nonlocal most
            now = round(num_frames * (before + size * min(done / max(total, 1), 1.0)) / whole)
            if now > most:
                most = now
                progress(most, num_frames)

        return report

    return [part(sum(sizes[:k]), size) for k, size in enumerate(sizes)]
