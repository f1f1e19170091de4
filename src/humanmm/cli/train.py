"""`humanmm train`: the shipped networks from the repository's motion capture."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

from typer import Option

from humanmm.cli.terminal import write
from humanmm.cli.verb import BENCHMARK, app, group, verb

if TYPE_CHECKING:
    from humanmm.flows.training.pairs import Kind
    from humanmm.models.learning.training.loop import Recipe

Made = TypeVar("Made", bound="Recipe")
Packs = Annotated[list[Path], Option(metavar="FILE…", help="motion capture (default: data/mocap's packs)")]

train = group("Train the shipped networks.")
app.add_typer(train, name="train", rich_help_panel=BENCHMARK)


@dataclass(frozen=True, kw_only=True)
class Rendered:
    """The options of every set of rendered people."""

    out: Annotated[Path, Option(metavar="DIR", help="where the set is written", show_default=False)]
    split: Annotated[Literal["train", "dev", "test"], Option(help="whose motion is shown")] = "train"
    mocap: Packs = field(default_factory=list)
    threads: Annotated[int, Option(metavar="N", min=1, help="groups made at a time")] = 2

    def build(self, kind: "Kind", count: int) -> Path:
        """Make what is missing of it."""
        from humanmm.flows.training.pairs import build_pairs

        made: Path = build_pairs.fn(self.split, count, self.out, tuple(self.mocap), self.threads, kind)
        return made


@verb(train, "pairs")
def pairs(
    *,
    rendered: Rendered,
    count: Annotated[
        int, Option(metavar="N", min=1, help="windows of 32 frames, about four seconds of work each")
    ] = 640,
) -> None:
    """Render people, and keep what the pose networks see of them; goes on where it was stopped."""
    write(rendered.build("pairs", count))


@verb(train, "looks")
def looks(
    *,
    rendered: Rendered,
    count: Annotated[
        int, Option(metavar="N", min=1, help="shots, eight looks each, about a second of work each")
    ] = 2048,
) -> None:
    """Render people, and keep what pose networks' layers show about their landmarks; goes on where it was stopped."""
    write(rendered.build("looks", count))


@dataclass(frozen=True, kw_only=True)
class Training:
    """The options of every training."""

    out: Annotated[Path, Option(metavar="DIR", help="checkpoint, curve, network and card", show_default=False)]
    steps: Annotated[int | None, Option(metavar="N", min=1, help="so many steps instead of the recipe's")] = None
    seed: Annotated[int, Option(metavar="S", help="another seed gives other weights")] = 0
    mocap: Packs = field(default_factory=list)
    device: Annotated[str, Option(metavar="NAME", help="cpu or cuda")] = "cpu"

    def recipe(self, kind: "Callable[..., Made]") -> "Made":
        """The recipe of one network, with the user's seed and steps."""
        return kind(seed=self.seed) if self.steps is None else kind(seed=self.seed, steps=self.steps)


Pairs = Annotated[Path, Option(metavar="DIR", help="pairs of the splits train and dev", show_default=False)]

MsHmrFile = Annotated[
    Path | None, Option("--ms-hmr", metavar="FILE", help="what train ms-hmr made (default: poses are as fitted)")
]
PredictorFile = Annotated[
    Path | None, Option("--predictor", metavar="FILE", help="what train trajectory made (default: the shipped network)")
]


LifterFile = Annotated[
    Path | None,
    Option(
        "--begin-with", metavar="FILE", help="what it or train keypoints made (default: the shipped keypoint lifter)"
    ),
]
KeypointLifterFile = Annotated[
    Path | None, Option("--begin-with", metavar="FILE", help="what this command made (default: random weights)")
]


@verb(train, "keypoint-refiner")
def keypoint_refiner(
    *,
    looks: Annotated[Path, Option(metavar="DIR", help="looks of the splits train and dev", show_default=False)],
    training: Training,
) -> None:
    """Train the network that moves keypoints to where landmarks are; goes on from its last checkpoint."""
    from humanmm.flows.training.keypoint_refiner import train_keypoint_refiner
    from humanmm.models.learning.training.keypoint_refiner import RefinerRecipe

    write(train_keypoint_refiner.fn(looks, training.out, training.recipe(RefinerRecipe), training.device))


@verb(train, "lifter")
def lifter(*, pairs: Pairs, training: Training, begin_with: LifterFile = None) -> None:
    """Train the network that lifts people from what the pose networks see; goes on from its last checkpoint."""
    from humanmm.flows.training.lifter import train_lifter
    from humanmm.models.learning.training.lifter import LifterRecipe

    recipe = training.recipe(LifterRecipe)
    write(train_lifter.fn(pairs, training.out, recipe, tuple(training.mocap), training.device, begin_with))


@verb(train, "keypoints")
def keypoints(*, training: Training, begin_with: KeypointLifterFile = None) -> None:
    """Train the network that lifts people from COCO's keypoints alone; goes on from its last checkpoint."""
    from humanmm.flows.training.lifter import train_keypoints
    from humanmm.models.learning.training.lifter import KeypointRecipe

    recipe = training.recipe(KeypointRecipe)
    write(train_keypoints.fn(training.out, recipe, tuple(training.mocap), training.device, begin_with))


@verb(train, "ms-hmr")
def ms_hmr(*, pairs: Pairs, training: Training) -> None:
    """Train the encoder that corrects poses over all shots; goes on from its last checkpoint."""
    from humanmm.flows.training.motion import Material, train_ms_hmr
    from humanmm.models.learning.training.motion import MotionRecipe

    material = Material(pairs, tuple(training.mocap))
    write(train_ms_hmr.fn(material, training.out, training.recipe(MotionRecipe), training.device))


@verb(train, "trajectory")
def trajectory(*, pairs: Pairs, training: Training, ms_hmr: MsHmrFile = None) -> None:
    """Train the network that says from limbs how people go and which feet stand; goes on from its last checkpoint."""
    from humanmm.flows.training.motion import Material, train_trajectory
    from humanmm.models.learning.training.motion import MotionRecipe

    material = Material(pairs, tuple(training.mocap))
    write(train_trajectory.fn(material, training.out, ms_hmr, training.recipe(MotionRecipe), training.device))


@verb(train, "refiner")
def refiner(*, pairs: Pairs, training: Training, ms_hmr: MsHmrFile = None, predictor: PredictorFile = None) -> None:
    """Train the network that weighs that against what the cameras show; goes on from its last checkpoint."""
    from humanmm.flows.training.motion import Material, train_refiner
    from humanmm.models.learning.training.motion import MotionRecipe

    material = Material(pairs, tuple(training.mocap))
    write(train_refiner.fn(material, training.out, ms_hmr, predictor, training.recipe(MotionRecipe), training.device))
