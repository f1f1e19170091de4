"""Which folders humanmm writes itself."""

from pathlib import Path

from humanmm.storage.batches.own_folders import OwnFolderSearch, foreign, is_run

STORE = ["artifacts", "locks", "tmp", "videos"]


def test_a_run_folder_is_known_by_what_it_holds() -> None:
    assert is_run(["a.mp4", "run.json", "motion.zarr", "view"])
    assert not is_run(["run.json"]) and not is_run(["motion.zarr"])


def test_nothing_in_a_run_folder_and_no_folder_of_a_store_is_foreign() -> None:
    assert foreign(["run.json", "motion.zarr", "mine"], ["motion.zarr", "mine"]) == []
    assert foreign([*STORE, "films", "a.mp4"], [*STORE, "films"]) == ["films"]
    assert foreign(["videos", "tmp"], ["videos", "tmp"]) == ["videos", "tmp"], "this is no store"


def test_the_nearest_own_folder_around_a_place_is_found(tmp_path: Path) -> None:
    inside = tmp_path / "run" / "view" / "deep"
    inside.mkdir(parents=True)
    (tmp_path / "run" / "run.json").touch()
    assert OwnFolderSearch().around(inside) is None
    (tmp_path / "run" / "motion.zarr").mkdir()
    search = OwnFolderSearch()
    assert search.around(inside) == search.around(tmp_path / "run") == tmp_path / "run"
    assert search.around(tmp_path) is None
    assert search.around(tmp_path / "run" / ".." / "other") is None


def test_films_beside_the_folders_of_a_store_are_not_its_own(tmp_path: Path) -> None:
    for name in STORE:
        (tmp_path / name).mkdir()
    search = OwnFolderSearch()
    assert search.around(tmp_path / "artifacts" / "deliver") == tmp_path / "artifacts"
    assert search.around(tmp_path / "films") is None
