"""`humanmm bench speed`: how long one video takes, stage by stage, beside the least that it could take.

The floor is decoding plus one pass of the pose networks for each person in each frame that is looked at, measured just
before the run, in the same process, with the same threads. The run is forced: an empty store of its own, and a run
folder that is thrown away.
"""

import multiprocessing
import tempfile
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from humanmm.config import Config
from humanmm.errors import StageError
from humanmm.machine import peak_memory_mb
from humanmm.models.benchmark.tables.rows import Row, summarise
from humanmm.models.perception.between_looks import looked_at
from humanmm.models.perception.picture import Picture, whole
from humanmm.models.perception.tracking.tracker import CAREFUL_FRAMES
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.frames import planar_frames
from humanmm.models.video.reading import read_facts
from humanmm.parts import load
from humanmm.storage.run_folder.looped_video import write_looped
from humanmm.storage.run_folder.run_record import read_run_record
from humanmm.tasks.pictures import stage_times

_WARM_UP_FRAMES = 3


@dataclass(frozen=True)
class Floor:
    """The least work that recovering a video takes, milliseconds a frame."""

    decode_ms: float
    locate_ms: float
    """One pass of the pose networks, for one person."""
    looks: float
    """Frames that are looked at, of all frames."""

    def total_ms(self, people: float) -> float:
        """With so many people in a frame."""
        return self.decode_ms + people * self.looks * self.locate_ms


@dataclass(frozen=True)
class Speed:
    """One forced run of one video. Times a frame are milliseconds of wall clock over the number of frames."""

    num_frames: int
    duration_s: float
    stage_ms: Mapping[str, float]
    """All units of a stage added up; stages overlap in time, so that they may add up to more than `wall_s`."""
    wall_s: float
    """From the first stage's start to the last stage's end."""
    total_s: float
    """The whole run, with Prefect, the store and the run folder."""
    processor_s: float
    """Processor time of the process over the whole run, all threads."""
    peak_memory_mb: float
    floor: Floor
    people: float
    """Seen in a frame, on average."""

    @property
    def wall_ms(self) -> float:
        return 1000 * self.wall_s / self.num_frames

    def metrics(self) -> dict[str, float]:
        """Every figure by name, in the order of the table."""
        floor_ms = self.floor.total_ms(self.people)
        stages = {f"{stage}_ms_per_frame": ms for stage, ms in self.stage_ms.items()}
        return stages | {
            "wall_ms_per_frame": self.wall_ms,
            "people_per_frame": self.people,
            "floor_ms_per_frame": floor_ms,
            "floor_decode_ms_per_frame": self.floor.decode_ms,
            "floor_landmarks_ms_per_person": self.floor.locate_ms,
            "looks_per_frame": self.floor.looks,
            "ratio_to_floor": self.wall_ms / floor_ms,
            "ratio_to_duration": self.wall_s / self.duration_s,
            "wall_s": self.wall_s,
            "total_s": self.total_s,
            "overhead_s": self.total_s - self.wall_s,
            "processor_ms_per_frame": 1000 * self.processor_s / self.num_frames,
            "peak_memory_mb": self.peak_memory_mb,
        }


def growth_rows(video: Path, config: Config, minutes: Sequence[float]) -> list[Row]:
    """A row for the video looped to each length, measured in a process of its own; the longest shows how the peak
    memory grew from the shortest on."""
    measured = {length: _measure_looped(video, config, length) for length in sorted(set(minutes))}
    shortest, longest = measured[min(measured)], measured[max(measured)]
    rows = []
    for length, speed in measured.items():
        figures = {"num_frames": float(speed.num_frames), **speed.metrics()}
        if speed.num_frames == longest.num_frames > shortest.num_frames:
            grown_mb = longest.peak_memory_mb - shortest.peak_memory_mb
            figures["memory_growth_kb_per_frame"] = 1024 * grown_mb / (longest.num_frames - shortest.num_frames)
        split = f"{video.stem} looped to {length:g} min"
        rows.append(Row("humanmm", split, 1, 0, {key: summarise([value]) for key, value in figures.items()}))
    return rows


def _measure_looped(video: Path, config: Config, minutes: float) -> Speed:
    with tempfile.TemporaryDirectory(prefix="humanmm-looped-") as folder:
        looped = Path(folder) / f"{video.stem}.mkv"
        write_looped(video, looped, seconds=60 * minutes)
        with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
            return pool.submit(measure_speed, looped, config).result()


def measure_speed(video: Path, config: Config) -> Speed:
    """Measure the floor, then recover the video once with an empty store."""
    with video.open("rb") as stream:
        facts = read_facts(stream, max_side_px=config.decode.max_side_px)
    floor = measure_floor(video, facts, config)
    with tempfile.TemporaryDirectory(prefix="humanmm-speed-") as folder:
        begun, processor = time.monotonic(), time.process_time()
        record = _recover(video, Path(folder), config)
        total_s = time.monotonic() - begun
        processor_s = time.process_time() - processor
    return Speed(
        num_frames=facts.num_frames,
        duration_s=facts.num_frames / facts.fps,
        stage_ms=stage_milliseconds(record, facts.num_frames),
        wall_s=stages_wall_s(record),
        total_s=total_s,
        processor_s=processor_s,
        peak_memory_mb=peak_memory_mb(),
        floor=floor,
        people=sum(person.get("observed_frames", 0) for person in record["people"]) / facts.num_frames,
    )


def measure_floor(video: Path, facts: VideoFacts, config: Config) -> Floor:
    """Time decoding every frame and locating the person found in the first, one after the other."""
    detect = load("people.detector", config.people.detector)
    locate = load("people.pose", config.people.pose)
    seconds, region = np.zeros(2), None
    with video.open("rb") as stream:
        pictures = planar_frames(stream, facts, 0, facts.num_frames, max_side_px=config.people.max_side_px)
        for _ in range(_WARM_UP_FRAMES):  # networks are loaded at their first use
            picture = Picture((np.zeros((256, 256), np.uint8), half := np.zeros((128, 128), np.uint8), half))
            locate(picture, whole(picture))
        for _ in range(facts.num_frames):
            clock = [time.perf_counter()]
            frame = next(pictures)
            picture = Picture(frame.planes, frame.colors)
            clock.append(time.perf_counter())
            if region is None:
                found = detect(picture, whole(picture))
                region = found[0].region if found else whole(picture)
            begun = time.perf_counter()
            locate(picture, region)
            seconds += [clock[1] - clock[0], time.perf_counter() - begun]
    decode_ms, locate_ms = (1000 * seconds / facts.num_frames).tolist()
    looks = looked_at(facts.time_s, (0, facts.num_frames), max_rate_hz=config.people.looks_hz, every=CAREFUL_FRAMES)
    return Floor(decode_ms, locate_ms, len(looks) / facts.num_frames)


def stage_milliseconds(record: Mapping[str, Any], num_frames: int) -> dict[str, float]:
    """Milliseconds a frame of every stage in run.json, its units added up."""
    return {row.stage: 1000 * row.seconds / num_frames for row in stage_times(record)}


def stages_wall_s(record: Mapping[str, Any]) -> float:
    """Seconds from the first stage's start to the last stage's end."""
    spans = [(entry["began"], entry["began"] + entry["seconds"]) for entry in record["stages"] if entry["began"]]
    if not spans:
        raise StageError("no stage was computed, so there is nothing to measure")
    return float(max(end for _, end in spans) - min(start for start, _ in spans))


def _recover(video: Path, folder: Path, config: Config) -> dict[str, Any]:
    from humanmm.flows.server.local_server import prefect_server

    with prefect_server():
        from humanmm.flows.recover import recover

        state: Any = recover(video, out=folder / "run", config=config, store=folder / "store", return_state=True)
    if not state.is_completed():
        raise StageError(f"{video.name} was not recovered whole, so its speed says nothing: {state.message}")
    return read_run_record(folder / "run")
