"""Stage `deliver`: the recording as it is handed out, the overlay video, its small copy and the top view."""

from humanmm.models.drawing.overlay import marks_of
from humanmm.models.drawing.top_view import top_view
from humanmm.models.motion.assemble import record_motion
from humanmm.models.motion.guesses import guesses_of
from humanmm.models.records.motion import WorldMotion
from humanmm.models.records.recording import Delivery
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.storage.run_folder.picture_files import write_png
from humanmm.tasks.inputs import StageInputs
from humanmm.tasks.pictures import EMBEDDED, OVERLAY, TOP_VIEW, write_overlay


def deliver(inputs: StageInputs) -> Delivery:
    """Everything that the run folder shows of the motion."""
    facts = inputs.read("decode", VideoFacts)
    shot_list = inputs.read("shots", ShotList)
    scenes = inputs.read_all("people", ScenePeople)
    recording = record_motion(facts, shot_list, scenes, inputs.read("refine", WorldMotion))
    settings = inputs.config.deliver
    has_page = float(facts.time_s[-1] - facts.time_s[0]) < settings.scene_max_s
    with inputs.open_video() as stream:
        write_overlay(
            inputs.blob_dir / OVERLAY,
            stream,
            facts,
            recording,
            marks_of(shot_list),
            settings=settings,
            progress=inputs.progress,
            embedded=inputs.blob_dir / EMBEDDED if has_page else None,
        )
    write_png(inputs.blob_dir / TOP_VIEW, top_view(recording))
    guesses = guesses_of(shot_list, scenes, inputs.read("align", WorldMotion), recording, time_s=facts.time_s)
    return Delivery(recording, (OVERLAY, TOP_VIEW), guesses)
