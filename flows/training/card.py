"""What a training says of itself: the curve, and the card of the network."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from humanmm.models.learning.objective import LifterScore
from humanmm.models.learning.training import Recipe
from humanmm.storage.store.files import replace_file


@dataclass(frozen=True)
class Validation:
    """How good the network was after some steps."""

    step: int
    score: LifterScore

    @classmethod
    def read(cls, tree: Mapping[str, Any]) -> "Validation":
        """From json."""
        values: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in tree["score"].items()
        }
        return cls(int(tree["step"]), LifterScore(**values))


def draw_curve(path: Path, losses: Sequence[float], validations: Sequence[Validation]) -> None:
    """The loss in training, and the errors on the development split, over the steps."""
    figure = Figure(figsize=(8, 4), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    left.plot([100 * (k + 1) for k in range(len(losses))], losses)
    left.set(title="loss, training", xlabel="steps")
    steps = [one.step for one in validations]
    right.plot(steps, [one.score.pa_mpjpe_mm[0] for one in validations], label="PA-MPJPE, mm")
    right.plot(steps, [one.score.mpjpe_mm[0] for one in validations], label="MPJPE, mm")
    right.set(title="median error, development split", xlabel="steps", ylim=(0, None))
    right.legend()
    replace_file(path, lambda fresh: figure.savefig(fresh, format="png", dpi=110))


def lifter_card(
    recipe: Recipe, train: int, dev: int, *, own: LifterScore, lifted: LifterScore, coco: LifterScore
) -> str:
    """The figures of the model card (Markdown)."""
    rows = {"the pose network's landmarks": own, "lifted": lifted, "lifted from COCO keypoints alone": coco}
    lines = [
        f"Trained on {train} windows of 32 frames, measured on {dev} windows of other subjects; recipe:",
        "`" + ", ".join(f"{name} {value}" for name, value in asdict(recipe).items()) + "`.",
        "",
        "| median, mean | PA-MPJPE, mm | MPJPE, mm | torso, ° | root, ° | swaps found, false |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for name, one in rows.items():
        errors = (one.pa_mpjpe_mm, one.mpjpe_mm, one.torso_deg, one.root_deg)
        cells = [f"{median:.0f}, {mean:.0f}" for median, mean in errors]
        lines.append(f"| {name} | {' | '.join(cells)} | {one.swaps_found:.2f}, {one.swaps_false:.2f} |")
    return "\n".join(lines) + "\n"
