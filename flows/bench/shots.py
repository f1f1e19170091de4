"""`humanmm bench shots`: the three-part detector on videos whose cuts are known, its parts added one by one.

Scenes and people come from the stages of `humanmm recover`, on the same store; deciding on cuts takes milliseconds.
"""

import logging
from collections.abc import Sequence
from pathlib import Path

from humanmm.config import Config
from humanmm.errors import HumanMMError, StageError
from humanmm.models.benchmark.tables.rows import ALL, Row
from humanmm.models.benchmark.tables.shots import CutCounts, count_cuts, rows_of_cuts
from humanmm.models.benchmark.tables.statistics import SetStatistics, statistics_of
from humanmm.models.records.shots import Scenes
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.storage.readers.cut_truth import CutClip, read_cut_clips
from humanmm.storage.store.store import Store
from humanmm.tasks.engine.some_stages import results_of, run_stages
from humanmm.tasks.units.process import prepare_process

log = logging.getLogger(__name__)

STAGES = ("decode", "scenes", "people")


def shot_rows(folder: Path, config: Config, store: Store) -> tuple[list[Row], SetStatistics]:
    """A row for each detector, and the set in numbers (of the videos that can be read)."""
    prepare_process()
    clips = read_cut_clips(folder)
    counted: list[dict[str, CutCounts] | None] = []
    facts: list[VideoFacts] = []
    for clip in clips:
        try:
            found, counts = _counts(clip, config, store)
        except HumanMMError as error:
            log.warning("%s failed: %s", clip.video.name, error)
            counted.append(None)
            continue
        facts.append(found)
        counted.append(counts)
    if not facts:
        raise StageError(f"none of the {len(clips)} videos of {folder} could be read")
    return rows_of_cuts(ALL, counted), _statistics(clips, counted, facts)


def _counts(clip: CutClip, config: Config, store: Store) -> tuple[VideoFacts, dict[str, CutCounts]]:
    run = run_stages(clip.video, STAGES, config, store)
    (facts,), (scenes,) = results_of(run, "decode", VideoFacts), results_of(run, "scenes", Scenes)
    people = results_of(run, "people", ScenePeople)
    return facts, count_cuts(scenes, people, clip.transitions, time_s=facts.time_s)


def _statistics(
    clips: Sequence[CutClip], counted: Sequence[dict[str, CutCounts] | None], facts: Sequence[VideoFacts]
) -> SetStatistics:
    good = [clip for clip, counts in zip(clips, counted, strict=True) if counts is not None]
    return statistics_of(
        [one.num_frames for one in facts], [one.fps for one in facts], [len(clip.transitions) for clip in good]
    )
