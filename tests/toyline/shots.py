"""All cuts, or those that TOY_CUTS tells."""

import os

import numpy as np

from humanmm.corrections import Height
from humanmm.models.records.shots import Appearance, Person, Scenes, Shot, ShotList, Transition
from humanmm.models.records.tracks import ScenePeople
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act


def shots(inputs: StageInputs) -> ShotList:
    act("shots", inputs)
    found = inputs.read("scenes", Scenes)
    scenes = inputs.read_all("people", ScenePeople)
    message = {int(cut) for cut in os.environ.get("TOY_CUTS", "40").split(",")}
    cuts = sorted({transition.cut_frame for transition in found.transitions} | message)
    starts, ends = [0, *cuts], [*cuts, found.num_frames]
    listed = []
    for index, (start, end) in enumerate(zip(starts, ends, strict=True)):
        scene = next(i for i, span in enumerate(found.spans) if span[0] <= start < span[1])
        seen = () if scenes[scene] is None else (Appearance(0, 0, ()),)
        how = Transition("cut", start, start, "scene") if index else None
        listed.append(Shot(index, start, end, scene, how, seen))
    area = float(sum(scene.end - scene.start for scene in scenes if scene is not None))
    height = sum(one.metres for one in inputs.corrections.of(Height))
    person = Person(0, np.full(10, height, np.float32), area)
    return ShotList(found.num_frames, tuple(listed), (person,), (), found.corrections)
