"""Which shots show the same place, and how their cameras stand to each other (see `views`).

Neighbouring shots are always compared. Any two shots are compared in short videos; in long ones only where a quick look
at their strongest features finds enough of them in common, so that the cost grows with the number of shots and not with
its square times the cost of a full comparison.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.keyframes import (
    MIN_MATCHES,
    ViewFeatures,
    ViewLink,
    drop_features,
    link_views,
    match_features,
)
from humanmm.models.geometry.rotations import rotation_angle
from humanmm.models.records.tracks import PersonTrack

COMPARE_ALL = 8
"""Up to so many shots, any two are compared in full."""
REACH = 40
"""In longer videos a shot is compared with so many before it."""
QUICK_FEATURES = 400
FULL_COMPARISONS = 3
"""Pairs of key views of two shots that are compared in full: those that look most alike at a quick look."""
MAX_BOX_AGE = 10
"""A box seen this many frames before or after a view still hides what lies in it."""


@dataclass(frozen=True)
class ShotLink:
    """Relative pose of the cameras at two frames of different shots, from the background alone."""

    shot_a: int
    shot_b: int
    view: ViewLink
    sigma_deg: float
    """Expected rotation error: few inliers, and a focal length that is not known, make it larger."""


def link_shots(
    views: Sequence[Sequence[ViewFeatures]], *, K: Float[np.ndarray, "3 3"], focal_uncertainty: float
) -> tuple[ShotLink, ...]:
    """Links between the shots whose key views (people left out, see `without_people`) show the same place.

    `views[k]` are the key views of shot k, empty where the shot failed; `focal_uncertainty` is one sigma of the focal
    length as a share of it.
    """
    links = []
    for b in range(1, len(views)):
        for a in range(max(0, b - REACH), b):
            if b - a > 1 and len(views) > COMPARE_ALL and not _may_share_a_place(views[a], views[b]):
                continue
            view = _strongest(views[a], views[b], K)
            if view is not None:
                links.append(ShotLink(a, b, view, sigma_deg(view, focal_uncertainty)))
    return tuple(links)


def sigma_deg(view: ViewLink, focal_uncertainty: float) -> float:
    """Expected rotation error of a link.

    A focal length wrong by a share e turns a rotation of angle α into about (1 + e) α, since both are read off the
    same image displacement; below that lies what few inliers leave open (400° / inliers: of rendered and real pairs
    with 15 to 30 inliers most are off by more than 15°, with 40 and more by less than 3°).
    """
    if view.same_camera:
        return 0.1
    angle = np.degrees(rotation_angle(view.R_a_b))
    return float(np.sqrt(1.0 + (angle * focal_uncertainty) ** 2 + (400.0 / view.num_inliers) ** 2))


def without_people(view: ViewFeatures, tracks: Iterable[PersonTrack]) -> ViewFeatures:
    """The view without features on people: within a person's box, widened by a tenth, of the nearest observed frame."""
    hidden = np.zeros(len(view.xy), bool)
    for track in tracks:
        nearest = int(np.argmin(np.abs(track.frame - view.frame)))
        if abs(int(track.frame[nearest]) - view.frame) > MAX_BOX_AGE:
            continue
        x0, y0, x1, y1 = track.bbox[nearest]
        margin_x, margin_y = 0.1 * (x1 - x0), 0.1 * (y1 - y0)
        x, y = view.xy[:, 0], view.xy[:, 1]
        hidden |= (x > x0 - margin_x) & (x < x1 + margin_x) & (y > y0 - margin_y) & (y < y1 + margin_y)
    return drop_features(view, hidden)


def _strongest(a: Sequence[ViewFeatures], b: Sequence[ViewFeatures], K: Float[np.ndarray, "3 3"]) -> ViewLink | None:
    """The link with most inliers over the most alike pairs of key views; a recurring camera ends the search."""
    # a's last and b's first view are closest in time: they come first among equals.
    pairs = [(view_a, view_b) for view_a in reversed(a) for view_b in b]
    alike = [-len(match_features(_quick(view_a), _quick(view_b))[0]) for view_a, view_b in pairs]
    best = None
    for index in np.argsort(alike, kind="stable")[:FULL_COMPARISONS]:
        view_a, view_b = pairs[index]
        link = link_views(view_a, view_b, K)
        if link is not None and (best is None or link.num_inliers > best.num_inliers):
            best = link
        if best is not None and best.same_camera:
            return best
    return best


def _quick(view: ViewFeatures) -> ViewFeatures:
    """The view with its strongest features only."""
    return replace(view, xy=view.xy[:QUICK_FEATURES], descriptors=view.descriptors[:QUICK_FEATURES])


def _may_share_a_place(a: Sequence[ViewFeatures], b: Sequence[ViewFeatures]) -> bool:
    return bool(a and b) and len(match_features(_quick(a[-1]), _quick(b[0]))[0]) >= MIN_MATCHES
