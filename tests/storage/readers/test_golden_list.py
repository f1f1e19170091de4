"""The list of the golden set: the repository's own is whole, and an entry that is wrong is named."""

from pathlib import Path

import pytest

from humanmm.errors import InputError
from humanmm.models.records.landmarks import INDEX
from humanmm.storage.readers.golden_list import read_golden_list

SHIPPED = Path(__file__).parents[3] / "examples" / "golden.toml"
CLIP = '[[clip]]\nname = "{name}"\nshows = "nobody"\nparts = [{{ video = "a.mp4" }}]\n'


def test_the_repository_has_25_clips_or_more_and_nobody_in_some() -> None:
    clips = read_golden_list(SHIPPED)
    assert len(clips) >= 25
    assert sum(not clip.people for clip in clips) >= 4
    assert any(not cut.linked for clip in clips for cut in clip.cuts)


def test_the_points_and_frames_of_the_repository_mean_something() -> None:
    for clip in read_golden_list(SHIPPED):
        for person in clip.people:
            names = {name for points in person.points.values() for name in points}
            assert names <= {"head", *INDEX}, f"{clip.name}: {person.who}"
            asked = [*person.facing, *person.points, *person.upright, *person.feet_m]
            inside = [any(start <= frame < end for start, end in person.frames) for frame in asked]
            assert all(inside), f"{clip.name}: {person.who} is asked for where he need not be found"
            assert all(row[1] < row[3] and row[2] < row[4] for row in person.at), f"{clip.name}: {person.who}"


def test_a_wrong_entry_is_named(tmp_path: Path) -> None:
    path = tmp_path / "golden.toml"
    path.write_text(CLIP.format(name="one") + 'kamera = "static"\n')
    with pytest.raises(InputError, match=r"clip\.0\.kamera: Extra inputs are not permitted"):
        read_golden_list(path)
    path.write_text(2 * CLIP.format(name="one"))
    with pytest.raises(InputError, match="several clips are named one"):
        read_golden_list(path)
    path.write_text("clip = [")
    with pytest.raises(InputError, match="cannot be read"):
        read_golden_list(path)
