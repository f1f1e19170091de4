"""Units of a video of three shots in two scenes: which there are, and which of an input stage each reads."""

import numpy as np
import pytest

from humanmm.models.records.shots import Appearance, Person, Scenes, Shot, ShotList, Transition
from humanmm.tasks.pipeline import Stage, UnitKind
from humanmm.tasks.units.unit import Unit, read_by, seen_shot_list, units_of

CUTS = tuple(Transition("cut", frame, frame, "scene") for frame in (20, 40))
SCENES = Scenes(60, CUTS[:1])
SHOTS = ShotList(
    60,
    (
        Shot(0, 0, 20, 0, None, (Appearance(0, 0, ()),)),
        Shot(1, 20, 40, 1, CUTS[0], (Appearance(1, 0, ()),)),
        Shot(2, 40, 60, 1, CUTS[1], (Appearance(0, 1, ()), Appearance(1, 0, ()))),
    ),
    tuple(Person(number, np.zeros(10, np.float32), 5.0) for number in (0, 1)),
)


def _units(per: UnitKind) -> tuple[Unit, ...]:
    units = units_of(Stage(f"per_{per}", per, (), (), "builtins:int"), SCENES, SHOTS)
    assert units is not None
    return units


def test_units_are_named_by_number_and_recorded_by_frames() -> None:
    assert [unit.label for unit in _units("scene")] == ["per_scene · scene 0", "per_scene · scene 1"]
    assert [unit.record for unit in _units("shot")] == ["shot-0-20", "shot-20-40", "shot-40-60"]
    (video,) = _units("video")
    assert (video.label, video.record, video.parameters) == ("per_video", "video", {})


@pytest.mark.parametrize("per", ["scene", "shot"])
def test_units_are_unknown_while_nothing_defines_them(per: UnitKind) -> None:
    assert units_of(Stage("any", per, (), (), "builtins:int"), None, None) is None


@pytest.mark.parametrize(
    ("reader", "source", "expected"),
    [
        ("video", "shot", {0: [0, 1, 2]}),
        ("video", "scene", {0: [0, 1]}),
        ("scene", "video", {0: [0], 1: [0]}),
        ("scene", "scene", {0: [0], 1: [1]}),
        ("shot", "video", {0: [0], 1: [0], 2: [0]}),
        ("shot", "scene", {0: [0], 1: [1], 2: [1]}),
        ("shot", "shot", {0: [0], 1: [1], 2: [2]}),
    ],
)
def test_a_unit_reads_the_unit_that_holds_it_and_the_video_reads_all(
    reader: UnitKind, source: UnitKind, expected: dict[int, list[int]]
) -> None:
    sources = _units(source)
    found = {unit.index: [read.index for read in read_by(unit, sources[0].stage, sources)] for unit in _units(reader)}
    assert found == expected


def test_a_stage_per_scene_cannot_read_one_per_shot() -> None:
    with pytest.raises(ValueError, match="per_scene is per scene and cannot read per_shot"):
        read_by(_units("scene")[0], _units("shot")[0].stage, _units("shot"))


def test_a_shot_list_of_one_shot_says_nothing_of_the_others() -> None:
    own = seen_shot_list(SHOTS, _units("shot")[1])
    (shot,) = own.shots
    assert (shot.index, shot.scene, shot.start, shot.end) == (0, 0, 20, 40)
    assert [(person.person, person.area) for person in own.people] == [(1, 0.0)]
