"""The map that a moving camera's odometry has made, as points with their certainty."""

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.odometry.keyframe_odometry import Track
from humanmm.models.geometry.rotations import unit
from humanmm.models.records.camera import Scenery

_PARALLEL_RAD = 1e-6
_NEARER_THAN_INFINITY = 1e-6
"""Inverse depths below this, in units of the path, are directions and no places."""


def scenery_of(track: Track, origin: Float[np.ndarray, "3"], R_shot_map: Float[np.ndarray, "3 3"]) -> Scenery:
    """The points of a track's map, from `origin` (in the map's axes) and in the shot's axes.

    A point's distance is as certain as the widest angle between its sightings is large against their error.
    """
    placed = np.flatnonzero(track.known & (track.points.rho > _NEARER_THAN_INFINITY))
    row = np.full(len(track.known), -1)
    row[placed] = np.arange(len(placed))
    positions = track.points.select(placed).positions()
    sightings = track.observations.select(row[track.observations.point] >= 0)
    of_point = row[sightings.point]
    ray = unit(positions[of_point] - track.views.t_shot_cam[sightings.image])
    first = np.zeros((len(placed), 3))
    first[of_point[::-1]] = ray[::-1]
    angle = np.arccos(np.clip((ray * first[of_point]).sum(axis=1), -1.0, 1.0))
    widest = np.full(len(placed), _PARALLEL_RAD)
    np.maximum.at(widest, of_point, angle)
    noise_rad = track.adjusted.noise_px / float(np.mean(track.views.focals_px))
    return Scenery(((positions - origin) @ R_shot_map.T).astype(np.float32), (noise_rad / widest).astype(np.float32))
