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
    return _card(
        recipe,
        f"{train} windows of 32 frames, measured on {dev} windows of other subjects",
        ("median, mean", "PA-MPJPE, mm", "MPJPE, mm", "torso, °", "root, °", "swaps found, false"),
        {name: [*_errors(one), f"{one.swaps_found:.2f}, {one.swaps_false:.2f}"] for name, one in rows.items()},
    )


def keypoint_card(recipe: Recipe, dev: int, lifted: LifterScore) -> str:
    """The figures of the keypoint lifter's model card (Markdown)."""
    return _card(
        recipe,
        f"motion capture, measured on {dev} windows of 32 frames of other subjects",
        ("median, mean", "PA-MPJPE, mm", "MPJPE, mm", "torso, °", "root, °"),
        {"lifted from COCO keypoints": _errors(lifted)},
    )


def _errors(one: LifterScore) -> list[str]:
    return _pairs(0, one.pa_mpjpe_mm, one.mpjpe_mm, one.torso_deg, one.root_deg)


def keypoint_refiner_card(recipe: Recipe, train: int, dev: int, rows: Mapping[str, RefinerScore]) -> str:
    """The figures of the keypoint refiner's model card (Markdown)."""
    return _card(
        recipe,
        f"{train} looks, measured on {dev} looks at other subjects",
        ("error, % of the crop's side: median, mean (at most 8)", "limbs", "feet", "hands"),
        {name: _pairs(2, one.limbs, one.feet, one.hands) for name, one in rows.items()},
    )


def pose_card(recipe: Recipe, data: str, rows: Mapping[str, PoseScore]) -> str:
    """The figures of ms-HMR's card (Markdown)."""
    return _card(
        recipe,
        data,
        ("median, mean", "MPJPE about the pelvis, mm", "root, °", "acceleration, m/s²"),
        {name: _pairs(1, one.mpjpe_mm, one.root_deg, one.acceleration) for name, one in rows.items()},
    )


def trajectory_card(recipe: Recipe, data: str, rows: Mapping[str, TrajectoryScore]) -> str:
    """The figures of the trajectory networks' cards (Markdown)."""
    return _card(
        recipe,
        data,
        ("median, mean", "contact F1", "velocity of the root, m/s", "path of a second, m"),
        {
            name: [
                f"{one.contact_f1:.2f}" if one.contact_f1 else "none given",
                *_pairs(3, one.velocity_ms, one.second_m),
            ]
            for name, one in rows.items()
        },
    )


def _pairs(digits: int, *errors: tuple[float, float]) -> list[str]:
    return [f"{median:.{digits}f}, {mean:.{digits}f}" for median, mean in errors]


def _card(recipe: Recipe, data: str, head: Sequence[str], rows: Mapping[str, Sequence[str]]) -> str:
    """What a network was trained on and how, and a table of its errors."""
    parts = ", ".join(f"{name} {value}" for name, value in asdict(recipe).items())
    lines = [
        f"Trained on {data}; recipe:", f"`{parts}`.", "",
        f"| {' | '.join(head)} |", f"|---|{'---:|' * (len(head) - 1)}",
        *(f"| {' | '.join([name, *cells])} |" for name, cells in rows.items()),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"
