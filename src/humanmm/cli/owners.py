"""`humanmm dataset build ms-aist | ms-h36m | 3dpw | emdb | rich`: from folders that the user owns."""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from humanmm.cli.settings import UsageError
from humanmm.errors import InputError

if TYPE_CHECKING:
    from humanmm.models.benchmark.recordings import MultiviewSequence

T = TypeVar("T")

TRANSITIONS = (2, 3, 4)
SEED = 2025


def declare_aist(parser: argparse.ArgumentParser) -> None:
    """Flags of ms-aist."""
    _declare(parser, "the annotations of AIST++ (keypoints2d, keypoints3d, cameras, ignore_list.txt)")
    parser.add_argument(
        "--videos", type=Path, metavar="DIR",
        help="the AIST videos (<sequence>.mp4, cAll replaced by c01 … c09): also cut clips from them",
    )  # fmt: skip


def declare_h36m(parser: argparse.ArgumentParser) -> None:
    """Flags of ms-h36m."""
    _declare(parser, "Human3.6M: metadata.xml, S*/MyPoseFeatures/D3_Positions/*.cdf, S*/Videos/*.mp4")


def declare_3dpw(parser: argparse.ArgumentParser) -> None:
    """Flags of 3dpw."""
    _declare(parser, "3DPW: sequenceFiles/<split>/*.pkl, imageFiles/*")


def declare_emdb(parser: argparse.ArgumentParser) -> None:
    """Flags of emdb."""
    _declare(parser, "EMDB: P0 … P9")
    parser.add_argument("--split", type=int, choices=(1, 2), required=True, metavar="N", help="EMDB-1 or EMDB-2")
    parser.add_argument(
        "--smpl", type=Path, required=True, metavar="FILE",
        help="your SMPL model as .npz: v_template, shapedirs, J_regressor (EMDB holds no joints)",
    )  # fmt: skip


def declare_rich(parser: argparse.ArgumentParser) -> None:
    """Flags of rich."""
    _declare(parser, "RICH: bodies, images, scan_calibration, multicam2world")
    parser.add_argument(
        "--split", choices=("train", "val", "test"), required=True, metavar="NAME", help="train, val or test"
    )
    parser.add_argument(
        "--smplx", type=Path, required=True, metavar="DIR",
        help="your SMPL-X models SMPLX_FEMALE.npz and SMPLX_MALE.npz (RICH holds no joints)",
    )  # fmt: skip


def build_aist(options: argparse.Namespace) -> Path:
    """Sequences as `bench ms-aist` reads them and, with the videos, clips as `bench ms-real` does."""
    import numpy as np

    from humanmm.storage.readers.datasets import aistpp
    from humanmm.storage.store.files import replace_file

    _check_output(options)
    names = _first(aistpp.sequence_names(options.root), options.count)
    for name in names:
        arrays = aistpp.read_arrays(options.root, name)

        def save(fresh: Path, arrays: dict[str, np.ndarray] = arrays) -> None:
            with fresh.open("wb") as file:
                np.savez_compressed(file, **arrays)  # type: ignore[arg-type]

        replace_file(options.out / f"{name}.npz", save)
    sys.stdout.write(f"{len(names)} sequences; measure with: humanmm bench ms-aist --data {options.out}\n")
    if options.videos is not None:
        clips = options.out / "clips"
        sequences = (aistpp.read_multiview(options.root, options.videos, name) for name in names)
        _cut(sequences, clips)
    return Path(options.out)


def build_h36m(options: argparse.Namespace) -> Path:
    """Clips as `bench ms-real` reads them."""
    from humanmm.storage.readers.datasets import human36m

    _check_output(options)
    names = _first(human36m.sequence_names(options.root), options.count)
    _cut((human36m.read_multiview(options.root, name) for name in names), options.out)
    return Path(options.out)


def build_3dpw(options: argparse.Namespace) -> Path:
    """Whole videos with truths, as `bench ms-real` reads them."""
    from humanmm.flows.bench.dataset_builder import write_recording
    from humanmm.storage.readers.datasets import threedpw

    _check_output(options)
    for path in _first(threedpw.sequence_files(options.root), options.count):
        write_recording(threedpw.read_recording(options.root, path), options.out)
    sys.stdout.write(f"measure with: humanmm bench ms-real --data {options.out}\n")
    return Path(options.out)


def build_emdb(options: argparse.Namespace) -> Path:
    """Whole videos with truths, as `bench ms-real` reads them."""
    from humanmm.flows.bench.dataset_builder import write_recording
    from humanmm.storage.readers.datasets import emdb
    from humanmm.storage.readers.datasets.smpl_joints import read_smpl

    _check_output(options)
    body = read_smpl(options.smpl)
    for path in _first(emdb.sequence_files(options.root, options.split), options.count):
        write_recording(emdb.read_recording(path, body), options.out)
    sys.stdout.write(f"measure with: humanmm bench ms-real --data {options.out}\n")
    return Path(options.out)


def build_rich(options: argparse.Namespace) -> Path:
    """Whole videos with truths, one for every camera that stands, as `bench ms-real` reads them."""
    from humanmm.flows.bench.dataset_builder import write_recording
    from humanmm.storage.readers.datasets import rich
    from humanmm.storage.readers.datasets.smpl_joints import read_smplx

    _check_output(options)
    models = rich.Models(read_smplx(options.smplx / "SMPLX_FEMALE.npz"), read_smplx(options.smplx / "SMPLX_MALE.npz"))
    for view in _first(rich.views(options.root, options.split), options.count):
        write_recording(rich.read_recording(view, models), options.out)
    sys.stdout.write(f"measure with: humanmm bench ms-real --data {options.out}\n")
    return Path(options.out)


def _cut(sequences: "Iterator[MultiviewSequence]", folder: Path) -> None:
    from humanmm.flows.bench.dataset_builder import build_set

    facts = build_set(sequences, folder, transitions=TRANSITIONS, seed=SEED)
    sys.stdout.write(f"{facts.sentence()}\nmeasure with: humanmm bench ms-real --data {folder}\n")


def _declare(parser: argparse.ArgumentParser, root: str) -> None:
    parser.add_argument("--root", type=Path, required=True, metavar="DIR", help=root)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="where the data set is written")
    parser.add_argument("--count", type=int, metavar="N", help="only the first N sequences (rich: views)")
    parser.add_argument("--force", action="store_true", help="replace what is in --out")


def _check_output(options: argparse.Namespace) -> None:
    if options.count is not None and options.count < 1:
        raise UsageError(f"--count {options.count}: at least one sequence is needed")
    if not options.root.is_dir():
        raise InputError(f"{options.root} is not a folder; --root must be the data set's own folder")
    if options.out.exists() and any(options.out.iterdir()) and not options.force:
        raise InputError(f"{options.out} is not empty; give --force to replace what is there")


def _first(names: Sequence[T], count: int | None) -> Sequence[T]:
    return names if count is None else names[:count]
