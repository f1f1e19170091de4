"""BVH files: what the joints do in the world, what a pack makes of it, and files that are none."""

import numpy as np
import pytest

from humanmm.errors import InputError
from humanmm.models.body.body24 import JOINT_NAMES, load_body
from humanmm.models.synthetic.mocap import leg_length
from humanmm.storage.readers.bvh import SOURCES, pack_arrays, parse_bvh

SIX = "CHANNELS 6 Xposition Yposition Zposition Xrotation Yrotation Zrotation"
ORDER = (
    "pelvis", "spine", "spine.001", "neck", "face", "shoulder.L", "upper_arm.L", "forearm.L", "shoulder.R",
    "upper_arm.R", "forearm.R", "thigh.L", "shin.L", "foot.L", "thigh.R", "shin.R", "foot.R",
)  # fmt: skip


def bvh(turns: dict[str, tuple[float, float, float]], *, frames: int = 4) -> str:
    """A skeleton whose joints all hang on the root, which is at (0.1, 0.7 + 0.2, 0)."""
    lines = ["HIERARCHY", "ROOT pelvis", "{", "OFFSET 0.0 0.7 0.0", SIX]
    for name in ORDER[1:]:
        length = 0.33 if name.startswith(("shin", "foot")) else 0.1
        lines += [f"JOINT {name}", "{", f"OFFSET 0.0 {-length} 0.0", SIX, "End Site", "{", "OFFSET 0 0 1", "}", "}"]
    values = [0.1, 0.2, 0.0, *turns.get("pelvis", (0, 0, 0))]
    for name in ORDER[1:]:
        values += [0, 0, 0, *turns.get(name, (0, 0, 0))]
    row = " ".join(map(str, values))
    return "\n".join([*lines, "}", "MOTION", f"Frames: {frames}", "Frame Time: 0.04", *[row] * frames])


def test_rotations_and_the_root_are_those_of_the_world() -> None:
    motion = parse_bvh(bvh({"pelvis": (0, 90, 0), "thigh.L": (30, 0, 0)}))
    assert motion.fps == pytest.approx(25)
    assert motion.leg_m == pytest.approx(0.66)
    np.testing.assert_allclose(motion.pelvis[0], [0.1, 0.9, 0.0])
    thigh = motion.R_world_joint[0, motion.names.index("thigh.L")]
    np.testing.assert_allclose(
        thigh @ [0, 0, 1], [np.cos(np.pi / 6), -0.5, 0], atol=1e-9
    )  # +z, down by 30°, then to +x


def test_a_pack_has_every_joint_and_the_rest_pose_is_zero() -> None:
    rest = load_body().rest_joints(np.zeros(10))
    assert {name.rpartition("_")[2] for name in JOINT_NAMES} == set(SOURCES)
    still = pack_arrays(parse_bvh(bvh({})), rest, leg_length(rest))
    np.testing.assert_allclose(still["poses"], 0, atol=1e-9)
    assert still["contacts"].all()
    turned = pack_arrays(parse_bvh(bvh({"pelvis": (0, 40, 0), "shin.L": (0, 40, 0)})), rest, leg_length(rest))
    np.testing.assert_allclose(turned["poses"][0, :3], [0, np.deg2rad(40), 0], atol=1e-9)
    np.testing.assert_allclose(turned["trans"][0], np.array([0.1, 0.9, 0]) * leg_length(rest) / 0.66)


@pytest.mark.parametrize("text", ["", "HIERARCHY\nMOTION\n", bvh({}).replace("Frames: 4", "Frames: 5")])
def test_what_is_no_bvh_is_an_input_error(text: str) -> None:
    with pytest.raises(InputError):
        parse_bvh(text)
