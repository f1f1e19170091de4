"""Stage `scenes`: cuts that the colours show, and those that the user adds or removes."""

from typing import Any

from held_results import inputs_of

from humanmm.tasks.scenes import scenes


def test_the_cut_is_found_and_the_users_corrections_of_it_are_applied(film: Any) -> None:
    def spans(*corrections: dict[str, Any]) -> tuple[Any, list[bool]]:
        given = inputs_of("scenes", {"decode": film.facts}, video=film.video, corrections=list(corrections))
        found = scenes(given)
        return found.spans, [note.applied for note in found.corrections]

    end = film.facts.num_frames
    added, removed = {"kind": "add-cut", "frame": 6}, {"kind": "remove-cut", "frame": film.CUT}
    assert spans() == (((0, film.CUT), (film.CUT, end)), [])
    assert spans(added, removed) == (((0, 6), (6, end)), [True, True])
    assert spans({"kind": "remove-cut", "frame": 20}) == (((0, film.CUT), (film.CUT, end)), [False])
