"""BVH files, read again by a parser of their own."""

from pathlib import Path

import numpy as np
import pytest
import two_people
from hand_points import with_hands
from scipy.spatial.transform import Rotation

from humanmm.models.body.body24 import JOINT_NAMES
from humanmm.models.body.fingers import JOINT_NAMES_52, load_body52
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.excerpt import Wishes
from humanmm.storage.run_folder.exporters import export
from humanmm.storage.run_folder.exporters.bvh import euler_zxy_deg, nearest_angles


class Bvh:
    """Joints of a file over time, as any reader finds them: offsets, channels in the order in which they stand."""

    def __init__(self, path: Path) -> None:
        words = iter(path.read_text().split())
        self.names: list[str] = []
        self.parents: list[int] = []
        self.offsets: list[list[float]] = []
        self.channels: list[list[str]] = []
        open_joints: list[int] = []
        for word in words:
            if word in ("ROOT", "JOINT", "End"):
                self.parents.append(open_joints[-1] if open_joints else -1)
                self.names.append(next(words) if word != "End" else f"{self.names[open_joints[-1]]}_End")
                self.channels.append([])
            elif word == "{":
                open_joints.append(len(self.names) - 1)
            elif word == "}":
                open_joints.pop()
            elif word == "OFFSET":
                self.offsets.append([float(next(words)) for _ in range(3)])
            elif word == "CHANNELS":
                self.channels[-1] = [next(words) for _ in range(int(next(words)))]
            elif word == "MOTION":
                break
        assert next(words) == "Frames:"
        num_frames = int(next(words))
        assert (next(words), next(words)) == ("Frame", "Time:")
        self.frame_time = float(next(words))
        self.motion = np.array([float(word) for word in words]).reshape(num_frames, -1)

    def joints(self) -> dict[str, np.ndarray]:
        """(N,3) position of each joint and end."""
        column, R, p = 0, [], []
        for joint, (parent, offset) in enumerate(zip(self.parents, self.offsets, strict=True)):
            here = np.tile(np.array(offset), (len(self.motion), 1))
            turn = Rotation.identity(len(self.motion))
            for channel in self.channels[joint]:
                values = self.motion[:, column]
                column += 1
                if channel.endswith("position"):
                    here[:, "XYZ".index(channel[0])] += values
                else:
                    turn = turn * Rotation.from_euler(channel[0], values[:, None], degrees=True)
            R.append(turn if parent < 0 else R[parent] * turn)
            p.append(here if parent < 0 else p[parent] + R[parent].apply(here))
        return dict(zip(self.names, p, strict=True))


@pytest.mark.parametrize(
    ("wishes", "axes", "scale"),
    [
        (Wishes(), [[1, 0, 0], [0, 0, 1], [0, -1, 0]], 100),
        (Wishes(up="z", unit="m"), np.eye(3), 1),
        (Wishes(up="z", unit="cm"), np.eye(3), 100),
    ],
)
def test_forward_kinematics_of_the_file_gives_the_joints_of_the_run(
    tmp_path: Path, wishes: Wishes, axes: object, scale: float
) -> None:
    recording = two_people.recording()
    for path, person in zip(export(recording, tmp_path, "bvh", wishes=wishes), recording.people, strict=True):
        bvh = Bvh(path)
        joints = bvh.joints()
        found = np.stack([joints[name] for name in JOINT_NAMES], axis=1)
        assert np.abs(found / scale - person.joints @ np.array(axes).T).max() < 1e-5, "metres"
        assert bvh.frame_time == pytest.approx(1 / 29.97, rel=1e-6)
        assert len(bvh.motion) == len(person.frame)


def test_the_skeleton_is_the_persons_own_and_ends_at_its_skin(tmp_path: Path) -> None:
    recording = two_people.recording()
    bvh = Bvh(export(recording, tmp_path, "bvh")[0])
    names = {name: np.array(offset) for name, offset in zip(bvh.names, bvh.offsets, strict=True)}
    joints = recording.people[0].joints[0].astype(float)
    thigh = np.linalg.norm(joints[JOINT_NAMES.index("L_Knee")] - joints[JOINT_NAMES.index("L_Hip")])
    assert np.linalg.norm(names["L_Knee"]) == pytest.approx(100 * thigh, abs=1e-3)
    assert 10 < names["Head_End"][1] < 30 and 3 < names["L_Foot_End"][2] < 15
    assert 3 < names["L_Hand_End"][0] < 20 and -20 < names["R_Hand_End"][0] < -3
    assert names["Pelvis"].tolist() == [0, 0, 0]


def test_curves_have_no_jumps_though_the_person_turns_round_and_round(tmp_path: Path) -> None:
    recording = two_people.recording(num_frames=300)
    bvh = Bvh(export(recording, tmp_path, "bvh", wishes=Wishes(people=(0,)))[0])
    root = bvh.motion[:, 3:6]
    assert np.abs(np.diff(root, axis=0)).max() < 30, "degrees from frame to frame"
    assert np.ptp(root[:, 2]) > 500, "he turned more than once"


def test_a_variable_rate_becomes_the_mean_one(tmp_path: Path) -> None:
    times = np.cumsum(np.random.default_rng(3).uniform(0.02, 0.05, 40))
    recording = two_people.recording(time_s=times)
    bvh = Bvh(export(recording, tmp_path, "bvh")[0])
    assert bvh.frame_time == pytest.approx((times[-1] - times[0]) / 39)
    at_s = times[0] + np.arange(len(bvh.motion)) * bvh.frame_time
    height = np.interp(at_s, times, recording.people[0].pelvis[:, 2])
    np.testing.assert_allclose(bvh.joints()["Pelvis"][:, 1], 100 * height, atol=1e-3)


def test_angles_are_those_of_scipy_and_stay_finite_where_two_axes_coincide() -> None:
    R = Rotation.random(200, random_state=1).as_matrix()
    found = Rotation.from_euler("ZXY", euler_zxy_deg(R), degrees=True).as_matrix()
    np.testing.assert_allclose(found, R, atol=1e-12)
    locked = Rotation.from_euler("ZXY", [[30, 90, 20], [30, -90, 20]], degrees=True).as_matrix()
    found = Rotation.from_euler("ZXY", euler_zxy_deg(locked), degrees=True).as_matrix()
    np.testing.assert_allclose(found, locked, atol=1e-7)


def test_the_nearest_angles_are_the_same_rotation() -> None:
    rng = np.random.default_rng(2)
    angles, before = rng.uniform(-180, 180, (50, 3)), rng.uniform(-900, 900, (50, 3))
    near = nearest_angles(angles, before)
    as_matrix = [Rotation.from_euler("ZXY", one, degrees=True).as_matrix() for one in (angles, near)]
    np.testing.assert_allclose(*as_matrix, atol=1e-9)
    assert (np.abs(near - before).sum(1) <= np.abs(angles - before).sum(1) + 1e-9).all()


def test_hands_make_a_skeleton_of_52_joints_whose_fingers_are_where_ours_are(tmp_path: Path) -> None:
    recording = with_hands(two_people.recording())
    person, body = recording.people[0], load_body52()
    joints = Bvh(export(recording, tmp_path, "bvh", wishes=Wishes(up="z", unit="m"))[0]).joints()
    assert [name for name in joints if not name.endswith("_End")] != list(JOINT_NAMES_52)  # depth first, as in any BVH
    assert {name for name in joints if not name.endswith("_End")} == set(JOINT_NAMES_52)
    R_root = rotvec_to_rotmat(person.root_orient)
    rest = body.rest_joints(person.betas)
    ours, _ = forward_kinematics(rest, R_root, person.pose(), person.pelvis, body.parents)
    for j, name in enumerate(JOINT_NAMES_52):
        assert np.abs(joints[name] - ours[:, j]).max() < 1e-3
    tip = joints["L_Index3_End"] - joints["L_Index3"]
    assert 0.01 < np.linalg.norm(tip, axis=1).mean() < 0.04
