"""A clip with simulated detections of its people instead of the pose network's: does the simulation do what it does?"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from humanmm.models.perception.clothing import HISTOGRAM_BINS
from humanmm.models.records.sequence import CameraSequence, PersonSequence
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.synthetic.detector_noise import DetectorNoise, detect, pitch_and_roll
from humanmm.models.synthetic.multishot import BenchVideo, person_track
from humanmm.models.synthetic.noise_series import true_landmarks

FEWEST_FRAMES = 3


def resimulated(video: BenchVideo, noise: DetectorNoise, seed: int) -> BenchVideo:
    """The same scenes, cameras' points and truth; in every scene one track of everybody whom the truth observes there.

    The truth must have cameras and body parameters (rendered clips). The person's landmarks are where body24 has them.
    """
    cameras = video.truth.cameras
    if cameras is None:
        raise ValueError(f"{video.name}: the truth has no cameras")
    rng = np.random.default_rng(seed)
    clothes = rng.dirichlet(np.full(HISTOGRAM_BINS, 0.15), len(video.truth.people))
    people = []
    for scene in video.people:
        span = (scene.start, scene.end)
        tracks = (
            _track(video, person, colours, cameras, span, noise, rng)
            for person, colours in zip(video.truth.people, clothes, strict=True)
        )
        people.append(ScenePeople(*span, tuple(track for track in tracks if track is not None)))
    return replace(video, people=tuple(people))


def _track(
    video: BenchVideo,
    person: PersonSequence,
    colours: Float[np.ndarray, " bins"],
    cameras: CameraSequence,
    span: tuple[int, int],
    noise: DetectorNoise,
    rng: np.random.Generator,
) -> PersonTrack | None:
    rows = np.flatnonzero((person.frame >= span[0]) & (person.frame < span[1]) & person.observed)
    if len(rows) < FEWEST_FRAMES:
        return None
    frame = person.frame[rows]
    points, behind, stature = true_landmarks(person, cameras, rows)
    pitch, roll = pitch_and_roll(cameras.R_world_cam[frame], points[:, 23:25].mean(axis=1))
    size = (video.facts.width, video.facts.height)
    seen = detect(points, cameras.K[frame], size, behind, stature, video.facts.fps, noise, rng, pitch=pitch, roll=roll)
    track = person_track(seen, 0, video.facts.fps, colours, rng, size)
    if not len(track.frame):
        return None
    at = frame.astype(np.int32)
    return replace(track, frame=at[track.frame], color_frame=at[track.color_frame])
