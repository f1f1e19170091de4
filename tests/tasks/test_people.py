"""Stage `people`: what the user brings along takes the place of what would look for it."""

import json
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import three_shots
import torch
from held_results import identity_of, inputs_of
from short_clip import write_short_clip

from humanmm.config import LiftingConfig
from humanmm.errors import InputError
from humanmm.models.body.smpl_joints import SMPLX_REST_PELVIS
from humanmm.models.geometry.boxes import box_iou
from humanmm.models.geometry.rotations import rotmat_to_rotvec
from humanmm.models.perception.lifting.lift import lift
from humanmm.models.perception.lifting.lifted import person_frames
from humanmm.models.perception.lifting.reading import load_lifter
from humanmm.models.records.landmarks import COCO_LANDMARKS, HIPS
from humanmm.models.records.shots import Scenes
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.reading import read_facts
from humanmm.storage.training.networks import write_network
from humanmm.tasks.people import lifter_of, people

N = three_shots.LENGTH
_, SEEN, _, FITTED = three_shots.shot_of(0)
TRUTH = SEEN.tracks[0]


def _unopened(**settings: Any) -> ScenePeople:
    """People of a video that nobody opens."""
    facts = VideoFacts(960, 540, np.arange(N) / three_shots.FPS, np.arange(N) == 0, 0, "h264", "mp4")
    return people(inputs_of("people", {"decode": facts, "scenes": Scenes(N, ())}, people=settings))


def test_keypoints_of_another_program_are_the_people_and_no_more_of_them_than_the_user_wants(tmp_path: Path) -> None:
    him = TRUTH.keypoints2d[:, list(COCO_LANDMARKS)]
    other = him + np.float32([250, 0, 0])
    rows = [
        {"image_id": f"{f}.jpg", "category_id": 1, "keypoints": points[f].ravel().tolist(), "score": 2.5}
        for f in range(N)
        for points in (him, other)
    ]
    (tmp_path / "keypoints.json").write_text(json.dumps(rows))
    both = _unopened(keypoints_from=str(tmp_path / "keypoints.json"))
    assert len(both.tracks) == 2 and all(track.lifted for track in both.tracks)
    (track,) = (t for t in both.tracks if abs(t.keypoints2d[0, 0, 0] - him[0, 0, 0]) < 1)
    np.testing.assert_allclose(track.keypoints2d[:, list(COCO_LANDMARKS), :2], him[..., :2] + 0.5, atol=0.01)
    assert len(_unopened(keypoints_from=str(tmp_path / "keypoints.json"), max_people=1).tracks) == 1


def test_bodies_of_another_system_are_the_people(tmp_path: Path) -> None:
    (motion,) = FITTED.people
    arrays = {
        "global_orient": rotmat_to_rotvec(motion.R_cam_root), "body_pose": motion.body_pose[:, :21].reshape(N, 63),
        "transl": motion.pelvis_cam - SMPLX_REST_PELVIS, "betas": np.zeros((N, 10)),
    }  # fmt: skip
    K = np.tile(np.array([[900.0, 0, 480], [0, 900, 270], [0, 0, 1]]), (N, 1, 1))
    tensors = {name: torch.from_numpy(np.asarray(value)).float() for name, value in arrays.items()}
    torch.save({"smpl_params_incam": tensors, "K_fullimg": torch.from_numpy(K).float()}, tmp_path / "gvhmr.pt")
    (track,) = _unopened(hmr_from=str(tmp_path / "gvhmr.pt")).tracks
    np.testing.assert_array_equal(track.frame, np.arange(N))
    seen = track.keypoints2d[..., 2] > 0
    error_px = np.linalg.norm(track.keypoints2d[..., :2] - TRUTH.keypoints2d[..., :2], axis=-1)
    assert np.median(error_px[seen]) < 10, "the landmarks of the same body"


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three frames of the shipped clip, in which one man is seen."""
    path = tmp_path_factory.mktemp("clip") / "film.mp4"
    write_short_clip(path, frames=(40, 43), max_side_px=640)
    return path


def test_boxes_of_another_program_say_where_people_are_looked_for(clip: Path, tmp_path: Path) -> None:
    with clip.open("rb") as stream:
        facts = read_facts(stream)

    def looked(**settings: Any) -> ScenePeople:
        results = {"decode": facts, "scenes": Scenes(3, ())}
        given = {"pose": "blazepose-full", **settings}
        return people(inputs_of("people", results, video=identity_of(clip), people=given, lifting={"method": "none"}))

    track = max(looked().tracks, key=lambda track: float(np.ptp(track.bbox[0, 1::2])))
    assert not track.lifted and track.pose is None and track.hands is None
    x0, y0, x1, y1 = box = track.bbox[0].astype(float)

    def given(name: str, left: float) -> str:
        lines = [f"{f + 1},1,{left:.1f},{y0:.1f},{x1 - x0:.1f},{y1 - y0:.1f},0.9,1,1" for f in range(3)]
        (tmp_path / name).write_text("\n".join(lines))
        return str(tmp_path / name)

    (found,) = looked(detections_from=given("his.txt", x0)).tracks
    assert (box_iou(found.bbox, np.tile(box, (3, 1))) > 0.5).all()
    away = 0.0 if x0 > facts.width / 2 else facts.width - (x1 - x0)
    assert looked(detections_from=given("nobody.txt", away)).tracks == (), "nobody else is looked for"


def test_a_trained_lifter_takes_the_place_of_the_shipped_one(tmp_path: Path) -> None:
    K = np.array([[900.0, 0, 480], [0, 900, 270], [0, 0, 1.0]])
    seen = person_frames(TRUTH, np.arange(N) / three_shots.FPS)
    frames = replace(seen, centre=seen.keypoints[:, list(HIPS), :2].mean(axis=1), side=np.full(N, 300.0))
    network = deepcopy(load_lifter("lifter.safetensors"))
    write_network(tmp_path / "same.safetensors", network)
    with torch.no_grad():
        for value in network.parameters():
            value.mul_(0.5)
    write_network(tmp_path / "other.safetensors", network)
    same, other = (
        lifter_of(LiftingConfig.model_validate({"weights": str(tmp_path / f"{name}.safetensors")}))
        for name in ("same", "other")
    )
    shipped = lift(frames, K).landmarks3d
    assert np.abs(same(frames, K).landmarks3d - shipped).max() < 1e-3
    assert np.abs(other(frames, K).landmarks3d - shipped).max() > 0.01
    (tmp_path / "none.safetensors").write_bytes(b"no network")
    with pytest.raises(InputError, match=r"none\.safetensors holds no network"):
        lifter_of(LiftingConfig.model_validate({"weights": str(tmp_path / "none.safetensors")}))
    with pytest.raises(ValueError, match="weights are of the method transformer: leave them out with none"):
        LiftingConfig.model_validate({"weights": str(tmp_path / "same.safetensors"), "method": "none"})
