"""`humanmm dataset build NAME`: data sets for `humanmm bench`, rendered here or cut from files that the user owns."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

from typer import Option

from humanmm.cli.terminal import write
from humanmm.cli.verb import BENCHMARK, Force, Store, app, group, verb
from humanmm.errors import InputError, UsageError

if TYPE_CHECKING:
    from humanmm.models.benchmark.recordings import ImageRecording, MultiviewSequence

T = TypeVar("T")

Out = Annotated[Path, Option(metavar="DIR", help="where the data set is written", show_default=False)]
dataset = group("Build the data sets of the benchmark.")
build = group("Build one data set.")
app.add_typer(dataset, name="dataset", rich_help_panel=BENCHMARK)
dataset.add_typer(build, name="build")


_SIZES = "one clip of 2 s, 60 clips of 7 to 12 s, or 96 short clips of all that makes shots hard to join"


@verb(build, "ms-render")
def ms_render(
    *,
    out: Out,
    size: Annotated[Literal["tiny", "standard", "places"], Option(help=_SIZES)] = "standard",
    split: Annotated[Literal["dev", "test", "train"], Option(help="whose motion places shows")] = "dev",
    count: Annotated[int | None, Option(metavar="N", min=1, help="so many clips instead")] = None,
    seconds: Annotated[tuple[float, float] | None, Option(metavar="LOW HIGH", help="clips of such lengths")] = None,
    resolution: Annotated[tuple[int, int] | None, Option(metavar="W H", help="all clips of this size, pixels")] = None,
    seed: Annotated[int | None, Option(metavar="S", help="another seed makes other clips")] = None,
    mocap: Annotated[list[Path], Option(metavar="FILE…", help="motion capture (default: data/mocap's packs)")] = [],  # noqa: B006
    threads: Annotated[int, Option(metavar="N", help="clips made at a time")] = 2,
    force: Force = False,
) -> None:
    """Rendered people with exact truth; nothing else is needed."""
    from humanmm.flows.bench.render_set import SEED, SetPlan, build_set, shipped_packs

    if resolution and (min(resolution) < 16 or any(side % 2 for side in resolution)):
        raise UsageError(f"--resolution {resolution}: two even numbers of at least 16 are needed")
    if seconds and not 0 < seconds[0] <= seconds[1]:
        raise UsageError(f"--seconds {seconds}: two rising positive numbers are needed")
    packs = tuple(mocap) if mocap else shipped_packs(size, split)
    plan = SetPlan(
        packs, size, SEED if seed is None else seed, count, seconds=seconds, resolution=resolution, split=split
    )
    write(build_set(plan, out, threads=threads, force=force))


# ---- cut from what the user must have


@dataclass(frozen=True, kw_only=True)
class Folders:
    """Where data of the user's lie, and where their clips go."""

    root: Annotated[Path, Option(metavar="DIR", help="the data set's own folder", show_default=False)]
    out: Out
    force: Force = False

    def check(self) -> None:
        """Raise InputError if there is nothing to read, or something to overwrite."""
        if not self.root.is_dir():
            raise InputError(f"{self.root} is not a folder; --root must be the data set's own folder")
        if self.out.exists() and any(self.out.iterdir()) and not self.force:
            raise InputError(f"{self.out} is not empty; give --force to replace what is there")


@dataclass(frozen=True, kw_only=True)
class Source(Folders):
    """A data set of many sequences."""

    count: Annotated[int | None, Option(metavar="N", min=1, help="only the first N sequences (rich: views)")] = None

    def first(self, names: Sequence[T]) -> Sequence[T]:
        """Those of all sequences that are wanted."""
        return names if self.count is None else names[: self.count]


@verb(build, "ms-aist")
def ms_aist(
    source: Source,
    *,
    videos: Annotated[Path | None, Option(metavar="DIR", help="AIST's videos: also cut clips from them")] = None,
) -> None:
    """From the annotations of AIST++ (CC BY 4.0) and, for clips with pictures, the AIST videos.

    --root holds keypoints2d, keypoints3d, cameras, ignore_list.txt; --videos <sequence>.mp4, with c01 … c09 for cAll.
    """
    from humanmm.flows.bench.dataset_builder import write_sequences
    from humanmm.storage.readers.datasets import aistpp

    source.check()
    names = source.first(aistpp.sequence_names(source.root))
    write_sequences(source.root, names, source.out)
    write(f"{len(names)} sequences; measure with: humanmm bench ms-aist --data {source.out}")
    if videos is not None:
        _cut((aistpp.read_multiview(source.root, videos, name) for name in names), source.out / "clips")
    write(source.out)


@verb(build, "ms-h36m")
def ms_h36m(source: Source) -> None:
    """From Human3.6M's videos, positions and cameras; experimental: its files could not be tried here.

    --root holds metadata.xml, S*/MyPoseFeatures/D3_Positions/*.cdf, S*/Videos/*.mp4.
    """
    from humanmm.storage.readers.datasets import human36m

    source.check()
    names = source.first(human36m.sequence_names(source.root))
    _cut((human36m.read_multiview(source.root, name) for name in names), source.out)
    write(source.out)


@verb(build, "pose2sim")
def pose2sim(source: Folders, *, store: Store = None) -> None:
    """Clips between any two cameras of a calibrated rig, and where all of its cameras see the people's joints.

    --root holds videos/, one for each of three or more synchronised cameras, and calibration/ (a project of Pose2Sim).
    """
    from humanmm.config import Config
    from humanmm.flows.bench.dataset_builder import build_rig_set
    from humanmm.storage.readers.datasets.pose2sim import read_rig
    from humanmm.storage.store.open import open_store
    from humanmm.tasks.units.process import prepare_process

    source.check()
    prepare_process()
    sentences = build_rig_set(read_rig(source.root), source.out, Config(), open_store(store))
    write(*sentences, f"measure with: humanmm bench ms-real --data {source.out}", source.out)


@verb(build, "3dpw")
def threedpw(source: Source) -> None:
    """Whole videos of 3DPW with truths; experimental: its files could not be tried here.

    --root holds sequenceFiles/<split>/*.pkl, imageFiles/*.
    """
    from humanmm.storage.readers.datasets import threedpw as reader

    source.check()
    paths = source.first(reader.sequence_files(source.root))
    _write((reader.read_recording(source.root, path) for path in paths), source.out)


@verb(build, "emdb")
def emdb(
    source: Source,
    *,
    split: Annotated[int, Option(metavar="N", min=1, max=2, help="EMDB-1 or EMDB-2", show_default=False)],
    smpl: Annotated[Path, Option(metavar="FILE", help="your SMPL model, .npz", show_default=False)],
) -> None:
    """Whole videos of EMDB-1 or EMDB-2 with truths, and your SMPL model; experimental: not tried on its files.

    --root holds P0 … P9, --smpl v_template, shapedirs, J_regressor (EMDB holds no joints).
    """
    from humanmm.storage.readers.datasets import emdb as reader
    from humanmm.storage.readers.datasets.smpl_joints import read_smpl

    source.check()
    body = read_smpl(smpl)
    paths = source.first(reader.sequence_files(source.root, split))
    _write((reader.read_recording(path, body) for path in paths), source.out)


@verb(build, "rich")
def rich(
    source: Source,
    *,
    split: Annotated[Literal["train", "val", "test"], Option(help="part of the data set", show_default=False)],
    smplx: Annotated[Path, Option(metavar="DIR", help="your SMPL-X models", show_default=False)],
) -> None:
    """Whole videos of RICH's static cameras with truths, and your SMPL-X models; experimental: not tried on its files.

    --root holds bodies, images, scan_calibration, multicam2world; --smplx SMPLX_FEMALE.npz and SMPLX_MALE.npz (RICH
    holds no joints).
    """
    from humanmm.storage.readers.datasets import rich as reader
    from humanmm.storage.readers.datasets.smpl_joints import read_smplx

    source.check()
    models = reader.Models(read_smplx(smplx / "SMPLX_FEMALE.npz"), read_smplx(smplx / "SMPLX_MALE.npz"))
    views = source.first(reader.views(source.root, split))
    _write((reader.read_recording(view, models) for view in views), source.out)


def _cut(sequences: "Iterator[MultiviewSequence]", folder: Path) -> None:
    from humanmm.flows.bench.dataset_builder import build_set

    facts = build_set(sequences, folder)
    write(facts.sentence(), f"measure with: humanmm bench ms-real --data {folder}")


def _write(recordings: "Iterator[ImageRecording]", folder: Path) -> None:
    from humanmm.flows.bench.dataset_builder import write_recording

    for recording in recordings:
        write_recording(recording, folder)
    write(f"measure with: humanmm bench ms-real --data {folder}", folder)
