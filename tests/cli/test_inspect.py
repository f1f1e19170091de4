"""`status`, `explain`, `verify`, `gc`, `store du`, `eval`: what they say of a run and of a store."""

import json
import os
from pathlib import Path
from typing import Any

import pytest

TRUTH = Path(__file__).resolve().parents[2] / "examples/pose2sim_multishot/pose2sim_A_01-02-01_gt.npz"


@pytest.fixture
def finished(toy: Any) -> Any:
    """A toy with a run folder."""
    toy.run()
    assert toy.main("recover", "film.mp4")[0] == 0
    return toy


def test_status_of_an_unchanged_run_is_up_to_date(finished: Any) -> None:
    status, out, _ = finished.main("status", "runs/film")
    assert status == 0
    assert out.splitlines()[0] == "runs/film: done, 60 frames, 3 shots"
    assert out.splitlines()[-1] == "  up to date"


def test_status_tells_what_is_stale_and_why(finished: Any) -> None:
    finished.edit("camera", "np.cumsum", "2 * np.cumsum")
    status, out, _ = finished.main("status", "runs/film", "--json")
    tree = json.loads(out)
    assert (status, tree["state"], tree["up_to_date"]) == (0, "done", False)
    stale = {entry["stage"]: entry["reason"] for entry in tree["stages"] if entry["state"] != "cached"}
    assert stale["camera"] == "code changed: toyline.camera"
    assert stale["align"] in ("camera", "hmr")


def test_explain_says_that_the_store_does_not_have_the_shots(finished: Any) -> None:
    empty = str(finished.folder / "empty")
    message = finished.main("explain", "runs/film", "camera", "--shot", "1", "--store", empty)[2]
    assert message == f"humanmm: --shot 1: the store {empty} does not have the shots of this run\n"
    assert finished.main("explain", "runs/film", "camera", "--shot", "3")[2].endswith("the video has 3 shots\n")


def test_status_works_when_the_video_is_gone(finished: Any) -> None:
    finished.video.unlink()
    assert json.loads(finished.main("status", "runs/film", "--json")[1])["stages"][0]["state"] == "cached"


def test_status_without_a_folder_lists_the_videos_of_the_store(finished: Any) -> None:
    tree = json.loads(finished.main("status", "--json")[1])
    assert [video["state"] for video in tree["videos"]] == ["done"]
    assert tree["videos"][0]["run_dir"] == str(finished.folder / "runs/film")


def test_the_list_of_the_store_has_time_name_and_outcome_and_can_be_of_failures_alone(finished: Any) -> None:
    head, line = finished.main("status")[1].splitlines()
    assert head.endswith(": 1 videos") and "  film.mp4  done: " in line and "3 shots" in line
    assert line.lstrip().startswith("20") and line.endswith("runs/film")
    assert finished.main("status", "--failed")[1].splitlines() == [
        f"store {finished.store}: 0 videos failed or partial"
    ]
    (finished.folder / "runs/film/run.json").unlink()
    assert "  done  " in finished.main("status")[1], "as the store noted it"
    assert finished.main("status", "runs/film", "--failed")[0] == 2


def test_a_folder_that_is_no_run_is_reported(toy: Any) -> None:
    status, out, message = toy.main("status", ".")
    assert (status, out) == (1, "") and "is no run folder" in message
    (toy.folder / "run.json").write_text("{}")
    assert "another schema" in toy.main("explain", ".", "camera")[2]


def test_explain_names_everything_a_result_was_made_of(finished: Any) -> None:
    status, out, _ = finished.main("explain", "runs/film", "camera", "--shot", "1", "--json")
    (unit,) = json.loads(out)["units"]
    assert status == 0
    assert (unit["state"], unit["shot"], unit["in_this_run"]["state"]) == ("cached", 1, "cached")
    assert unit["recipe"]["unit"] == {"start": 20, "end": 40}
    assert {"people", "shot", "points", "intrinsics"} <= set(unit["recipe"]["inputs"])
    assert (finished.store / unit["artifact"]).is_dir()
    text = finished.main("explain", "runs/film", "camera", "--shot", "1")[1]
    assert text.startswith("camera (shot 1): cached\n") and "settings: camera = " in text


def test_explain_refuses_a_shot_that_makes_no_sense(finished: Any) -> None:
    assert finished.main("explain", "runs/film", "align", "--shot", "1")[0] == 2
    status, _, message = finished.main("explain", "runs/film", "camera", "--shot", "7")
    assert status == 1 and "the video has 3 shots" in message


def test_verify_ends_with_status_1_and_the_next_run_repairs(finished: Any) -> None:
    assert finished.main("verify", "--deep")[:2] == (0, "18 artifacts are sound, 0 damaged\n")
    victim = next(finished.store.glob("artifacts/camera/*/*/result.json"))
    victim.write_text(victim.read_text().replace("camera", "camerb") + " ")
    status, out, _ = finished.main("verify")
    assert status == 1
    assert "result.json has" in out and "1 damaged (set aside)" in out
    assert json.loads(finished.main("verify", "--json")[1]) == {"sound": 17, "damaged": [], "unreadable": []}
    finished.executed()
    finished.run()
    assert len(finished.executed()) == 1


def test_a_program_reads_what_verify_found(finished: Any) -> None:
    victim = next(finished.store.glob("artifacts/camera/*/*/result.json"))
    victim.write_text("")
    status, out, _ = finished.main("verify", "--json")
    tree = json.loads(out)
    (damaged,) = tree["damaged"]
    assert (status, tree["sound"], tree["unreadable"]) == (1, 17, [])
    assert damaged["artifact"].startswith("artifacts/camera/") and "has 0 bytes" in damaged["problem"]


def test_a_store_that_is_not_there_is_not_sound(finished: Any) -> None:
    status, out, message = finished.main("verify", "--store", "typo")
    assert (status, out) == (1, "") and f"there is no store {finished.folder / 'typo'}; name one" in message


def test_gc_removes_nothing_before_it_is_reported_to(finished: Any) -> None:
    status, out, _ = finished.main("gc", "--unused-days", "0", "--with-runs")
    assert status == 0 and "18 items could go; nothing was removed" in out
    assert len(list(finished.store.glob("artifacts/*/*/*"))) == 18
    assert "freed" in finished.main("gc", "--unused-days", "0", "--with-runs", "--yes")[1]
    assert not list(finished.store.glob("artifacts/*/*/*"))


def test_gc_keeps_what_the_last_run_is_made_of_however_old(finished: Any) -> None:
    finished.run(camera={"static": True})  # which leaves no run folder
    for marker in finished.store.glob("artifacts/*/*/*/COMMIT"):
        os.utime(marker, (0, 0))
    finished.executed()
    assert "freed" in finished.main("gc", "--yes")[1]
    assert finished.main("recover", "film.mp4", "--out", "again")[0] == 0
    assert finished.executed() == []
    finished.run(camera={"static": True})
    assert {"camera:0", "camera:20", "camera:40"} <= set(finished.executed()), "what no run needs is gone"


def test_du_counts_every_stage(finished: Any) -> None:
    lines = finished.main("store", "du")[1].splitlines()
    assert [line.split()[:2] for line in lines[:3]] == [["decode", "1"], ["scenes", "1"], ["people", "2"]]
    assert lines[-1].split()[:2] == ["total", "18"]


@pytest.mark.parametrize("per", ["person", "shot"])
def test_eval_prints_the_figures_of_each_person_and_shot(finished: Any, per: str) -> None:
    status, out, _ = finished.main("eval", "runs/film", "runs/film", "--per", per, "--json")
    tree = json.loads(out)
    assert status == 0 and set(tree) == {f"per_{per}", "problems"}
    assert [one[per] for one in tree[f"per_{per}"]] == list(range(len(tree[f"per_{per}"]))) != []
    assert all("pa_mpjpe_mm" in one for one in tree[f"per_{per}"])
    status, out, _ = finished.main("eval", "runs/film", "runs/film", "--per", per)
    assert status == 0 and f"{per} 0" in out


def test_eval_prints_one_flat_object(finished: Any) -> None:
    status, out, _ = finished.main("eval", "runs/film", "runs/film", "--json")
    tree = json.loads(out)
    assert status == 0
    assert tree["cut_f1"] == 1.0 and isinstance(tree["problems"], list)
    assert not {"people", "shots"} & set(tree)
    status, out, message = finished.main("eval", "runs/film", "film.mp4", "--json")
    assert (status, out) == (1, "") and "film.mp4" in message
