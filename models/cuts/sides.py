"""What is seen of the people on the two sides of a cut."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.records.landmarks import with_sides_swapped

Array = np.ndarray


@dataclass(frozen=True)
class SideTrack:
    """One person near one side of a cut, left and right resolved, oldest frame first."""

    time_s: Float[Array, "n"]
    keypoints2d: Float[Array, "n 33 3"]
    """Source pixels and visibility."""
    landmarks3d: Float[Array, "n 33 3"]
    """Metres about the mid-hip, axes parallel to the viewing ray (as the pose network gives them)."""
    R_cam_root: Float[Array, "n 3 3"] | None
    """Fitted root orientation in camera axes, if there is one."""
    R_cut_cam: Float[Array, "n 3 3"]
    """Axes of each frame's camera to those of this side's camera at the cut."""

    def sides_swapped(self) -> "SideTrack":
        """The same with left and right swapped, and without the body that was fitted to them."""
        swapped = np.ones(len(self.time_s), bool)
        return replace(
            self,
            keypoints2d=with_sides_swapped(self.keypoints2d, swapped),
            landmarks3d=with_sides_swapped(self.landmarks3d, swapped),
            R_cam_root=None,
        )


@dataclass(frozen=True)
class CutPerson:
    """One person on both sides of a cut."""

    before: SideTrack
    after: SideTrack


@dataclass(frozen=True)
class CutCameras:
    """What is known of the two cameras at a cut."""

    K_before: Float[Array, "3 3"]
    K_after: Float[Array, "3 3"]
    moving: bool
    """Either camera travels (not only rotates) near the cut."""
