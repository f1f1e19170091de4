"""`humanmm train`: the shipped networks from the repository's motion capture."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Option

from humanmm.cli.terminal import write
from humanmm.cli.verb import BENCHMARK, app, group, verb

if TYPE_CHECKING:
    from humanmm.models.learning.motion_training import MotionRecipe

Packs = Annotated[list[Path], Option(metavar="FILE…", help="motion capture (default: data/mocap's packs)")]

train = group("Train the shipped networks.")
app.add_typer(train, name="train", rich_help_panel=BENCHMARK)


@verb(train, "pairs")
def pairs(
    *,
    out: Annotated[Path, Option(metavar="DIR", help="where the pairs are written", show_default=False)],
    split: Annotated[Literal["train", "dev", "test"], Option(help="whose motion is shown")] = "train",
    count: Annotated[
        int, Option(metavar="N", min=1, help="windows of 32 frames, about four seconds of work each")
    ] = 640,
    mocap: Packs = [],  # noqa: B006
    threads: Annotated[int, Option(metavar="N", min=1, help="groups made at a time")] = 2,
) -> None:
    """Render people, and keep what the pose networks see of them; goes on where it was stopped."""
    from humanmm.flows.training.pairs import build_pairs

    write(build_pairs.fn(split, count, out, tuple(mocap), threads))


Pairs = Annotated[Path, Option(metavar="DIR", help="pairs of the splits train and dev", show_default=False)]
Out = Annotated[Path, Option(metavar="DIR", help="checkpoint, curve, network and card", show_default=False)]
Steps = Annotated[int | None, Option(metavar="N", min=1, help="so many steps instead of the recipe's")]
Seed = Annotated[int, Option(metavar="S", help="another seed gives other weights")]
Device = Annotated[str, Option(metavar="NAME", help="cpu or cuda")]
MsHmrFile = Annotated[
    Path | None, Option("--ms-hmr", metavar="FILE", help="what train ms-hmr made (default: the shipped network)")
]
PredictorFile = Annotated[
    Path | None, Option("--predictor", metavar="FILE", help="what train trajectory made (default: the shipped network)")
]


@verb(train, "lifter")
def lifter(
    *,
    pairs: Pairs,
    out: Out,
    steps: Steps = None,
    seed: Seed = 0,
    mocap: Packs = [],  # noqa: B006
    device: Device = "cpu",
) -> None:
    """Train the network that lifts people from the pictures into space; goes on from its last checkpoint."""
    from humanmm.flows.training.lifter import train_lifter
    from humanmm.models.learning.lifter_training import LifterRecipe

    recipe = LifterRecipe(seed=seed) if steps is None else LifterRecipe(seed=seed, steps=steps)
    write(train_lifter.fn(pairs, out, recipe, tuple(mocap), device))


@verb(train, "ms-hmr")
def ms_hmr(
    *,
    pairs: Pairs,
    out: Out,
    steps: Steps = None,
    seed: Seed = 0,
    mocap: Packs = [],  # noqa: B006
    device: Device = "cpu",
) -> None:
    """Train the encoder that corrects poses over all shots; goes on from its last checkpoint."""
    from humanmm.flows.training.motion import Material, train_ms_hmr

    write(train_ms_hmr.fn(Material(pairs, tuple(mocap)), out, _motion_recipe(steps, seed), device))


@verb(train, "trajectory")
def trajectory(
    *,
    pairs: Pairs,
    out: Out,
    ms_hmr: MsHmrFile = None,
    steps: Steps = None,
    seed: Seed = 0,
    mocap: Packs = [],  # noqa: B006
    device: Device = "cpu",
) -> None:
    """Train the network that says from limbs how people go and which feet stand; goes on from its last checkpoint."""
    from humanmm.flows.training.motion import Material, train_trajectory

    write(train_trajectory.fn(Material(pairs, tuple(mocap)), out, ms_hmr, _motion_recipe(steps, seed), device))


@verb(train, "refiner")
def refiner(
    *,
    pairs: Pairs,
    out: Out,
    ms_hmr: MsHmrFile = None,
    predictor: PredictorFile = None,
    steps: Steps = None,
    seed: Seed = 0,
    mocap: Packs = [],  # noqa: B006
    device: Device = "cpu",
) -> None:
    """Train the network that weighs that against what the cameras show; goes on from its last checkpoint."""
    from humanmm.flows.training.motion import Material, train_refiner

    write(train_refiner.fn(Material(pairs, tuple(mocap)), out, ms_hmr, predictor, _motion_recipe(steps, seed), device))


def _motion_recipe(steps: int | None, seed: int) -> "MotionRecipe":
    from humanmm.models.learning.motion_training import MotionRecipe

    return MotionRecipe(seed=seed) if steps is None else MotionRecipe(seed=seed, steps=steps)
