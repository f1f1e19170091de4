"""Writes a rendered clip: `<name>.mp4`, its truth `<name>_gt.npz` and the silhouettes `<name>_masks.npz`.

The truth has motion.zarr's array names and attributes, and `transitions` (T,2): [start, end) of every change of shot.
Masks are `people/<nn>/mask` (F, H, ceil(W/8)) uint8; `np.unpackbits(m, axis=-1)[..., :W]` gives the pixels.
All files are the same bytes for the same clip.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from humanmm.models.rendering.rendered_clip import RenderedClip
from humanmm.models.video.colors import BT601
from humanmm.storage.run_folder.picture_files import write_video


def write_clip(rendered: RenderedClip, folder: Path) -> Path:
    """Write a clip into a folder as it is rendered; returns the video's path. The truth comes last: it says "done"."""
    clip = rendered.clip
    video = folder / f"{clip.plan.name}.mp4"
    write_video(
        video, rendered.pictures(), width=clip.width, height=clip.height, fps=clip.fps, colors=BT601, quality=clip.crf
    )
    write_arrays(folder / f"{clip.plan.name}_masks.npz", rendered.silhouettes())
    write_arrays(folder / f"{clip.plan.name}_gt.npz", rendered.truth())
    return video


def erase_clips(folder: Path) -> None:
    """Delete the clips that `write_clip` wrote into a folder, whatever their names; other files stay."""
    for truth in folder.glob("*_gt.npz"):
        name = truth.name.removesuffix("_gt.npz")
        truth.unlink()  # first: without it the rest is no clip
        for rest in (f"{name}.mp4", f"{name}_masks.npz"):
            (folder / rest).unlink(missing_ok=True)


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """A compressed npz; its bytes depend on the arrays alone."""
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
