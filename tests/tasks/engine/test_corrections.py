"""A correction reaches the stages that it concerns, and no others are computed again; one that does not fit is told."""

import json
from pathlib import Path
from typing import Any

import humanmm
from humanmm.config import Config
from humanmm.storage.run_folder.corrections_file import decided
from humanmm.tasks import pipeline
from humanmm.tasks.engine.finish import write_results

WHO = {"frame": 5, "x": 1.0, "y": 2.0}
EVERY_HMR = ["hmr:0", "hmr:20", "hmr:40"]


def _corrected(*entries: dict[str, Any]) -> dict[str, Any]:
    return {"corrections": {"correction": list(entries)}}


COMPUTED: tuple[tuple[dict[str, Any], list[str]], ...] = (
    ({"kind": "floor", "metres": 0.5}, ["deliver", "refine"]),
    ({"kind": "static-shot", "frame": 25}, ["align", "camera:20", "deliver", "hmr:20", "refine"]),
    (
        {"kind": "focal", "px": 900.0},
        ["align", "camera:0", "camera:20", "camera:40", "deliver", *EVERY_HMR, "intrinsics", "refine"],
    ),
    ({"kind": "height", "who": WHO, "metres": 1.8}, ["align", "deliver", *EVERY_HMR, "refine", "shots"]),
    ({"kind": "nobody", "who": WHO}, ["shots"]),  # the toy does not look at it: all else is as it was
    ({"kind": "exclude", "start": 5, "end": 9}, ["shots"]),
)


def test_only_what_depends_on_a_correction_is_computed_again(toy: Any) -> None:
    toy.run()
    for entry, computed in COMPUTED:
        toy.executed()
        toy.run(**_corrected(entry))
        assert toy.executed() == computed, entry
        toy.run()
        assert toy.executed() == [], "without it, everything is in the store"


def test_a_new_cut_computes_people_again_in_its_own_scene_alone(toy: Any) -> None:
    toy.run()
    toy.executed()
    toy.run(**_corrected({"kind": "add-cut", "frame": 50}))
    executed = toy.executed()
    assert [name for name in executed if name.startswith("people")] == ["people:20", "people:50"]
    assert [name for name in executed if name.startswith(("points", "scenes"))] == ["points:20", "points:50", "scenes"]
    assert "camera:0" not in executed and "hmr:0" not in executed, "the first scene is as it was"


def test_the_store_says_which_correction_made_a_stage_run_again(toy: Any) -> None:
    toy.run()
    run = toy.run(**_corrected({"kind": "floor", "metres": 0.5}))
    assert "setting changed: corrections.1 (absent) → {'kind': 'floor'" in run.outcomes["refine", 0].reason


def test_every_kind_concerns_a_stage() -> None:
    named = {kind for stage in pipeline.STAGES for kind in stage.corrections}
    from humanmm.corrections import NAMES

    assert named == set(NAMES)


def test_what_became_of_corrections_stands_in_the_record_and_a_misfit_among_the_warnings(toy: Any) -> None:
    out = toy.folder / "runs" / "film"
    fits = {"kind": "floor", "metres": 0.5}
    run = toy.run(
        corrections={
            "correction": [
                {"kind": "remove-cut", "frame": 31}, {"kind": "add-cut", "frame": 70},
                {"kind": "static-shot", "frame": 99}, fits,
            ]
        }
    )  # fmt: skip
    write_results(run, out, started=0.0)
    done = humanmm.load(out)
    assert [one.applied for one in done.corrections] == [False, False, False, True]
    cut, late, static, floor = (one.reason for one in done.corrections)
    assert cut == "no cut is found there; the nearest is at frame 20"
    assert late == "the video ends with frame 59" and static.startswith("frame 99 does not exist") and floor == ""
    message = [warning for warning in done.warnings if "does not fit" in warning]
    assert len(message) == 3 and message[0].startswith(
        "correction 1 does not fit (no cut at frame 31): no cut is found"
    )
    assert done.corrections[3].correction == fits and done.config.corrections.correction[3].kind == "floor"


def test_corrections_of_another_video_are_applied_with_a_warning(toy: Any) -> None:
    out = toy.folder / "runs" / "film"
    run = toy.run(corrections={"video": "ab12", "correction": [{"kind": "floor", "metres": 0.5}]})
    write_results(run, out, started=0.0)
    record = json.loads((Path(out) / "run.json").read_text())
    assert record["corrections"][0]["applied"] is True
    assert (
        "correction 1 (the floor is 0.5 m above the one that is found): it was written for another video"
        in record["warnings"]
    )


def test_corrections_of_the_folder_that_were_written_for_another_video_are_left_aside_with_a_warning(toy: Any) -> None:
    toy.run()
    out = toy.folder / "runs" / "film"
    out.mkdir(parents=True)
    (out / "corrections.toml").write_text('video = "ab12"\n[[correction]]\nkind = "floor"\nmetres = 0.5\n')
    config = decided(Config(), out, sha256=toy.open().video.sha256)
    toy.executed()
    run = toy.run(corrections=config.corrections)
    assert toy.executed() == [], "nothing is computed with them"
    write_results(run, out, started=0.0)
    done = humanmm.load(out)
    (one,) = done.corrections
    assert not one.applied and one.reason.startswith("it was written for another video (`--corrections ")
    assert any("does not fit" in warning for warning in done.warnings)
