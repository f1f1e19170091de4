"""A batch of 20 short videos, two workers, and everything going wrong for minutes: what must hold all the same.

The long version is `pytest -m chaos -s tests/flows/service/test_chaos.py`; its figures stand in docs/operations.md.
"""

import json
import os
import sys
import time
from collections import Counter
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import pytest
from chaos import ROOT, Machine, wait_for

from humanmm.storage.store.store import Store

CLIP = ROOT / "examples/pose2sim_multishot/pose2sim_A_01-02-01.mp4"
NUM_VIDEOS = 20
FRAMES_A_MINUTE = 3
"""Longer videos for a longer test: the work is to last about as long as the faults."""
AT_WORK = {"task": 1, "video": 2, "fork server": 4, "serve": 4, "full disk": 4}
"""Stages that a fault may interrupt: each of the two videos computes two, and both may be forks of one fork server. A
worker's and the server's death interrupts none."""
SEED = 5
NOTICED_S = 120.0
LIMIT_S = 1200.0

pytestmark = pytest.mark.timeout(7200)


@pytest.mark.parametrize(
    ("minutes", "where"),
    [
        pytest.param(2.0, "disk", marks=pytest.mark.server),
        pytest.param(15.0, "disk", marks=pytest.mark.chaos),
        pytest.param(15.0, "bucket", marks=pytest.mark.chaos),
    ],
)
def test_whatever_is_killed_damaged_or_full_every_video_ends_well_and_nothing_runs_twice(
    tmp_path: Path, request: pytest.FixtureRequest, minutes: float, where: str
) -> None:
    minutes = float(os.environ.get("CHAOS_MINUTES", minutes))
    bucket = request.getfixturevalue("bucket") if where == "bucket" else None
    machine = Machine(tmp_path / "machine", SEED, bucket)
    with machine.mounted() as small:
        _cut_clips(machine.disk / "clips", max(24, round(FRAMES_A_MINUTE * minutes)))
        with machine.served():
            began = time.monotonic()
            done = machine.humanmm("batch", "submit", "clips", "--run.isolate", "true")
            assert done.returncode == 0, done.stderr
            machine.torment(60 * minutes, fill=small)
            ended = Counter(video["state"] for video in machine.videos())
            wait_for(lambda: _has_ended(machine), LIMIT_S)
            lasted_s = time.monotonic() - began
            failed = [video for video in machine.videos() if video["state"] != "done"]
            wait_for(lambda: not machine.at_work(), NOTICED_S)
            executions = machine.executions()
            _report(machine, small=small, lasted_s=lasted_s, ended=ended, failed=failed)

            assert all(video["state"] in ("failed", "partial") and video["reason"] for video in failed), failed
            late = [f for f in machine.faults if f.noticed_s is not None and f.noticed_s > NOTICED_S]
            assert not late + machine.unnoticed(), "lost workers are noticed within two minutes"
            flips = [fault for fault in machine.faults if fault.kind == "flip"]
            assert executions.needless() == [] and len(executions.again()) <= len(flips)
            most = sum(AT_WORK.get(fault.kind, 0) for fault in machine.faults)
            assert executions.count()["cut short"] <= most, "what nobody had to interrupt was not interrupted"

            _check_store(machine)
            healed = machine.humanmm("batch", "retry-failed", "--wait")
            assert healed.returncode == 0, healed.stderr
            wait_for(lambda: not machine.at_work(), NOTICED_S)
        _check_content(machine)


def _has_ended(machine: Machine) -> bool:
    return not {"scheduled", "running"} & {video["state"] for video in machine.videos()}


def _check_store(machine: Machine) -> None:
    """Damage is what was flipped and not looked at since; after it was set aside, all is sound."""
    flipped = {fault.target for fault in machine.faults if fault.kind == "flip"}
    found = machine.humanmm("verify", "--deep").stdout.splitlines()
    damaged = {line.split(": ")[1] for line in found if line.startswith("damaged: ")}
    assert damaged <= flipped, "nothing else is damaged"
    again = machine.humanmm("verify", "--deep")
    assert again.returncode == 0, again.stdout


def _check_content(machine: Machine) -> None:
    """What the batch left is what a calm run gives, to the byte."""
    for name in ("00", "13"):
        calm = machine.folder / "calm"
        arguments = ["recover", f"clips/{name}.mp4", "--out", str(machine.folder / name), "--store", str(calm)]
        done = machine.humanmm(*arguments)
        assert done.returncode == 0, done.stderr
        assert _digests(machine.folder / name) == _digests(machine.disk / "runs" / name)
    assert not Store(calm).root.joinpath("damaged").exists()


def _digests(run_dir: Path) -> dict[tuple[str, str], str]:
    stages = json.loads((run_dir / "run.json").read_text())["stages"]
    return {(stage["stage"], stage["unit"]): stage["digest"] for stage in stages}


def _report(
    machine: Machine, *, small: bool, lasted_s: float, ended: Counter[str], failed: list[dict[str, Any]]
) -> None:
    """The figures, for `pytest -s` and docs/operations.md."""
    kinds = Counter(fault.kind for fault in machine.faults)
    lines = [f"faults: {dict(kinds)}" + ("" if small else " (no small disk could be mounted: none was filled)")]
    for kind in kinds:
        times = [fault.noticed_s for fault in machine.faults if fault.kind == kind and fault.noticed_s is not None]
        if times:
            lines.append(
                f"{kind}: noticed after {sum(times) / len(times):.1f} s on average, {max(times):.1f} s at most"
            )
    lines.append(f"videos when the faults ended: {dict(ended)}; all ended after {lasted_s:.0f} s")
    lines += [f"{Path(video['video']).name}: {video['state']}: {video['reason']}" for video in failed]
    executions = machine.executions()
    lines.append(f"executions: {dict(executions.count())}")
    lines.append(f"computed again after damage: {len(executions.again())}, needlessly: {len(executions.needless())}")
    sys.stdout.write("\n".join(["", *lines, ""]))


def _cut_clips(folder: Path, num_frames: int) -> None:
    """Videos of so many frames, each from another part of the shipped clip, going round at its end."""
    folder.mkdir()
    with av.open(str(CLIP)) as source:
        pictures = [frame.to_ndarray(format="rgb24") for frame in source.decode(video=0)]
    for number in range(NUM_VIDEOS):
        with av.open(str(folder / f"{number:02}.mp4"), "w") as target:
            stream = target.add_stream("libx264", rate=Fraction(60))
            stream.height, stream.width = pictures[0].shape[:2]
            stream.pix_fmt = "yuv420p"
            start = number * len(pictures) // NUM_VIDEOS
            for frame in range(start, start + num_frames):
                fresh = av.VideoFrame.from_ndarray(pictures[frame % len(pictures)], format="rgb24")
                target.mux(stream.encode(fresh))
            target.mux(stream.encode())
