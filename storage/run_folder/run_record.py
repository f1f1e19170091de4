"""run.json: what happened in one run, as the public contract describes it (schema "humanmm.run/1")."""

import json
import math
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from humanmm.errors import InputError
from humanmm.models.records.motion import CutAlignment, Facing, PathScale, PoseError, RotationEvidence, WorldMotion
from humanmm.models.records.shots import ShotList, Transition
from humanmm.models.records.video import VideoFacts
from humanmm.storage.store.codec import Json
from humanmm.storage.store.files import OTHER_FOLDER, replace_file
from humanmm.storage.store.locks import FileLock

if TYPE_CHECKING:  # importing it loads the numerical libraries, which `status` does not need
    from humanmm.models.records.camera import Intrinsics, ShotCamera
    from humanmm.models.records.recording import Guesses, IdentityGuess

SCHEMA = "humanmm.run/1"
OTHER_VIDEO = "it was written for another video"
FILE = "run.json"
UNFINISHED = "unfinished"
"""The `state` in a run.json whose folder is being written."""
LOCK = ".lock"
"""An empty file of the run folder, locked by the run that writes there."""
WRITING_S = 60.0
"""How long a reader waits for a run that writes the folder: it takes a second or two, more on a slow disk."""


@dataclass(frozen=True)
class StageRecord:
    """What became of one stage × unit."""

    stage: str
    unit: str
    """`video`, `scene 2` or `shot 3`."""
    shot: int | None
    state: str
    """cached, computed, failed or skipped."""
    reason: str
    """Why it was computed, or why it failed; empty if cached."""
    began: float | None
    """When it began, seconds since 1970; None if cached."""
    seconds: float
    """Spent on it in this run."""
    computed_seconds: float | None
    """What computing its artifact took, in this run or an earlier one."""
    attempts: int
    faults: tuple[str, ...]
    """What went wrong in each attempt that failed."""
    key: str | None
    digest: str | None
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class CorrectionRecord:
    """What became of one correction of the user's."""

    correction: Mapping[str, Json]
    """As it stands in corrections.toml."""
    text: str
    """In words."""
    applied: bool
    reason: str
    """Why it does not fit; or what is to be known although it does."""


def run_record(  # noqa: PLR0913 (one a section of run.json)
    *,
    state: str,
    video: Path,
    sha256: str,
    store: str,
    config: Mapping[str, Any],
    facts: VideoFacts,
    shots: ShotList,
    intrinsics: "Intrinsics",
    cameras: Sequence["ShotCamera | None"],
    motion: WorldMotion | None,
    stages: Sequence[StageRecord],
    corrections: Sequence[CorrectionRecord],
    guesses: "Guesses | None" = None,
    started: str,
    seconds: float,
    versions: Mapping[str, str],
) -> dict[str, Any]:
    """The tree of run.json."""
    people, fallbacks = _people(shots, motion, guesses), _fallbacks(shots, motion)
    intrinsics = _disputed(intrinsics, motion)
    return {
        "schema": SCHEMA,
        "state": state,
        "started": started,
        "seconds": round(seconds, 3),
        "video": {
            "path": os.fspath(video),
            "sha256": sha256,
            "fps": facts.fps,
            "width": facts.width,
            "height": facts.height,
            **coded_picture(facts),
            "num_frames": facts.num_frames,
        },
        "store": store,
        "config": dict(config),
        "focal": {
            "px": _figure(intrinsics.focal_px * (motion.focal_factor if motion else 1.0)),
            "estimated_px": _figure(intrinsics.focal_px),
            "source": intrinsics.source,
            "relative_uncertainty": _figure(intrinsics.relative_uncertainty),
            "distortion": _figure(intrinsics.distortion),
        },
        "floor": _floor(guesses, corrections),
        "scale": _scale(people),
        "shots": _shots(facts, shots, cameras, motion, stages),
        "people": people,
        "left_out": [{"probability": _figure(one.probability), "shots": list(one.shots)} for one in shots.left_out],
        "unfollowed": [
            {
                "start": one.first,
                "end": one.last + 1,
                "box": [_figure(side) for side in one.box],
                "score": _figure(one.score),
                "crowded": one.crowded,
            }
            for one in shots.unfollowed
        ],
        "suspected_cuts": list(shots.suspected),
        "corrections": [dict(one.__dict__) for one in corrections],
        "warnings": [
            *_misfits(corrections),
            *_warnings(stages),
            *_doubts(intrinsics, guesses, corrections, shots),
            *_unlikely_heights(people),
            *fallbacks,
        ],
        "fallbacks": fallbacks,
        "failures": [
            {"stage": r.stage, "unit": r.unit, "shot": r.shot, "reason": r.reason}
            for r in stages
            if r.state in ("failed", "skipped")
        ],
        "stages": [_stage(record) for record in stages],
        "versions": dict(versions),
    }


def coded_picture(facts: VideoFacts) -> dict[str, Json]:
    """What the file stores: the size of its pictures before their rotation, the shape of its pixels, the rotation, and
    whether pictures are woven from two fields."""
    width, height = facts.coded_size or (facts.width, facts.height)
    return {
        "coded_width": width,
        "coded_height": height,
        "sample_aspect_ratio": "{}:{}".format(*facts.sample_aspect_ratio),
        "rotation_deg": facts.rotation_deg,
        "interlaced": facts.interlaced,
    }


def write_run_record(run_dir: Path, record: Mapping[str, Any]) -> None:
    """Write run.json, visible only when complete."""
    text = json.dumps(record, indent=1, ensure_ascii=False) + "\n"
    replace_file(run_dir / FILE, lambda fresh: _write(fresh, text))


def begin_run_record(run_dir: Path) -> None:
    """Say in run.json that the folder is being written: until `write_run_record` it holds the old and the new."""
    text = json.dumps({"schema": SCHEMA, "state": UNFINISHED})
    replace_file(run_dir / FILE, lambda path: _write(path, text))


def read_run_record(run_dir: Path) -> dict[str, Any]:
    """The tree of run.json; InputError if the folder is no run folder, or none that was written to its end.

    While a run writes the folder it waits for it, and so must not be called by who holds the folder's lock then.
    """
    record = _read(run_dir)
    deadline = time.monotonic() + WRITING_S
    while record.get("state") == UNFINISHED:
        with FileLock(run_dir / LOCK, waiting="", other=OTHER_FOLDER).tried() as is_free:
            record = _read(run_dir)  # again: it may have been written to its end before the lock was free
        if record.get("state") == UNFINISHED and (is_free or time.monotonic() > deadline):
            raise InputError(f"{run_dir} is being written, or its writing broke off; `humanmm recover` writes it anew")
        if not is_free:
            time.sleep(0.1)
    return record


def _read(run_dir: Path) -> dict[str, Any]:
    path = run_dir / FILE
    try:
        record = json.loads(path.read_text(encoding="utf-8", errors="surrogateescape"))  # as it is written
    except OSError as error:
        raise InputError(f"{run_dir} is no run folder: {FILE} cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError):
        raise InputError(f"{path} is not json; `humanmm recover` writes it anew") from None
    if not isinstance(record, dict) or record.get("schema") != SCHEMA:
        raise InputError(f"{path} has another schema than {SCHEMA!r}; `humanmm recover` writes it anew")
    return record


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", errors="surrogateescape")


def _shots(
    facts: VideoFacts,
    shots: ShotList,
    cameras: Sequence["ShotCamera | None"],
    motion: WorldMotion | None,
    stages: Sequence[StageRecord],
) -> list[dict[str, Any]]:
    from humanmm.models.video.light import gain_of

    scenes: dict[int, tuple[int, int]] = {}
    for shot in shots.shots:
        scenes[shot.scene] = scenes.get(shot.scene, (shot.start, shot.end))[0], shot.end
    joins = {cut.cut_frame: cut for cut in motion.cuts} if motion else {}
    evidence = motion.evidence if motion else ()
    scales = {one.shot: one for one in motion.path_scales} if motion else {}
    facings = motion.facings if motion else ()
    pose_errors = motion.pose_errors if motion else ()
    failed = {record.shot for record in stages if record.state in ("failed", "skipped")}
    return [
        {
            "start": shot.start,
            "end": shot.end,
            "transition": _transition(shot.transition),
            "linked": shot.start not in joins or joins[shot.start].linked,
            "join": _join(joins.get(shot.start), [one for one in evidence if one.shot_b == shot.index]),
            "people": [appearance.person for appearance in shot.people],
            "facing": [_facing(one) for one in facings if one.shot == shot.index],
            "pose": [_pose(one) for one in pose_errors if one.shot == shot.index],
            "failed": shot.index in failed,
            "gain": _figure(gain_of(facts, *scenes[shot.scene])),
            "burned_in": [[_figure(side) for side in box] for box in shot.burned_in],
            "camera": _camera(camera, scales.get(shot.index), motion.focal_factor if motion else 1.0),
        }
        for shot, camera in zip(shots.shots, cameras, strict=True)
    ]


def _join(cut: CutAlignment | None, evidence: Sequence[RotationEvidence]) -> dict[str, Json] | None:
    """How a shot was joined to those before it; null for the first."""
    if cut is None:
        return None
    return {
        "method": cut.method,
        "residual_px": _figure(cut.residual_px),
        "uncertainty_deg": _figure(cut.uncertainty_deg),
        "within_95_deg": _figure(cut.within_95_deg),
        "gap_s": _figure(cut.gap_s),
        "probability": _figure(cut.probability),
        "background_points": cut.background_inliers,
        "pose_jumps": [
            {"person": one.person, "jump_m": _figure(one.jump_m), "expected_m": _figure(one.expected_m)}
            for one in cut.pose_jumps
        ],
        "evidence": [
            {
                "shot": one.shot_a,
                "source": one.source,
                "background_points": one.num_points,
                "used": one.used,
                "reason": one.reason,
            }
            for one in evidence
        ],
    }


def _facing(facing: Facing) -> dict[str, Json]:
    """Whether somebody is turned the right way in a shot, and where that is doubtful."""
    return {
        "person": facing.person,
        "probability": _figure(facing.probability),
        "doubtful": [list(frames) for frames in facing.doubtful],
        "worst_s": _figure(facing.worst_s),
    }


def _pose(one: PoseError) -> dict[str, Json]:
    """How far somebody's pose is expected to be off in a shot, and where that is doubtful."""
    return {
        "person": one.person,
        "error_mm": _figure(1000 * one.error_m),
        "doubtful": [list(frames) for frames in one.doubtful],
    }


def _camera(camera: "ShotCamera | None", scale: PathScale | None, factor: float) -> dict[str, Json] | None:
    """How the camera of a shot was found, what gave its path a scale, and how far another program's answer lies from
    it; null where it failed. `factor`: of the focal lengths, from all that is known in the end."""
    if camera is None:
        return None
    check = camera.cross_check
    return {
        "source": camera.source,
        "focal_px": [_figure(factor * focal) for focal in camera.K[[0, -1], 0, 0]],
        "reprojection_px": _figure(camera.reprojection_px),
        "path_scale": None
        if scale is None
        else {"source": scale.source, "relative_uncertainty": _figure(scale.relative_uncertainty)},
        "cross_check": {
            "two_view_deg": _figure(check.two_view_deg),
            "bundle_deg": _figure(check.bundle_deg),
            "bundle_travel": _figure(check.bundle_travel),
        },
    }


def _figure(value: float) -> float | None:
    """A number that json can hold: nan, there is none, becomes null."""
    return None if math.isnan(value) else round(float(value), 4)


def _transition(transition: Transition | None) -> dict[str, Json] | None:
    if transition is None:
        return None
    return {"type": transition.type, "start": transition.start, "end": transition.end, "evidence": transition.evidence}


def _disputed(intrinsics: "Intrinsics", motion: WorldMotion | None) -> "Intrinsics":
    """No more certain than the people's feet and paths, which contradict it, leave it."""
    if motion is None:
        return intrinsics
    uncertainty = max(intrinsics.relative_uncertainty, motion.focal_dispute)
    return replace(intrinsics, relative_uncertainty=uncertainty)


def _people(shots: ShotList, motion: WorldMotion | None, guesses: "Guesses | None") -> list[dict[str, Any]]:
    from humanmm.models.body.body24 import load_body
    from humanmm.models.records.recording import HEIGHT_ERROR

    moved = {person.person: person for person in motion.people} if motion else {}
    identities = guesses.identities if guesses is not None else ()
    people = []
    for person in shots.people:
        entry: dict[str, Any] = {
            "person": person.person,
            "probability": round(person.probability, 4),
            "shots": [shot.index for shot in shots.shots if person.person in {a.person for a in shot.people}],
        }
        recovered = moved.get(person.person)
        if recovered is not None and len(recovered.frame):
            entry["start"], entry["end"] = int(recovered.frame[0]), int(recovered.frame[-1]) + 1
            entry["observed_frames"] = int(recovered.observed.sum())
            height_m = load_body().standing_height(recovered.betas)
            entry["height_m"] = round(height_m, 3)
            entry["height_uncertainty_m"] = 0.0 if person.height_known else round(height_m * HEIGHT_ERROR, 3)
        entry["identity"] = [
            {"shot": one.shot, "probability": round(one.probability, 4)}
            for one in identities
            if one.person == person.person
        ]
        own = [a for shot in shots.shots for a in shot.people if a.person == person.person]
        entry["sides_exchanged"] = [list(span) for appearance in own for span in appearance.left_right_swapped]
        entry["lapses"] = [list(span) for appearance in own for span in appearance.tracking_failures]
        people.append(entry)
    return people


def _applied(corrections: Sequence[CorrectionRecord], *kinds: str) -> list[CorrectionRecord]:
    return [one for one in corrections if one.applied and one.correction.get("kind") in kinds]


def _floor(guesses: "Guesses | None", corrections: Sequence[CorrectionRecord]) -> dict[str, Json]:
    """The evidence for the floor, and how sure it is; its height is 0 by definition."""
    given = bool(_applied(corrections, "floor"))
    feet = guesses is not None and not math.isnan(guesses.floor_m)
    return {
        "source": "given" if given else "feet" if feet else "assumed",
        "uncertainty_m": _figure(guesses.floor_m) if guesses is not None and not given else None,
        "standing_soles": guesses.standing_soles if guesses is not None else 0,
    }


def _scale(people: Sequence[Mapping[str, Any]]) -> dict[str, Json]:
    """The evidence for the scale of the world: somebody's height, given or estimated from his bones."""
    known = [one for one in people if "height_m" in one]
    shares = [one["height_uncertainty_m"] / one["height_m"] for one in known]
    if not shares:
        return {"source": "assumed", "relative_uncertainty": None}
    return {"source": "bones" if min(shares) > 0 else "given", "relative_uncertainty": _figure(min(shares))}


LIKELY_HEIGHTS_M = 1.45, 2.05
"""Hardly any adult is shorter or taller."""


def _unlikely_heights(people: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A warning for each height that an adult hardly has, unless the user gave it."""
    least, most = LIKELY_HEIGHTS_M
    for one in people:
        if one.get("height_uncertainty_m") and not least <= one["height_m"] <= most:
            what = "a child, or too little of the body is seen" if one["height_m"] < least else "it may be too much"
            yield (
                f"deliver: person {one['person']} is taken to be {one['height_m']:.2f} m tall: {what}; if it is "
                f"known, `humanmm correct RUN height {one['person']} METRES` says it"
            )


DOUBTFUL_FLOOR_M = 0.1
DOUBTFUL_IDENTITY = 0.7
"""What is less certain than these is a warning: nothing doubtful is left without one."""


def _doubts(
    intrinsics: "Intrinsics", guesses: "Guesses | None", corrections: Sequence[CorrectionRecord], shots: ShotList
) -> Iterator[str]:
    """A warning for each guess that is doubtful, unless the user gave it."""
    from humanmm.models.records.camera import is_doubtful_focal

    doubtful = is_doubtful_focal(intrinsics.source, intrinsics.relative_uncertainty)
    if doubtful and intrinsics.source != "default":  # the stage has its own sentence for one that is assumed
        yield (
            f"intrinsics: the focal length is uncertain by {100 * intrinsics.relative_uncertainty:.0f} %: "
            "--focal-px or --fov-deg sets it"
        )
    if guesses is None:
        return
    if not _applied(corrections, "floor"):
        if math.isnan(guesses.floor_m):
            yield "deliver: hardly anybody is seen standing: the height of the floor is a guess"
        elif guesses.floor_m > DOUBTFUL_FLOOR_M:
            yield (
                f"deliver: standing feet differ in height by ± {guesses.floor_m:.2f} m: people stand on something, or "
                "the floor is wrong"
            )
    for off in guesses.off_floor:
        side = "above" if off.height_m > 0 else "below"
        yield (
            f"deliver: person {off.person} stands {abs(off.height_m):.2f} m {side} the floor, frames {off.start} to "
            f"{off.end - 1}: on something, or the height or distance is wrong; if the height is known, "
            f"`humanmm correct RUN height {off.person} METRES` says it"
        )
    if not _applied(corrections, "same-person", "swap"):
        for one in guesses.identities:
            if one.probability < DOUBTFUL_IDENTITY:
                yield _identity_doubt(one, shots)


def _identity_doubt(one: "IdentityGuess", shots: ShotList) -> str:
    """A warning that somebody in a shot may be somebody else, who that may be, and the command that says so."""
    doubt = f"shots: person {one.person} in shot {one.shot} may be"
    odds = f"(probability {one.probability:.2f} that it is not)"
    if one.other is None:
        return f"{doubt} somebody who was not seen before {odds}"
    low, high = sorted((one.person, one.other))
    shot = shots.shots[one.shot]
    together = any({low, high} <= {a.person for a in each.people} for each in shots.shots)
    command = f"swap {low} {high} --from {shot.start} --to {shot.end}" if together else f"same-person {low} {high}"
    return f"{doubt} person {one.other} {odds}: if so, `humanmm correct RUN {command}`"


def _fallbacks(shots: ShotList, motion: WorldMotion | None) -> list[str]:
    """Shots whose camera could not be found (source 4)."""
    if motion is None:
        return []
    return [
        f"shot {shot.index}: how the camera moves is not known, and a guess is given (`cameras/source` 4, fallback)"
        for shot in shots.shots
        if (motion.camera_source[shot.start : shot.end] == 4).any()
    ]


def _warnings(stages: Sequence[StageRecord]) -> list[str]:
    """Each warning once, by the first stage that gave it: a result passed on carries its warnings along."""
    first: dict[tuple[str, str], str] = {}
    for record in stages:
        for warning in record.warnings:
            first.setdefault((record.unit, warning), _sentence(record, warning))
    return list(first.values())


def _misfits(corrections: Sequence[CorrectionRecord]) -> list[str]:
    """Corrections that do not fit, or were meant for another video."""
    found = []
    for number, one in enumerate(corrections, start=1):
        if not one.applied:
            found.append(f"correction {number} does not fit ({one.text}): {one.reason}; `humanmm correct` takes it out")
        elif one.reason == OTHER_VIDEO:
            found.append(f"correction {number} ({one.text}): {one.reason}")
    return found


def _sentence(record: StageRecord, warning: str) -> str:
    return f"{record.stage}: {warning}" if record.unit == "video" else f"{record.stage}, {record.unit}: {warning}"


def _stage(record: StageRecord) -> dict[str, Any]:
    tree = {**record.__dict__, "faults": list(record.faults), "warnings": list(record.warnings)}
    tree["seconds"] = round(record.seconds, 3)
    tree["began"] = None if record.began is None else round(record.began, 3)
    return tree
