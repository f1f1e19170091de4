"""Progress of a work in parts rises to the number of frames, whatever its parts report."""

from humanmm.models.video.progress import Progress, parts_of


def _listener() -> tuple[list[tuple[int, int]], Progress]:
    reports: list[tuple[int, int]] = []
    return reports, lambda done, total: reports.append((done, total))


def test_parts_share_the_frames_by_their_sizes() -> None:
    reports, progress = _listener()
    first, second = parts_of(progress, 100, (1, 3))
    first(5, 10)
    first(10, 10)
    second(1, 3)
    second(3, 3)
    assert reports == [(12, 100), (25, 100), (50, 100), (100, 100)]


def test_what_is_reported_never_falls() -> None:
    reports, progress = _listener()
    (part,) = parts_of(progress, 10, (2,))
    for done in (1, 3, 1, 2, 3, 4, 5):
        part(done, 4)
    assert reports == [(2, 10), (8, 10), (10, 10)]


def test_a_work_without_parts_or_frames_reports_nothing() -> None:
    reports, progress = _listener()
    assert parts_of(progress, 10, ()) == []
    parts_of(progress, 0, (0, 1))[1](0, 0)
    assert reports == []
