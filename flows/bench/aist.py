"""`humanmm bench ms-aist`: real 2D detections of AIST's nine cameras, cut at random; no video and no licensed body.

All methods of `motion_benchmark` start from COCO-17 keypoints alone, lifted to 3D (`models.perception.lifting`).
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from humanmm.config import Config
from humanmm.flows.bench.motion import PlannedJob, planned_set
from humanmm.models.benchmark.aist import AistSequence, build_aist
from humanmm.models.benchmark.tables.statistics import SetStatistics
from humanmm.models.synthetic.multishot import BenchVideo
from humanmm.storage.readers.aist import read_aist
from humanmm.storage.store.store import Store


@dataclass(frozen=True)
class AistJob(PlannedJob):
    """A video of ms-AIST."""

    sequence: AistSequence

    @property
    def parameters(self) -> dict[str, Any]:
        plan = asdict(self.plan)
        return {name: plan[name] for name in ("name", "num_transitions", "longest")} | {"seed": list(self.plan.seed)}

    @property
    def inputs(self) -> dict[str, str]:
        return {"sequence": self.sequence.sha256}

    @property
    def stages(self) -> tuple[str, ...]:
        return ("humanmm.models.benchmark.aist",)

    def build(self, config: Config, store: Store) -> BenchVideo:
        """Made on the spot."""
        return build_aist(self.sequence, self.plan)


def aist_set(folder: Path, size: str) -> tuple[list[AistJob], SetStatistics]:
    """The videos of ms-AIST in one of its sizes, and the set in numbers."""
    sequences = read_aist(folder)
    plans, facts = planned_set(folder, sequences, size)
    return [AistJob(plan, sequences[plan.sequence]) for plan in plans], facts
