"""Changes nothing but the floor."""

from dataclasses import replace

from humanmm.corrections import Floor
from humanmm.models.records.motion import WorldMotion
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act


def refine(inputs: StageInputs) -> WorldMotion:
    act("refine", inputs)
    world = inputs.read("align", WorldMotion)
    rise = sum(one.metres for one in inputs.corrections.of(Floor))
    return replace(world, t_world_cam=world.t_world_cam - [0.0, 0.0, rise])
