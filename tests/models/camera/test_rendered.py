"""Cameras of the rendered clips, from their pixels, against the exact truth. Needs $HUMANMM_DATA (data/render_dev)."""

import os
from dataclasses import fields
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from humanmm.models.camera.estimate import camera_from_points
from humanmm.models.camera.focal_length.intrinsics import ShotPoints, intrinsics_from_background
from humanmm.models.camera.klt import klt_tracks
from humanmm.models.geometry import rotations
from humanmm.models.records.tracks import PersonTrack, Silhouettes
from humanmm.models.video.frames import frames
from humanmm.models.video.reading import read_facts

DATA = os.environ.get("HUMANMM_DATA")
pytestmark = pytest.mark.skipif(DATA is None, reason="HUMANMM_DATA is not set: the rendered clips are not at hand")

STEP = 2
"""Every second frame is used: the cameras move slowly."""
CLIPS = {
    "walk_turn_2shot": ["rotation_only", "static"],
    "martial_3shot": ["tracked", "tracked", "tracked"],
    "basket_two_people_2shot": ["tracked", "rotation_only"],
}


SLOW = ("martial_3shot",)
"""The others have each source of a camera too."""


def people_of(folder: Path, clip: str) -> list[PersonTrack]:
    """The true silhouettes, scaled down to a track's masks that span the whole picture."""
    tracks = []
    with np.load(folder / f"{clip}_masks.npz") as masks:
        for packed in masks.values():
            full = np.unpackbits(packed[::STEP], axis=-1)
            small = np.stack([cv2.resize(one, (128, 128), interpolation=cv2.INTER_AREA) > 0 for one in full])
            count, height, width = full.shape
            affine = np.array([[width / 128, 0, 0], [0, height / 128, 0]], np.float32)
            unused = {field.name: np.zeros((count, 0), np.float32) for field in fields(PersonTrack)}
            used = {
                "frame": np.arange(count, dtype=np.int32),
                "bbox": np.tile(np.array([[0, 0, width, height]], np.float32), (count, 1)),
                "masks": Silhouettes.pack(small),
                "mask_affine": np.tile(affine, (count, 1, 1)),
            }
            tracks.append(PersonTrack(**{**unused, **used}))
    return tracks


@pytest.mark.parametrize(
    "clip", [pytest.param(clip, marks=pytest.mark.slow) if clip in SLOW else clip for clip in CLIPS]
)
def test_the_camera_drifts_less_than_a_degree_with_the_focal_length_unknown(clip: str) -> None:
    folder = Path(DATA or "") / "render_dev"
    people = people_of(folder, clip)
    with np.load(folder / f"{clip}_gt.npz") as truth:
        R_world_cam, focal_px = truth["cameras/R_world_cam"], float(truth["cameras/K"][0, 0, 0])
        bounds = [-(-frame // STEP) for frame in (0, *truth["cut_frames"].tolist(), len(R_world_cam))]
    R_world_cam = R_world_cam[::STEP]
    shots = []
    with (folder / f"{clip}.mp4").open("rb") as stream:
        facts = read_facts(stream)
        for start, stop in pairwise(bounds):
            span = frames(stream, facts, STEP * start, STEP * (stop - 1) + 1, pixels="gray", max_side_px=640)
            pictures = (frame.image for frame in span if frame.index % STEP == 0)
            size = (facts.width, facts.height)
            points = klt_tracks(pictures, start=start, source_size=size)
            shots.append(ShotPoints(points, people))
    intrinsics = intrinsics_from_background(shots, facts.width, facts.height)
    assert intrinsics.source == "estimated"
    assert intrinsics.focal_px == pytest.approx(focal_px, rel=0.03)
    for shot, expected in zip(shots, CLIPS[clip], strict=True):
        camera = camera_from_points(shot.points, people, intrinsics)
        assert camera.source == expected
        truth_R = R_world_cam[camera.start].T @ R_world_cam[camera.start : camera.end]
        drift = np.degrees(rotations.rotation_angle(np.swapaxes(truth_R, 1, 2) @ camera.R_shot_cam))
        assert drift.max() < 1.0
