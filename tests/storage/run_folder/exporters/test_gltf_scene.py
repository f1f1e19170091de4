"""The glTF scene, read again as the specification says, and by the Khronos validator."""

import dataclasses
import json
import os
import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import two_people
from hand_points import with_hands
from scipy.spatial.transform import Rotation, Slerp

from humanmm.models.body.body24 import JOINT_NAMES, load_body
from humanmm.models.body.fingers import JOINT_NAMES_52, load_body52
from humanmm.models.body.kinematics import forward_kinematics, skinning_transforms
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.excerpt import Wishes
from humanmm.models.records.recording import Recording
from humanmm.storage.run_folder.exporters import export

RECORDING = two_people.recording()
YUP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""World axes (z up) to glTF's."""


class Scene:
    """A .glb and its nodes at any time."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        magic, version, length = struct.unpack("<4sII", data[:12])
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack("<I4s", data[12:20])
        assert kind == b"JSON"
        self.tree: dict[str, Any] = json.loads(data[20 : 20 + size])
        self.binary = data[28 + size :]
        self.nodes = self.tree["nodes"]

    def array(self, accessor: int) -> np.ndarray:
        about = self.tree["accessors"][accessor]
        view = self.tree["bufferViews"][about["bufferView"]]
        dtype = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}[about["componentType"]]
        shape = {"SCALAR": (), "VEC3": (3,), "VEC4": (4,), "MAT4": (4, 4)}[about["type"]]
        count = about["count"] * int(np.prod(shape))
        values = np.frombuffer(self.binary, dtype, count, view["byteOffset"]).reshape(about["count"], *shape)
        return values.swapaxes(-1, -2) if shape == (4, 4) else values

    def node(self, name: str) -> int:
        (found,) = (index for index, node in enumerate(self.nodes) if node["name"] == name)
        return int(found)

    def local(self, seconds: float, animation: str = "scene") -> list[np.ndarray]:
        """Matrix of every node in its parent's axes."""
        (moves,) = (one for one in self.tree.get("animations", []) if one["name"] == animation)
        values = [
            {key: np.array(node[key], float) for key in ("translation", "rotation", "scale") if key in node}
            for node in self.nodes
        ]
        for channel in moves["channels"]:
            sampler, target = moves["samplers"][channel["sampler"]], channel["target"]
            if target["path"] == "pointer":
                continue
            times, keys = self.array(sampler["input"]).astype(float), self.array(sampler["output"]).astype(float)
            at = np.clip(seconds, times[0], times[-1])
            if sampler["interpolation"] == "STEP":
                value = keys[np.searchsorted(times, at, side="right") - 1]
            elif target["path"] == "rotation":
                value = Slerp(times, Rotation.from_quat(keys))(at).as_quat()
            else:
                value = np.array([np.interp(at, times, column) for column in keys.T])
            values[target["node"]][target["path"]] = value
        matrices = []
        for parts in values:
            matrix = np.eye(4)
            turn = Rotation.from_quat(parts.get("rotation", [0, 0, 0, 1])).as_matrix()
            matrix[:3, :3] = turn * parts.get("scale", np.ones(3))
            matrix[:3, 3] = parts.get("translation", 0)
            matrices.append(matrix)
        return matrices

    def world(self, seconds: float, animation: str = "scene") -> list[np.ndarray]:
        """Matrix of every node in the axes of the scene."""
        local = self.local(seconds, animation)
        found = list(local)

        def visit(node: int) -> None:
            for child in self.nodes[node].get("children", []):
                found[child] = found[node] @ local[child]
                visit(child)

        for root in self.tree["scenes"][0]["nodes"]:
            visit(root)
        return found

    def joints(self, person: int, seconds: float, animation: str = "scene") -> np.ndarray:
        (skin,) = (one for one in self.tree["skins"] if one["name"] == f"person_{person:02d}")
        matrices = self.world(seconds, animation)
        assert [self.nodes[joint]["name"] for joint in skin["joints"]] == list(JOINT_NAMES)
        return np.stack([matrices[joint][:3, 3] for joint in skin["joints"]])


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return Scene(export(RECORDING, tmp_path_factory.mktemp("glb"), "glb")[0])


def test_all_people_are_where_they_are_in_every_frame_of_the_one_animation(scene: Scene) -> None:
    for frame in range(0, 40, 3):
        for person in RECORDING.people:
            row = frame - int(person.frame[0])
            if 0 <= row < len(person.frame):
                found = scene.joints(person.person, RECORDING.time_s[frame])
                assert np.abs(found - person.joints[row] @ YUP.T).max() < 1e-5


def test_each_of_several_people_has_an_animation_of_his_own_too(scene: Scene) -> None:
    assert [one["name"] for one in scene.tree["animations"]] == ["scene", "person_00", "person_01"]
    found = scene.joints(1, RECORDING.time_s[20], "person_01")
    assert np.abs(found - RECORDING.people[1].joints[15] @ YUP.T).max() < 1e-5


def test_a_variable_frame_rate_keeps_its_exact_times(tmp_path: Path) -> None:
    times = 5 + np.cumsum(np.random.default_rng(3).uniform(0.02, 0.05, 40))
    recording = two_people.recording(time_s=times)
    varying = Scene(export(recording, tmp_path, "glb")[0])
    for frame in (0, 17, 39):
        found = varying.joints(0, times[frame] - times[0])
        assert np.abs(found - recording.people[0].joints[frame] @ YUP.T).max() < 1e-4


def test_somebody_is_hidden_before_he_comes_and_after_he_leaves(scene: Scene) -> None:
    times = RECORDING.time_s
    moments = times[[4, 5, 34, 35]] + 1e-4  # key times are float32
    height = [float(np.ptp(scene.joints(1, seconds)[:, 1])) for seconds in moments]
    assert height[0] == height[3] == 0 and min(height[1:3]) > 0.5
    assert not any(channel["target"]["path"] == "scale" for channel in scene.tree["animations"][1]["channels"])
    assert scene.nodes[scene.node("person_01")]["extras"]["observed_frames"] == [[5, 13], [17, 35]]


def test_who_is_not_seen_for_long_is_hidden_and_his_motion_stays(tmp_path: Path) -> None:
    recording = two_people.recording(num_frames=60, fps=10.0)
    seen = np.ones(60, bool)
    seen[20:50] = False
    recording = dataclasses.replace(recording, people=(dataclasses.replace(recording.people[0], observed=seen),))
    moments = recording.time_s[[19, 20, 49, 50]] + 1e-4
    scene = Scene(export(recording, tmp_path / "hidden", "glb")[0])
    height = [float(np.ptp(scene.joints(0, seconds)[:, 1])) for seconds in moments]
    assert height[1] == height[2] == 0 and min(height[0], height[3]) > 0.5
    extras = scene.nodes[scene.node("person_00")]["extras"]
    assert extras["shown_frames"] == extras["observed_frames"] == [[0, 20], [50, 60]]
    kept = Scene(export(recording, tmp_path / "kept", "glb", wishes=Wishes(keep_unseen=True))[0])
    for row in (19, 20, 49, 50):
        found = kept.joints(0, recording.time_s[row] + 1e-4)
        assert np.abs(found - recording.people[0].joints[row] @ YUP.T).max() < 1e-2
    assert kept.nodes[kept.node("person_00")]["extras"]["shown_frames"] == [[0, 60]]


def test_the_extras_say_which_world_each_shot_person_and_camera_is_of(tmp_path: Path) -> None:
    apart = dataclasses.replace(RECORDING, worlds=(0, 1))
    scene = Scene(export(apart, tmp_path, "glb")[0])
    shots = scene.tree["scenes"][0]["extras"]["shots"]
    cut = two_people.CUT
    assert shots == [{"shot": 0, "frames": [0, cut], "world": 0}, {"shot": 1, "frames": [cut, 40], "world": 1}]
    worlds = {node["name"]: node["extras"]["world"] for node in scene.nodes if "extras" in node}
    assert worlds == {"person_00": 0, "person_01": 0, "camera_shot_000": 0, "camera_shot_001": 1}


def test_the_skin_is_that_of_the_posed_body(scene: Scene) -> None:
    person, row, body = RECORDING.people[0], 12, load_body()
    mesh = scene.tree["meshes"][0]["primitives"][0]["attributes"]
    skin = scene.tree["skins"][0]
    vertices, weights = scene.array(mesh["POSITION"]), scene.array(mesh["WEIGHTS_0"])
    matrices = scene.world(RECORDING.time_s[row])
    bind = scene.array(skin["inverseBindMatrices"])
    pose = np.stack([matrices[joint] @ bind[index] for index, joint in enumerate(skin["joints"])])
    moved = np.einsum("vk,vkab,vb->va", weights, pose[scene.array(mesh["JOINTS_0"])][..., :3, :], _one(vertices))
    rest, R_root = body.rest_joints(person.betas), rotvec_to_rotmat(person.root_orient[row : row + 1])
    joints, R = forward_kinematics(rest, R_root, person.body_pose[row : row + 1], person.pelvis[row : row + 1])
    transforms = skinning_transforms(rest, joints, R)[0][body.skin_joint]
    expected = np.einsum("vk,vkab,vb->va", body.skin_weight, transforms, _one(body.rest_vertices(person.betas)))
    assert np.abs(moved - expected @ YUP.T).max() < 1e-4
    assert scene.array(mesh["JOINTS_0"])[weights == 0].max(initial=0) == 0


def _one(points: np.ndarray) -> np.ndarray:
    return np.concatenate([points, np.ones((len(points), 1))], axis=1)


def test_a_joint_falls_on_the_same_pixel_of_the_camera_of_its_shot(scene: Scene) -> None:
    for shot, frames in ((0, (0, 11, 24)), (1, (25, 32, 39))):
        node = scene.node(f"camera_shot_{shot:03d}")
        for frame in frames:
            seconds = RECORDING.time_s[frame]
            pose, yfov = scene.world(seconds)[node], _yfov(scene, node, seconds)
            cam = (scene.joints(0, seconds) - pose[:3, 3]) @ pose[:3, :3]
            focal = 360 / np.tan(yfov / 2)
            pixels = np.stack([640 + focal * cam[:, 0] / -cam[:, 2], 360 - focal * cam[:, 1] / -cam[:, 2]], 1)
            world = (RECORDING.people[0].joints[frame] - RECORDING.t_world_cam[frame]) @ RECORDING.R_world_cam[frame]
            expected = world @ RECORDING.K[frame].T
            assert np.abs(pixels - expected[:, :2] / expected[:, 2:]).max() < 0.05


def _yfov(scene: Scene, node: int, seconds: float) -> float:
    """The vertical angle of a camera, zoomed by KHR_animation_pointer."""
    camera = scene.nodes[node]["camera"]
    moves = scene.tree["animations"][0]
    for channel in moves["channels"]:
        pointer = channel["target"].get("extensions", {}).get("KHR_animation_pointer", {}).get("pointer")
        if pointer == f"/cameras/{camera}/perspective/yfov":
            sampler = moves["samplers"][channel["sampler"]]
            return float(np.interp(seconds, scene.array(sampler["input"]), scene.array(sampler["output"])))
    return float(scene.tree["cameras"][camera]["perspective"]["yfov"])


def test_a_camera_that_zooms_names_the_extension_and_one_that_does_not_needs_none(scene: Scene, tmp_path: Path) -> None:
    assert scene.tree["extensionsUsed"] == ["KHR_animation_pointer"]
    first = export(RECORDING, tmp_path, "glb", wishes=Wishes(end_s=float(RECORDING.time_s[two_people.CUT])))[0]
    assert "extensionsUsed" not in Scene(first).tree


def test_a_video_with_nobody_in_it_gives_the_cameras(tmp_path: Path) -> None:
    alone = Scene(export(two_people.recording(), tmp_path, "glb", wishes=Wishes(end_s=0.1, people=(1,)))[0])
    assert [node["name"] for node in alone.nodes] == ["camera_shot_000"]
    assert "meshes" not in alone.tree


VALIDATE = """
const validator = require(process.argv[1]);
const data = new Uint8Array(require("fs").readFileSync(process.argv[2]));
validator.validateBytes(data).then((report) => console.log(JSON.stringify(report.issues)));
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "recording",
    [RECORDING, two_people.recording(num_frames=1), two_people.recording(num_frames=20), with_hands(RECORDING)],
    ids=["two shots", "one frame", "one shot", "hands"],
)
def test_the_khronos_validator_finds_no_error_and_no_warning(tmp_path: Path, recording: Recording) -> None:
    package = os.environ.get("HUMANMM_GLTF_VALIDATOR")
    if not package:
        pytest.skip("npm install gltf-validator, and name node_modules/gltf-validator in $HUMANMM_GLTF_VALIDATOR")
    path = export(recording, tmp_path, "glb")[0]
    done = subprocess.run(
        ["node", "-e", VALIDATE, package, str(path)], capture_output=True, text=True, check=True
    )  # fmt: skip
    issues = json.loads(done.stdout)
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]


def test_hands_are_skinned_fingers_in_the_same_scene(tmp_path: Path) -> None:
    recording = with_hands(RECORDING)
    scene = Scene(export(recording, tmp_path, "glb")[0])
    (skin,) = (one for one in scene.tree["skins"] if one["name"] == "person_00")
    assert [scene.nodes[joint]["name"] for joint in skin["joints"]] == list(JOINT_NAMES_52)
    (primitive,) = scene.tree["meshes"][0]["primitives"]
    joint, weight = (scene.array(primitive["attributes"][name]) for name in ("JOINTS_0", "WEIGHTS_0"))
    assert set(range(22, 52)) <= set(joint[weight > 0.5].tolist())
    person, body = recording.people[0], load_body52()
    rest = body.rest_joints(person.betas)
    R_root = rotvec_to_rotmat(person.root_orient[[10]])
    ours, _ = forward_kinematics(rest, R_root, person.pose(slice(10, 11)), person.pelvis[[10]], body.parents)
    matrices = scene.world(RECORDING.time_s[10])
    found = np.stack([matrices[joint][:3, 3] for joint in skin["joints"]])
    assert np.abs(found - ours[0] @ YUP.T).max() < 1e-4
