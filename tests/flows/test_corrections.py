"""Corrections of a real run: each does to the delivered motion what it says, and people are not looked for again."""

from pathlib import Path

import numpy as np
import pytest
from short_clip import write_short_clip

import humanmm
from humanmm.correcting import Corrector
from humanmm.corrections import Corrections
from humanmm.models.body.body24 import load_body
from humanmm.models.records.landmarks import SWAP

CUT = 14
"""The clip's cut at 36, in the frames from 22 on that are kept."""


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.usefixtures("server_cache")
def test_corrections_of_a_real_run_do_what_they_say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_short_clip(tmp_path / "film.mp4", frames=(22, 50), max_side_px=640)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HUMANMM_STORE", str(tmp_path / "store"))
    before = humanmm.recover("film.mp4", "before", progress=False)
    make = Corrector(before.recording, before.record)
    world = (make.static_shot(0), make.height(0, 1.90), make.exclude(18, 22))
    after = humanmm.recover("film.mp4", "after", corrections=Corrections(correction=world), progress=False)
    assert all(one.applied and not one.reason for one in after.corrections)
    person, plain = after.people[0], before.people[0]
    assert load_body().standing_height(person.betas) == pytest.approx(1.90, abs=0.01)
    unseen = (person.frame >= 18) & (person.frame < 22)
    assert not person.observed[unseen].any() and person.observed[~unseen].all()
    assert np.isfinite(person.joints).all()
    assert set(after.cameras.source[:CUT].tolist()) == {3} and 3 not in after.cameras.source[CUT:]
    first = slice(0, CUT)
    depth = [
        np.linalg.norm((one.people[0].pelvis - one.cameras.t_world_cam)[first], axis=1).mean()
        for one in (after, before)
    ]
    heights = [load_body().standing_height(one.betas) for one in (person, plain)]
    assert depth[0] / depth[1] == pytest.approx(heights[0] / heights[1], rel=0.05), "the body's size is the scale"
    computed = {entry["stage"] for entry in after.record["stages"] if entry["state"] == "computed"}
    assert not computed & {"decode", "scenes", "people", "points", "keyframes", "intrinsics"}

    floor = Corrections(correction=(make.floor(-0.5),))
    raised = humanmm.recover("film.mp4", "raised", corrections=floor, progress=False)
    np.testing.assert_allclose(raised.people[0].joints - plain.joints, np.tile([0, 0, 0.5], (28, 24, 1)), atol=1e-5)
    assert {e["stage"] for e in raised.record["stages"] if e["state"] == "computed"} == {"refine", "deliver"}

    sides = Corrections(correction=tuple(make.sides(0, CUT, 28)))
    turned = humanmm.recover("film.mp4", "sides", corrections=sides, progress=False).people[0]
    np.testing.assert_array_equal(turned.keypoints2d[CUT:], plain.keypoints2d[CUT:][:, SWAP])

    one_shot = Corrections(correction=(make.remove_cut(CUT),))
    joined = humanmm.recover("film.mp4", "joined", corrections=one_shot, progress=False)
    assert [(shot.start, shot.end) for shot in joined.shots] == [(0, 28)]
    assert joined.corrections[0].applied
