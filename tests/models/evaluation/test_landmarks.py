"""Landmarks in space against a truth's bodies: the right person, the right axes, across and along the ray."""

from dataclasses import replace

import numpy as np

from humanmm.models.evaluation.landmarks import landmark_errors, shown_by, true_bodies
from humanmm.models.geometry.projection import project
from humanmm.models.perception.lifting.features import view_axes
from humanmm.models.perception.lifting.lifted import person_frames
from humanmm.models.records.landmarks import HIPS
from humanmm.models.records.sequence import MotionSequence
from humanmm.models.records.tracks import MASK_SIDE, PersonTrack, Silhouettes

SIDE = 400.0
TIME_S = np.arange(130) / 30


def seen(truth: MotionSequence) -> PersonTrack:
    """The person of the truth as a faultless pose network has him, every second frame of the first shot."""
    (body,) = true_bodies(truth)
    rows = np.arange(0, 60, 2)
    landmarks, K = body.landmarks[rows], body.K[rows]
    pixels = project(landmarks, K, near_m=0.1)
    centre = body.hips[rows] + [20.0, -10.0]
    scale = SIDE / MASK_SIDE
    affine = np.zeros((len(rows), 2, 3))
    affine[:, [0, 1], [0, 1]], affine[:, :, 2] = scale, centre - SIDE / 2
    about = landmarks - landmarks[:, list(HIPS)].mean(axis=1, keepdims=True)
    return PersonTrack(
        frame=rows.astype(np.int32),
        keypoints2d=np.concatenate([pixels, np.ones((*pixels.shape[:2], 1))], axis=-1).astype(np.float32),
        landmarks3d=(about @ view_axes(centre, K)).astype(np.float32),
        bbox=np.zeros((len(rows), 4), np.float32),
        confidence=np.ones(len(rows), np.float32),
        masks=Silhouettes.pack(np.zeros((len(rows), MASK_SIDE, MASK_SIDE))),
        mask_affine=affine.astype(np.float32),
        color_frame=np.zeros(1, np.int32),
        color_histogram=np.ones((1, 4), np.float32),
    )


def test_a_faultless_track_has_no_errors_about_the_mid_hip_and_after_a_similarity(sequence: MotionSequence) -> None:
    track = seen(sequence)
    shown = shown_by(track, person_frames(track, TIME_S), true_bodies(sequence))
    assert shown is not None and len(shown.rows) == 30
    errors = landmark_errors(track.landmarks3d[shown.rows], shown.landmarks)
    assert errors.mpjpe_mm.max() < 0.1 and errors.pa_mpjpe_mm.max() < 0.1
    larger = landmark_errors(1.2 * track.landmarks3d[shown.rows] + 0.5, shown.landmarks)
    assert larger.pa_mpjpe_mm.max() < 0.1 and larger.mpjpe_mm.min() > 20


def test_errors_of_depth_are_along_the_ray(sequence: MotionSequence) -> None:
    track = seen(sequence)
    shown = shown_by(track, person_frames(track, TIME_S), true_bodies(sequence))
    assert shown is not None
    guessed = track.landmarks3d.astype(np.float64)
    guessed[..., 2] += np.random.default_rng(0).normal(0, 0.1, guessed.shape[:2])
    errors = landmark_errors(guessed[shown.rows], shown.landmarks)
    assert errors.along_mm.mean() > 2 * errors.across_mm.mean()
    turned = guessed[..., [2, 1, 0]] * [1.0, 1.0, -1.0]
    assert landmark_errors(turned[shown.rows], shown.landmarks[..., [2, 1, 0]] * [1.0, 1.0, -1.0]).along_mm.mean() < (
        errors.along_mm.mean()
    )


def test_a_track_of_nobody_in_the_truth_and_a_truth_without_bodies_are_left_out(sequence: MotionSequence) -> None:
    track = seen(sequence)
    beside = replace(track, keypoints2d=track.keypoints2d + np.float32([100.0, 0.0, 0.0]))
    assert shown_by(beside, person_frames(beside, TIME_S), true_bodies(sequence)) is None
    assert true_bodies(replace(sequence, people=(replace(sequence.people[0], body=None),))) == []
    assert true_bodies(replace(sequence, cameras=None)) == []
