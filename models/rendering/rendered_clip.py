"""A clip's pictures, and with them its truth: boxes, silhouettes and visible joints are known once all are rendered."""

from collections.abc import Iterator

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.rendering.renderer import render_frames
from humanmm.models.rendering.script import Clip
from humanmm.models.rendering.truth import person_order, truth_arrays

Array = np.ndarray


class RenderedClip:
    """Renders a clip once; `truth` and `silhouettes` can be had after `pictures` is exhausted."""

    def __init__(self, clip: Clip) -> None:
        self.clip = clip
        self._masks: list[UInt8[Array, "people h bytes"]] = []
        self._joint_seen: list[Array] = []

    def pictures(self) -> Iterator[tuple[float, UInt8[Array, "HplusHalf W"]]]:
        """Time in seconds and yuv420p planes of every frame."""
        for number, frame in enumerate(render_frames(self.clip)):
            self._masks.append(np.packbits(frame.masks, axis=-1))
            self._joint_seen.append(frame.joint_seen)
            yield number / self.clip.fps, cv2.cvtColor(frame.image, cv2.COLOR_RGB2YUV_I420)

    def truth(self) -> dict[str, Array]:
        """Arrays with motion.zarr's names."""
        return truth_arrays(self.clip, np.stack(self._joint_seen), self._boxes())

    def silhouettes(self) -> dict[str, UInt8[Array, "F h bytes"]]:
        """`people/<nn>/mask`, packed along the rows."""
        masks = np.stack(self._masks, axis=1)
        return {f"people/{rank:02d}/mask": masks[person] for rank, person in enumerate(person_order(self._boxes()))}

    def _boxes(self) -> Float[Array, "people F 4"]:
        """xyxy of each silhouette, pixels; zero where nothing is seen."""
        boxes = np.zeros((len(self.clip.actors), len(self._masks), 4))
        for frame, packed in enumerate(self._masks):
            for person, mask in enumerate(np.unpackbits(packed, axis=-1)[..., : self.clip.width]):
                rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
                if len(rows):
                    boxes[person, frame] = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
        return boxes
