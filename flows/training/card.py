"""What a training says of itself: the curve, and the card of the network."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from humanmm.models.learning.training.keypoint_refiner import RefinerScore
from humanmm.models.learning.training.lifter_objective import LifterScore
from humanmm.models.learning.training.loop import Recipe
from humanmm.models.learning.training.motion_objective import PoseScore, TrajectoryScore
from humanmm.storage.store.files import replace_file


@dataclass(frozen=True)
class Validation:
    """How good the network was after some steps."""

    step: int
    errors: Mapping[str, float]
    """Of the development split, by name with unit."""


def draw_curve(path: Path, losses: Sequence[float], validations: Sequence[Validation]) -> None:
    """The loss in training, and the errors on the development split, over the steps."""
    figure = Figure(figsize=(8, 4), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    left.plot([100 * (k + 1) for k in range(len(losses))], losses)
    left.set(title="loss, training", xlabel="steps")
    steps = [one.step for one in validations]
    for name in validations[-1].errors:
        right.plot(steps, [one.errors[name] for one in validations], label=name)
    right.set(title="median error, development split", xlabel="steps", ylim=(0, None))
    right.legend()
    replace_file(path, lambda fresh: figure.savefig(fresh, format="png", dpi=110))


def lifter_card(
    recipe: Recipe, train: int, dev: int, *, own: LifterScore, lifted: LifterScore, coco: LifterScore
) -> str:
    """The figures of the lifter's model card (Markdown)."""
    rows = {"the pose network's landmarks": own, "lifted": lifted, "lifted from COCO keypoints alone": coco}
    lines = [
        *_made_with(recipe, f"{train} windows of 32 frames, measured on {dev} windows of other subjects"),
        "| median, mean | PA-MPJPE, mm | MPJPE, mm | torso, ° | root, ° | swaps found, false |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for name, one in rows.items():
        lines.append(f"| {name} | {_errors(one)} | {one.swaps_found:.2f}, {one.swaps_false:.2f} |")
    return "\n".join(lines) + "\n"


def keypoint_card(recipe: Recipe, dev: int, lifted: LifterScore) -> str:
    """The figures of the keypoint lifter's model card (Markdown)."""
    lines = [
        *_made_with(recipe, f"motion capture, measured on {dev} windows of 32 frames of other subjects"),
        "| median, mean | PA-MPJPE, mm | MPJPE, mm | torso, ° | root, ° |",
        "|---|---:|---:|---:|---:|",
        f"| lifted from COCO keypoints | {_errors(lifted)} |",
    ]
    return "\n".join(lines) + "\n"


def _errors(one: LifterScore) -> str:
    errors = (one.pa_mpjpe_mm, one.mpjpe_mm, one.torso_deg, one.root_deg)
    return " | ".join(f"{median:.0f}, {mean:.0f}" for median, mean in errors)


def keypoint_refiner_card(recipe: Recipe, train: int, dev: int, rows: Mapping[str, RefinerScore]) -> str:
    """The figures of the keypoint refiner's model card (Markdown)."""
    lines = [
        *_made_with(recipe, f"{train} looks, measured on {dev} looks at other subjects"),
        "| error, % of the crop's side: median, mean (at most 8) | limbs | feet | hands |",
        "|---|---:|---:|---:|",
    ]
    for name, one in rows.items():
        cells = [f"{median:.2f}, {mean:.2f}" for median, mean in (one.limbs, one.feet, one.hands)]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def pose_card(recipe: Recipe, data: str, rows: Mapping[str, PoseScore]) -> str:
    """The figures of ms-HMR's card (Markdown)."""
    lines = [
        *_made_with(recipe, data),
        "| median, mean | MPJPE about the pelvis, mm | root, ° | acceleration, m/s² |",
        "|---|---:|---:|---:|",
    ]
    for name, one in rows.items():
        cells = [f"{median:.1f}, {mean:.1f}" for median, mean in (one.mpjpe_mm, one.root_deg, one.acceleration)]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def trajectory_card(recipe: Recipe, data: str, rows: Mapping[str, TrajectoryScore]) -> str:
    """The figures of the trajectory networks' cards (Markdown)."""
    lines = [
        *_made_with(recipe, data),
        "| median, mean | contact F1 | velocity of the root, m/s | path of a second, m |",
        "|---|---:|---:|---:|",
    ]
    for name, one in rows.items():
        cells = [f"{median:.3f}, {mean:.3f}" for median, mean in (one.velocity_ms, one.second_m)]
        f1 = f"{one.contact_f1:.2f}" if one.contact_f1 else "none given"
        lines.append(f"| {name} | {f1} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _made_with(recipe: Recipe, data: str) -> list[str]:
    parts = ", ".join(f"{name} {value}" for name, value in asdict(recipe).items())
    return [f"Trained on {data}; recipe:", f"`{parts}`.", ""]
