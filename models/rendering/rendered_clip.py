"""A clip's pictures, and with them its truth: boxes, silhouettes and visible joints are known once all are rendered."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.rendering.renderer import render_frames
from humanmm.models.rendering.script import Clip
from humanmm.models.rendering.truth import joined, person_order, truth_arrays

Array = np.ndarray


class RenderedClip:
    """Renders a clip once; `truth` and `silhouettes` can be had after `pictures` is exhausted.

    A clip of several parts shows one after the other; `features` and `lost_s` (at every cut) go into its truth.
    """

    def __init__(self, *parts: Clip, features: Mapping[str, Any] | None = None, lost_s: Sequence[float] = ()) -> None:
        self.clip = parts[0]
        self._features, self._lost_s = features, lost_s
        self._parts = [_Part(part) for part in parts]

    def pictures(self) -> Iterator[tuple[float, UInt8[Array, "HplusHalf W"]]]:
        """Time in seconds and yuv420p planes of every frame."""
        pictures = (picture for part in self._parts for picture in part.pictures())
        for number, picture in enumerate(pictures):
            yield number / self.clip.fps, cv2.cvtColor(picture, cv2.COLOR_RGB2YUV_I420)

    def truth(self) -> dict[str, Array]:
        """Arrays with motion.zarr's names."""
        parts = [truth_arrays(part.clip, np.stack(part.joint_seen), part.boxes()) for part in self._parts]
        if self._features is None:
            return parts[0]
        return joined(parts, lost_s=self._lost_s, features=self._features)

    def silhouettes(self) -> dict[str, UInt8[Array, "F h bytes"]]:
        """`people/<nn>/mask`, packed along the rows; F are the frames of the person's part."""
        masks: dict[str, Array] = {}
        for part in self._parts:
            people = np.stack(part.masks, axis=1)
            for person in person_order(part.boxes()[: part.clip.subjects]):
                masks[f"people/{len(masks):02d}/mask"] = people[person]
        return masks


class _Part:
    """One part: its pictures, and what is noted as they are rendered."""

    def __init__(self, clip: Clip) -> None:
        self.clip = clip
        self.masks: list[UInt8[Array, "people h bytes"]] = []
        self.joint_seen: list[Array] = []

    def pictures(self) -> Iterator[UInt8[Array, "h w 3"]]:
        for frame in render_frames(self.clip):
            self.masks.append(np.packbits(frame.masks, axis=-1))
            self.joint_seen.append(frame.joint_seen)
            yield frame.image

    def boxes(self) -> Float[Array, "people F 4"]:
        """xyxy of each silhouette, pixels; zero where nothing is seen."""
        boxes = np.zeros((len(self.clip.actors), len(self.masks), 4))
        for frame, packed in enumerate(self.masks):
            for person, mask in enumerate(np.unpackbits(packed, axis=-1)[..., : self.clip.width]):
                rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
                if len(rows):
                    boxes[person, frame] = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
        return boxes
