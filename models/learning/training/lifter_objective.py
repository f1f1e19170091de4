"""What the lifter is trained for, and how good it is."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from humanmm.models.geometry.alignment import umeyama_alignment
from humanmm.models.geometry.rotations import rotation_angle
from humanmm.models.learning.windows import Windows, certainty_of_coco
from humanmm.models.motion.fit.evidence import BONE_END, BONE_START
from humanmm.models.perception.lifting.network import LifterInput, LifterNetwork, LifterOutput
from humanmm.models.records.landmarks import LIMBS, TORSO

Array = np.ndarray

IMPORTANCE = torch.tensor([0.15] * 11 + [1.0] * 6 + [0.25] * 6 + [1.0] * 6 + [0.5] * 4)
"""Of each landmark: face, arms, hands, legs, feet."""
ROOT_IMPORTANCE = 3.0
"""Of the rotation of the root, against that of any other joint."""


def loss(found: LifterOutput, wanted: Windows) -> Tensor:
    """Distances of landmarks, bones and their steps in time, angles of joints with their likelihood under the stated
    errors (Laplace), sides, contacts."""
    exists = wanted.exists.float()

    gap = found.landmarks - wanted.truth
    of_landmark = IMPORTANCE.to(gap.device)
    distance = (gap.norm(dim=-1) * of_landmark).sum(dim=-1) / of_landmark.sum()
    bones = (gap[:, :, BONE_END] - gap[:, :, BONE_START]).norm(dim=-1).mean(dim=-1)
    step = (gap[:, 1:, list(LIMBS)] - gap[:, :-1, list(LIMBS)]).norm(dim=-1).mean(dim=-1)
    steady = exists[:, 1:] * exists[:, :-1] * (wanted.swapped[:, 1:] == wanted.swapped[:, :-1])

    # nobody's joints are those of a body with left and right swapped
    known = exists * ~wanted.swapped
    angle = ((found.pose - wanted.pose) ** 2).sum(dim=(-1, -2)).div(2).add(1e-8).sqrt()
    log_sigma = found.pose_log_sigma
    unlikely = angle.detach() * torch.exp(-log_sigma) + log_sigma
    binary = nn.functional.binary_cross_entropy_with_logits
    sides = binary(found.swapped, wanted.swapped.float(), reduction="none")
    contacts = binary(found.contacts, wanted.contacts, reduction="none").mean(dim=-1)
    return (
        10 * weighted_mean(distance, exists) + 5 * weighted_mean(bones, exists) + 2 * weighted_mean(step, steady)
        + 2 * weighted_mean(mean_of_joints(angle), known) + 0.2 * weighted_mean(mean_of_joints(unlikely), known)
        + 0.3 * weighted_mean(sides, exists * wanted.clear) + 0.1 * weighted_mean(contacts, exists)
    )  # fmt: skip


def weighted_mean(of_frame: Tensor, weight: Tensor) -> Tensor:
    """Mean over frames (B,n) by their weights; 0 where nothing has any."""
    return (of_frame * weight).sum() / weight.sum().clamp_min(1.0)


def mean_of_joints(of_joint: Tensor) -> Tensor:
    """(…,J) to (…): mean over the root, which counts ROOT_IMPORTANCE times, and the other joints."""
    importance = torch.ones(of_joint.shape[-1], device=of_joint.device)
    importance[0] = ROOT_IMPORTANCE
    return (of_joint * importance).sum(dim=-1) / importance.sum()


@dataclass(frozen=True)
class LifterScore:
    """Errors over the frames of windows in which somebody was seen: median, mean."""

    mpjpe_mm: tuple[float, float]
    """12 limb joints about the mid-hip."""
    pa_mpjpe_mm: tuple[float, float]
    torso_deg: tuple[float, float]
    root_deg: tuple[float, float]
    """Of the pelvis, in frames with left and right as they are."""
    swaps_found: float
    """Fraction of the frames with left and right swapped beyond doubt that are found."""
    swaps_false: float


def score(network: LifterNetwork | None, windows: Windows, *, coco: bool = False) -> LifterScore:
    """How good a network is on windows; None: the pose network's own landmarks. `coco`: from COCO's keypoints alone."""
    rows: list[Array] = []
    for start in range(0, len(windows), 64):
        part = windows.chosen(torch.arange(start, min(start + 64, len(windows))))
        rows.append(_rows(network, part, _given(part, coco=coco)))
    mpjpe, pa, torso, root, seen, swapped, clear = np.concatenate(rows).T

    wrong, right = (swapped > 0) & (clear > 0), (swapped == 0) & (clear > 0)
    return LifterScore(
        median_and_mean(mpjpe), median_and_mean(pa), median_and_mean(torso), median_and_mean(root[swapped == 0]),
        float(seen[wrong].mean()) if wrong.any() else float("nan"), float(seen[right].mean()) if right.any() else 0.0,
    )  # fmt: skip


def median_and_mean(values: Float[Array, " n"]) -> tuple[float, float]:
    """Both; nan without any value."""
    return (float(np.median(values)), float(values.mean())) if len(values) else (float("nan"), float("nan"))


def _given(windows: Windows, *, coco: bool) -> LifterInput:
    if not coco:
        return windows.given()
    given = windows.given(torch.zeros(len(windows), dtype=torch.bool))
    return replace(given, certainty=certainty_of_coco(given.certainty))


def _rows(network: LifterNetwork | None, windows: Windows, given: LifterInput) -> Float[Array, "n 7"]:
    seen = windows.exists
    if network is None:
        landmarks, odds = given.landmarks, torch.zeros_like(given.time_s)
        root = torch.full_like(windows.pose[:, :, 0], torch.nan)  # it gives none
    else:
        with torch.inference_mode():
            found = network(given)
        landmarks, root, odds = found.landmarks, found.pose[:, :, 0], found.swapped
    a, b = (x[seen].double().numpy() for x in (landmarks, windows.truth))
    limbs, torso = list(LIMBS), list(TORSO)
    aligned = umeyama_alignment(a[:, limbs], b[:, limbs], unique=False).apply(a[:, limbs])
    R_torso = umeyama_alignment(a[:, torso], b[:, torso], unique=False).R_target_source
    R_root = (root[seen].transpose(-1, -2) @ windows.pose[:, :, 0][seen]).double().numpy()
    return np.stack(
        [
            1000 * np.linalg.norm(a[:, limbs] - b[:, limbs], axis=-1).mean(axis=1),
            1000 * np.linalg.norm(aligned - b[:, limbs], axis=-1).mean(axis=1),
            np.degrees(rotation_angle(R_torso)),
            np.degrees(rotation_angle(R_root)),
            (odds[seen] > 0).numpy(),
            windows.swapped[seen].numpy(),
            windows.clear[seen].numpy(),
        ],
        axis=1,
    )
