"""The whole configuration: one tree of frozen pydantic models, a section a stage.

Every field has bounds, a unit and one sentence; that sentence is the command line's help, the dashboard's form and the
docs. A section's values are part of the store key of the stages that name it (see `humanmm.tasks.pipeline`).
"""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, AliasChoices, BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from humanmm import parts
from humanmm.corrections import MAX_FOCAL_PX, Corrections
from humanmm.errors import ConfigError, InputError
from humanmm.machine import expanded


def _part(setting: str) -> AfterValidator:
    """The name of an installed part (`humanmm.parts`)."""

    def check(name: str) -> str:
        try:
            return parts.find(setting, name).name
        except ConfigError as error:
            raise PydanticCustomError("stated", "{reason}", {"reason": str(error)}) from None

    return AfterValidator(check)


STAGES_WITHOUT_SECTION = {"keyframes"}
SECTIONS_OF_NO_STAGE = {"lifting", "run", "corrections"}


class Section(BaseModel):
    """Base of all sections: frozen, unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True, allow_inf_nan=False)

    @property
    def facts(self) -> dict[str, Any]:
        """Its values as json, as they decide results: of a file that was brought along its name and content, wherever
        it lies."""
        given = {field: value.facts for field, value in self if isinstance(value, GivenFile)}
        return {**self.model_dump(mode="json"), **given}


MAX_GIVEN_BYTES = 2**31
GIVEN_SUFFIXES = (".json", ".txt", ".tum", ".bin", ".png", ".pt", ".pkl", ".npz")
"""Of a folder, files with other endings are left alone."""


class GivenFile(Section):
    """A file, or a folder of files, that another program made: where it is, and its content. Its path alone will do."""

    path: str
    """Where it is."""

    sha256: str
    """Of its content: of every file's name and bytes if it is a folder. A run stops if it is no longer this content."""

    @model_validator(mode="before")
    @classmethod
    def _of_path(cls, given: Any) -> Any:
        tree = {"path": str(given)} if isinstance(given, str | Path) else given
        if not isinstance(tree, Mapping) or "path" not in tree or "sha256" in tree:
            return tree
        path = expanded(Path(str(tree["path"]))).absolute()
        try:
            return {"path": str(path), "sha256": _digest(path, _contents(path))}
        except InputError as error:
            raise PydanticCustomError("stated", "{reason}", {"reason": str(error)}) from None

    @property
    def facts(self) -> dict[str, Any]:
        """Its content, and of a file its name, which may say the frame; those of a folder are in its digest."""
        path = Path(self.path)
        return {"name": "" if path.is_dir() else path.name, "sha256": self.sha256}

    def read(self) -> dict[str, bytes]:
        """Name → bytes of each file; InputError if the content is no longer that of `sha256`."""
        contents = _contents(Path(self.path))
        if _digest(Path(self.path), contents) != self.sha256:
            raise InputError(
                f"{self.path} has changed since its content was noted; run again with the file as it is now"
            )
        return contents


def _contents(path: Path) -> dict[str, bytes]:
    try:
        files = [path] if path.is_file() else sorted(p for p in path.iterdir() if p.suffix in GIVEN_SUFFIXES)
        if sum(file.stat().st_size for file in files) > MAX_GIVEN_BYTES:
            raise InputError(f"{path} is larger than {MAX_GIVEN_BYTES:,} bytes")
        contents = {file.name: file.read_bytes() for file in files if file.is_file()}
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None
    if not contents:
        raise InputError(f"{path} holds no file that is read ({', '.join(GIVEN_SUFFIXES)})")
    return contents


def _digest(path: Path, contents: Mapping[str, bytes]) -> str:
    """A file's sha256 is that of its bytes, whatever its name; in a folder names count, since they say the frame."""
    if path.is_file():
        return hashlib.sha256(contents[path.name]).hexdigest()
    total = hashlib.sha256()
    for name, content in contents.items():
        total.update(f"{name}\0{hashlib.sha256(content).hexdigest()}\n".encode())
    return total.hexdigest()


class DecodeConfig(Section):
    """Reading the container."""

    max_side_px: Annotated[int, Field(ge=64, le=16384)] = 8192
    """Largest picture side accepted, in pixels; a header that claims more is refused."""

    max_memory_mb: Annotated[int, Field(ge=16)] = 850
    """Memory in MB that the pictures of the video's decoder may take; a video that takes more is refused."""


class ScenesConfig(Section):
    """Colour-based cuts and gradual transitions (paper section 3.1, part 1)."""


BEST_HZ, FAST_HZ = 30.0, 15.0
"""What `people.max_rate_hz` is unless it is given. Bodies at 60, 30 and 15 Hz are about as good
(docs/measurements/perception.md)."""


class PeopleConfig(Section):
    """Person detection, 2D/3D pose, masks, tracking."""

    detector: Annotated[str, _part("people.detector")] = "movenet-multipose"
    """Network that finds people in a picture, by name."""

    pose: Annotated[str, _part("people.pose")] = "best"
    """Networks that find a person's landmarks and mask, by name: `best` (BlazePose heavy and MoveNet Thunder, refined),
    `fast` (the same, half as often), or BlazePose alone (`blazepose-heavy`, `blazepose-full`)."""

    max_people: Annotated[int, Field(ge=1, le=32)] = 6
    """Largest number of people tracked at the same time."""

    max_side_px: Annotated[int, Field(ge=320, le=8192)] = 1920
    """Largest side of the picture that the detector works on; larger videos are looked at reduced, in pixels."""

    max_rate_hz: Annotated[float, Field(ge=5, le=1000)] | None = None
    """Frames a second that are looked at, at most: 30, with `people.pose` `fast` 15, unless it is given. What lies
    between two looks at a person is interpolated."""

    hands: bool = False
    """Look at everybody's hands as well, for the joints of the fingers."""

    keypoints_from: GivenFile | None = None
    """File or folder of keypoints that another program found, in place of detector and pose network: OpenPose, MMPose,
    Sports2D, Pose2Sim, AlphaPose or COCO json."""

    hmr_from: GivenFile | None = None
    """File or folder of bodies that another system found, in place of detector, pose network and lifter: GVHMR; also
    GEM, GEM-X, PromptHMR, WHAM, TRAM, SLAHMR, SAM 3D Body (experimental)."""

    detections_from: GivenFile | None = None
    """File of people's boxes that another program found, in place of the detector: MOT text or COCO results json."""

    masks_from: GivenFile | None = None
    """Folder of pictures of people's masks, one a frame, in place of the detector: a pixel's value is the person's
    number, 0 is nobody."""

    trust_numbers: bool = False
    """The numbers of people in detections_from or masks_from are theirs through the whole video: who is who across cuts
    is as given, not found."""

    @property
    def looks_hz(self) -> float:
        """Frames a second that are looked at, at most."""
        return self.max_rate_hz or (FAST_HZ if self.pose == "fast" else BEST_HZ)

    @property
    def facts(self) -> dict[str, Any]:
        return {**super().facts, "max_rate_hz": self.looks_hz}  # no code of a stage states the rates above

    @model_validator(mode="after")
    def _one_source(self) -> "PeopleConfig":
        names = ("keypoints_from", "hmr_from", "detections_from", "masks_from")
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) > 1:
            raise PydanticCustomError("stated", "{reason}", {"reason": f"{' and '.join(given)} exclude each other"})
        if self.trust_numbers and (self.detections_from or self.masks_from) is None:
            reason = "trust_numbers is about the numbers of people in detections_from or masks_from: give one of these"
            raise PydanticCustomError("stated", "{reason}", {"reason": reason})
        if self.hands and given and given[0] in ("keypoints_from", "hmr_from"):
            reason = f"hands are looked for beside our own pose network: leave hands out with {given[0]}"
            raise PydanticCustomError("stated", "{reason}", {"reason": reason})
        return self


class LiftingConfig(Section):
    """Landmarks in space and joint rotations from what the pose network sees over time."""

    method: Annotated[str, _part("lifting.method")] = "transformer"
    """What lifts people, by name; `none` keeps the pose network's own landmarks."""

    weights: GivenFile | None = None
    """Network of the method `transformer` in place of the shipped one: a file that `humanmm train lifter` wrote."""

    keypoints: Annotated[str, _part("lifting.keypoints")] = "transformer"
    """What finds 3D landmarks of 2D keypoints alone (people.keypoints_from, benchmark ms-aist), by name."""

    @model_validator(mode="after")
    def _of_its_method(self) -> "LiftingConfig":
        if self.weights is not None and self.method != "transformer":
            reason = f"weights are of the method transformer: leave them out with {self.method}"
            raise PydanticCustomError("stated", "{reason}", {"reason": reason})
        return self


class ShotsConfig(Section):
    """Cuts from boxes and keypoints (paper section 3.1, parts 2 and 3) and identities across cuts."""

    parts: Literal["scenes", "boxes", "keypoints"] = "keypoints"
    """How much of the three-part detector looks for cuts: `scenes` (colours alone), `boxes` (and people's boxes) or
    `keypoints` (and their keypoints)."""

    min_confidence: Annotated[float, Field(ge=0, le=1)] = 0.2
    """Probability of being a person, and not a bag, a poster or nothing, from which somebody is recovered; below 0.5 he
    is marked as doubtful."""

    need_people: bool = True
    """Refuse a video in which nobody is seen; `humanmm camera` does not."""

    person: Annotated[int, Field(ge=0)] | None = None
    """Keep only this person (0 is the main subject); all people when not given."""


class PointsConfig(Section):
    """Long point tracks on the background."""

    tracker: Annotated[str, _part("points.tracker")] = "klt"
    """Point tracker, by name."""

    max_side_px: Annotated[int, Field(ge=160, le=4096)] = 640
    """Longest side, in pixels, of the grey pictures in which points are tracked."""

    num_points: Annotated[int, Field(ge=32, le=4096)] = 200
    """Cells of the grid over the picture that are each kept supplied with a point."""


MIN_FOV_DEG, MAX_FOV_DEG = 1, 179


class IntrinsicsConfig(Section):
    """One focal length for all shots (the paper's assumption) but those that clearly have a lens of their own."""

    focal_px: Annotated[float, Field(gt=0, le=MAX_FOCAL_PX)] | None = None
    """Focal length in pixels of the source resolution, square ones; given values are never re-estimated, and are
    those of the first frame of a shot that zooms."""

    fov_deg: Annotated[float, Field(gt=MIN_FOV_DEG, lt=MAX_FOV_DEG)] | None = None
    """Horizontal field of view in degrees, in place of focal_px."""

    cameras_from: GivenFile | None = None
    """Cameras that another program found, in place of our estimate: a TUM trajectory (or a folder of one a shot), or a
    folder with COLMAP's model, text or binary, whose focal length is used as well."""

    @model_validator(mode="after")
    def _one_focal_length(self) -> "IntrinsicsConfig":
        if self.focal_px is not None and self.fov_deg is not None:
            raise PydanticCustomError("stated", "{reason}", {"reason": "focal_px and fov_deg exclude each other"})
        return self


class CameraConfig(Section):
    """Camera motion inside a shot (paper section 3.2)."""

    estimator: Annotated[str, _part("camera.estimator")] = "bundle"
    """What estimates a shot's camera from tracked points, by name."""

    static: bool = False
    """Declare every shot's camera static instead of testing for it."""


class HmrConfig(Section):
    """Fit of the body to one shot's keypoints and landmarks."""

    initial_pose: Annotated[str, _part("hmr.initial_pose")] = "inverse-kinematics"
    """What gives the pose at which the fit begins, by name."""

    pose_prior: Annotated[float, Field(ge=0, le=10)] = 1.0
    """Weight of motion-capture statistics of poses against what one frame shows; 0 trusts the frame alone."""

    smoothness: Annotated[float, Field(gt=0, le=100)] = 1.0
    """Accelerations to expect, as a multiple of everyday and sports motion capture; larger values smooth less."""


class AlignConfig(Section):
    """Joining shots into one world (paper section 3.3.1)."""

    method: Annotated[str, _part("align.method")] = "bundle"
    """How the camera's rotation at a cut is found, by name: `bundle` (adjusting the body's motion through the cut) or
    `eight-point` (the paper's essential matrix)."""


class RefineConfig(Section):
    """One motion over all shots: smoothing, contacts, foot locking, filled gaps."""

    cutoff_hz: Annotated[float, Field(ge=1, le=60)] = 8.0
    """Band limit of the joints' rotations, in Hz; quicker motion is taken for noise."""

    remove_discontinuities: Annotated[
        bool, Field(validation_alias=AliasChoices("remove_discontinuities", "close_seams"))  # its name in older runs
    ] = True
    """Distribute the jump of posture at a cut over both shots."""

    networks: Annotated[str, _part("refine.networks")] = "trajectory"
    """What is learnt of motion, by name: `trajectory` (trajectory predictor and refiner say how fast the root goes),
    `all` (ms-HMR corrects poses besides) or `none`."""

    refit: bool = True
    """Fit the body once more to the evidence of all shots together, with standing feet held."""

    foot_lock: bool = True
    """Hold standing feet in place by inverse kinematics."""


class DeliverConfig(Section):
    """Pictures and files of the run folder."""

    overlay_max_side_px: Annotated[int, Field(ge=160, le=4096)] = 1280
    """Largest side of overlay.mp4, in pixels."""

    overlay_quality: Annotated[int, Field(ge=10, le=40)] = 22
    """Constant rate factor of overlay.mp4: smaller is better and larger in bytes."""

    overlay_opacity: Annotated[float, Field(ge=0, le=1)] = 0.9
    """Opacity of the bodies on the video: 0 is invisible, 1 hides what is behind them."""

    scene_max_s: Annotated[float, Field(ge=0)] = 600.0
    """Longest video, in seconds, for which view/scene.html is written; 0 writes none."""


class StageLimits(Section):
    """What one unit of a stage may use; what is not given is as in the table of stages."""

    threads: Annotated[int, Field(ge=1, le=256)] | None = None
    """Threads of `run.threads` that it counts for."""

    memory_mb: Annotated[int, Field(ge=1)] | None = None
    """Part of `run.memory_mb` that it counts for, in MB."""

    gpu: bool | None = None
    """Whether it waits for a slot of Prefect's global concurrency limit `gpu`."""

    limit_s: Annotated[float, Field(gt=0)] | None = None
    """Seconds after which it is ended, in place of `run.limit_s`."""


class RunConfig(Section):
    """How stages are run; no field here changes a result."""

    runner: Literal["threads", "dask", "ray"] = "threads"
    """Where stages compute: in `threads` of one process, or in processes of Dask or Ray (extras `dask`, `ray`)."""

    cluster: str | None = None
    """Address of a Dask scheduler or Ray cluster that runs already (default: `run.threads` workers on this machine)."""

    threads: Annotated[int, Field(ge=1, le=256)] = 2
    """Stages of one video that run at the same time, over all workers together."""

    memory_mb: Annotated[int, Field(ge=1)] | None = None
    """Memory in MB that stages of one video may use together: one more waits while it would not fit (default: 640 for
    each of `run.threads`; any on Dask and Ray)."""

    limit_s: Annotated[float, Field(gt=0)] | None = None
    """Seconds that one unit of a stage may take; one that takes longer is ended and fails (default: any)."""

    isolate: bool = False
    """Compute stages in child processes, as with a time limit: a crash or lack of memory costs one unit, not all."""

    stages: Mapping[str, StageLimits] = {}
    """Limits of single stages: `[run.stages.camera] limit_s = 60` in a file, `{camera = {limit_s = 60}}` in a flag."""

    max_retries: Annotated[int, Field(ge=0, le=10)] = 2
    """How often a stage is tried again after an infrastructure fault (I/O, lost worker, lack of memory); bad input is
    never tried again."""

    @model_validator(mode="after")
    def _cluster_of_an_engine(self) -> "RunConfig":
        if self.cluster is not None and self.runner == "threads":
            raise ValueError("run.cluster needs run.runner = dask or ray")
        return self


class Config(Section):
    """Everything that can be set for one run."""

    decode: DecodeConfig = DecodeConfig()
    scenes: ScenesConfig = ScenesConfig()
    people: PeopleConfig = PeopleConfig()
    lifting: LiftingConfig = LiftingConfig()
    shots: ShotsConfig = ShotsConfig()
    points: PointsConfig = PointsConfig()
    intrinsics: IntrinsicsConfig = IntrinsicsConfig()
    camera: CameraConfig = CameraConfig()
    hmr: HmrConfig = HmrConfig()
    align: AlignConfig = AlignConfig()
    refine: RefineConfig = RefineConfig()
    deliver: DeliverConfig = DeliverConfig()
    run: RunConfig = RunConfig()
    corrections: Corrections = Corrections()

    @model_validator(mode="after")
    def _known_stages(self) -> "Config":
        stages = set(type(self).model_fields) - SECTIONS_OF_NO_STAGE | STAGES_WITHOUT_SECTION
        unknown = sorted(set(self.run.stages) - stages)
        if unknown:
            raise ValueError(f"run.stages names {unknown[0]!r}, which is no stage")
        return self
