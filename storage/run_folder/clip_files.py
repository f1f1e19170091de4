"""Writes a rendered clip: `<name>.mp4`, its truth `<name>_gt.npz` and the silhouettes `<name>_masks.npz`.

The truth has motion.zarr's array names and attributes, and `transitions` (T,2): [start, end) of every change of shot.
Masks are `people/<nn>/mask` (F, H, ceil(W/8)) uint8; `np.unpackbits(m, axis=-1)[..., :W]` gives the pixels.
All files are the same bytes for the same clip.
"""

import io
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import cv2
import numpy as np

from humanmm.models.rendering.renderer import Frame, render_frames
from humanmm.models.rendering.script import Clip
from humanmm.models.rendering.truth import truth_arrays
from humanmm.models.video.colors import BT601
from humanmm.storage.run_folder.picture_files import write_video

Array = np.ndarray

_EPOCH = (1980, 1, 1, 0, 0, 0)
"""Time stamp of every member: the zip format's first moment."""


def write_clip(clip: Clip, folder: Path) -> Path:
    """Render a clip into a folder; returns the video's path. Its truth is written last and says that it is done."""
    name = clip.plan.name
    masks: list[list[Array]] = [[] for _ in clip.actors]
    seen: list[Array] = []

    def pictures() -> Iterator[tuple[float, Array]]:
        for number, frame in enumerate(render_frames(clip)):
            _keep(frame, masks, seen)
            yield number / clip.fps, cv2.cvtColor(frame.image, cv2.COLOR_RGB2YUV_I420)

    video = folder / f"{name}.mp4"
    write_video(video, pictures(), width=clip.width, height=clip.height, fps=clip.fps, colors=BT601, quality=clip.crf)
    truth, order = truth_arrays(clip, np.stack(seen), np.stack([_boxes(one, clip.width) for one in masks]))
    silhouettes = {f"people/{rank:02d}/mask": np.stack(masks[person]) for rank, person in enumerate(order)}
    write_arrays(folder / f"{name}_masks.npz", silhouettes)
    write_arrays(folder / f"{name}_gt.npz", truth)
    return video


def write_arrays(path: Path, arrays: Mapping[str, Array]) -> None:
    """A compressed npz whose bytes depend on the arrays alone (numpy's own writer puts the time in)."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, array in arrays.items():
            data = io.BytesIO()
            np.lib.format.write_array(data, np.asanyarray(array), allow_pickle=False)
            member = zipfile.ZipInfo(f"{name}.npy", _EPOCH)
            member.compress_type = zipfile.ZIP_DEFLATED
            file.writestr(member, data.getvalue())


def _keep(frame: Frame, masks: list[list[Array]], seen: list[Array]) -> None:
    for kept, mask in zip(masks, frame.masks, strict=True):
        kept.append(np.packbits(mask, axis=-1))
    seen.append(frame.joint_seen)


def _boxes(masks: list[Array], width: int) -> Array:
    """(F,4) xyxy of each silhouette, pixels; zero where nothing is seen."""
    boxes = np.zeros((len(masks), 4))
    for box, packed in zip(boxes, masks, strict=True):
        mask = np.unpackbits(packed, axis=-1)[:, :width]
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        if len(rows):
            box[:] = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
    return boxes
