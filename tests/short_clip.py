"""A few frames of the shipped clip as a video of their own, and its run that tests share."""

import fcntl
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from humanmm.models.video.colors import read_colors
from humanmm.models.video.frames import joined, planar_frames, planar_size
from humanmm.models.video.reading import read_facts
from humanmm.storage.run_folder.picture_files import write_video

ROOT = Path(__file__).resolve().parent.parent
CLIP = ROOT / "examples/pose2sim_multishot/pose2sim_A_01-02-01.mp4"
TRUTH = CLIP.with_name(f"{CLIP.stem}_gt.npz")
CUTS = (36, 70)
FILM = (24, 82)
"""Frames of the clip, which has 60 a second, that the recovered film shows; both cuts are in it."""
STEP = 2
"""Every second of them: what recovering costs is by the frame."""
FILM_CUTS = tuple((cut - FILM[0]) // STEP for cut in CUTS)
FILM_LENGTH = (FILM[1] - FILM[0]) // STEP


def write_short_clip(path: Path, *, frames: tuple[int, int], max_side_px: int, step: int = 1) -> float:
    """Every step-th of the frames [start, end) of the clip, reduced; it is cut at `CUTS`. Returns pixels for one pixel
    of the clip."""
    with CLIP.open("rb") as stream:
        facts = read_facts(stream)
        width, height = planar_size(facts, max_side_px)
        pictures = (
            (f.time_s, joined(f.planes))
            for f in planar_frames(stream, facts, *frames, max_side_px=max_side_px)
            if (f.index - frames[0]) % step == 0
        )
        colors = read_colors(stream)
        write_video(path, pictures, width=width, height=height, fps=facts.fps / step, colors=colors, quality=18)
    return width / facts.width


def write_film_truth(path: Path, *, scale: float) -> None:
    """The truth of the film."""
    shown = slice(*FILM, STEP)
    with np.load(TRUTH) as truth:
        arrays = {name: truth[name][shown] if truth[name].shape[:1] == (100,) else truth[name] for name in truth}
    arrays["K"][:, :2] *= scale
    arrays["openpose2d"][..., :2] *= scale
    arrays |= {"cut_frames": np.array(FILM_CUTS), "fps": arrays["fps"] / STEP}
    np.savez(path, **arrays)


def recover_film(folder: Path) -> str:
    """Write `film.mp4` and `truth.npz` into a folder and recover the film as a user does: `run` and `store` beside it.
    Returns what the command printed.

    Of several processes that ask for the same folder one does it; the others wait for it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    said = folder / "stdout"
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not said.exists():
            scale = write_short_clip(folder / "film.mp4", frames=FILM, max_side_px=640, step=STEP)
            write_film_truth(folder / "truth.npz", scale=scale)
            environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "HUMANMM_STORE": str(folder / "store")}
            done = subprocess.run(
                [sys.executable, "-m", "humanmm.cli", "recover", "film.mp4", "--out", "run"],
                env=environment, cwd=folder, capture_output=True, text=True, check=False,
            )  # fmt: skip
            assert done.returncode == 0, done.stderr
            said.write_text(done.stdout)
    return said.read_text()
