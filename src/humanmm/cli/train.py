"""`humanmm train`: the shipped networks from the repository's motion capture."""

from pathlib import Path
from typing import Annotated, Literal

from typer import Option

from humanmm.cli.terminal import write
from humanmm.cli.verb import BENCHMARK, app, group, verb

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


@verb(train, "lifter")
def lifter(
    *,
    pairs: Annotated[Path, Option(metavar="DIR", help="pairs of the splits train and dev", show_default=False)],
    out: Annotated[Path, Option(metavar="DIR", help="checkpoint, curve, network and card", show_default=False)],
    steps: Annotated[int | None, Option(metavar="N", min=1, help="so many steps instead of the recipe's")] = None,
    seed: Annotated[int, Option(metavar="S", help="another seed gives other weights")] = 0,
    mocap: Packs = [],  # noqa: B006
    device: Annotated[str, Option(metavar="NAME", help="cpu or cuda")] = "cpu",
) -> None:
    """Train the network that lifts people from the pictures into space; goes on from its last checkpoint."""
    from humanmm.flows.training.lifter import train_lifter
    from humanmm.models.learning.training import Recipe

    recipe = Recipe(seed=seed) if steps is None else Recipe(seed=seed, steps=steps)
    write(train_lifter.fn(pairs, out, recipe, tuple(mocap), device))
