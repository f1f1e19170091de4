"""Positions of people on both sides of a cut tell the heading; identities that are doubtful or swapped do not."""

from dataclasses import replace

import numpy as np

from humanmm.models.geometry.intrinsics import K_of
from humanmm.models.geometry.rotations import angle_between_deg, rotvec_to_rotmat
from humanmm.models.motion.rotations.levelling import ShotVertical
from humanmm.models.motion.rotations.positions import position_edge
from humanmm.models.motion.rotations.rotation_mixtures import RotationEdge, Upright
from humanmm.models.motion.rotations.shot_results import ShotResults
from humanmm.models.records.camera import Intrinsics, ShotCamera
from humanmm.models.records.motion import PersonShotMotion, ShotMotion
from humanmm.models.records.shots import Person, Shot, ShotList
from humanmm.models.records.tracks import ScenePeople

FPS, LENGTH = 30.0, 12
INTRINSICS = Intrinsics(900.0, 960, 540, "given", 0.0)
PLACES = np.array([[-1.0, 0.2, 0.95], [1.2, -0.3, 0.95], [0.3, 1.4, 0.95]])


def camera_at(azimuth_deg: float, pitch_deg: float = 12.0) -> tuple[np.ndarray, np.ndarray]:
    """R_world_cam and centre: 5 m away, pitched down."""
    heading = rotvec_to_rotmat(np.array([0.0, 0.0, np.radians(azimuth_deg)]))
    level = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    R = heading @ level @ rotvec_to_rotmat(np.array([-np.radians(pitch_deg), 0.0, 0.0]))
    return R, heading @ np.array([0.0, -5.0, 1.8])


def results(
    azimuths: tuple[float, float] = (10.0, 130.0), people: int = 2, *, swapped: bool = False, closeness: float = 1.0
) -> tuple[ShotResults, dict[int, ShotVertical], np.ndarray]:
    """Two shots of people who stand still, and the true rotation between the shots."""
    shots, motions, cameras, verticals, views = [], [], [], {}, [camera_at(one) for one in azimuths]
    for k, (R, centre) in enumerate(views):
        frame = np.arange(k * LENGTH, (k + 1) * LENGTH, dtype=np.int32)
        own = []
        for person in range(people):
            place = PLACES[1 - person if swapped and k else person] * [closeness, closeness, 1.0]
            eye, none = np.tile(np.eye(3), (LENGTH, 1, 1)), np.zeros((LENGTH, 23, 3))
            cam = np.tile((place - centre) @ R, (LENGTH, 1))
            sure = np.ones(LENGTH, np.float32)
            own.append(
                PersonShotMotion(person, frame, sure > 0, eye, none, np.zeros(10), cam, sure, sure, 0 * sure, 0 * sure)
            )
        start, end = int(frame[0]), int(frame[-1]) + 1
        eye = np.tile(np.eye(3), (LENGTH, 1, 1))
        still, K = np.zeros((LENGTH, 3)), np.tile(K_of(INTRINSICS), (LENGTH, 1, 1))
        cameras.append(ShotCamera(start, end, eye, still, K, "static", True, float("nan")))
        shots.append(Shot(k, start, end, k, None, ()))
        motions.append(ShotMotion(start, end, tuple(own)))
        verticals[k] = ShotVertical((), Upright(R.T @ np.array([0, 0, 1.0]), 1.0))
    cast = tuple(Person(k, np.zeros(10), 1.0) for k in range(people))
    none_seen = [ScenePeople(shot.start, shot.end, ()) for shot in shots]
    listed = ShotList(2 * LENGTH, tuple(shots), cast)
    time_s = np.arange(2 * LENGTH) / FPS
    found = ShotResults(listed, none_seen, cameras, motions, time_s, INTRINSICS, [()] * 2)
    return found, verticals, views[0][0].T @ views[1][0]


def edge_of(found: ShotResults, verticals: dict[int, ShotVertical]) -> RotationEdge:
    edge = position_edge(found, 0, 1, verticals, {})
    assert edge is not None
    return edge


def test_people_who_stand_tell_how_the_camera_rotated() -> None:
    for people in (2, 3):
        found, verticals, R_true = results(people=people)
        edge = edge_of(found, verticals)
        assert angle_between_deg(edge.hypotheses[0].R_a_b, R_true) < 1e-4
        assert 12.0 < edge.hypotheses[0].sigma_deg < 25.0 and not edge.connects


def test_swapped_identities_are_the_second_hypothesis_of_two_people() -> None:
    found, verticals, R_true = results(swapped=True)
    first, second = edge_of(found, verticals).hypotheses
    assert angle_between_deg(first.R_a_b, R_true) > 170.0 and angle_between_deg(second.R_a_b, R_true) < 1e-4
    assert first.probability > 5 * second.probability


def test_who_stands_alone_or_close_or_is_doubtful_or_unseen_says_nothing() -> None:
    alone, verticals, _ = results(people=1)
    assert position_edge(alone, 0, 1, verticals, {}) is None
    close, verticals, _ = results(closeness=0.2)
    assert position_edge(close, 0, 1, verticals, {}) is None
    found, verticals, _ = results()
    doubtful = (found.shots.people[0], replace(found.shots.people[1], probability=0.1))
    assert position_edge(replace(found, shots=replace(found.shots, people=doubtful)), 0, 1, verticals, {}) is None
    long_ago = np.r_[np.arange(LENGTH), 60 + np.arange(LENGTH)] / FPS
    unseen = found.motions[1]
    assert unseen is not None
    late = tuple(replace(one, observed=np.arange(LENGTH) == LENGTH - 1) for one in unseen.people)
    late_results = replace(found, motions=[found.motions[0], replace(unseen, people=late)], time_s=2 * long_ago)
    assert position_edge(late_results, 0, 1, verticals, {}) is None


def test_the_longer_nobody_films_the_less_places_say() -> None:
    found, verticals, _ = results(people=3)

    def after(hole_s: float) -> ShotResults:
        return replace(found, time_s=found.time_s + np.where(np.arange(2 * LENGTH) < LENGTH, 0.0, hole_s))

    at_once, soon = (edge_of(after(hole_s), verticals).hypotheses[0].sigma_deg for hole_s in (0.0, 1.0))
    assert soon > 1.3 * at_once
    assert position_edge(after(5.0), 0, 1, verticals, {}) is None
