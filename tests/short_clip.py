"""A few frames of the shipped clip as a video of their own."""

from pathlib import Path

from humanmm.models.video.colors import read_colors
from humanmm.models.video.frames import joined, planar_frames, planar_size
from humanmm.models.video.reading import read_facts
from humanmm.storage.run_folder.picture_files import write_video

CLIP = Path(__file__).resolve().parent.parent / "examples/pose2sim_multishot/pose2sim_A_01-02-01.mp4"


def write_short_clip(path: Path, *, frames: tuple[int, int], max_side_px: int) -> float:
    """Frames [start, end) of the clip, reduced; it has cuts at 36 and 70. Returns pixels for one pixel of the clip."""
    with CLIP.open("rb") as stream:
        facts = read_facts(stream)
        width, height = planar_size(facts, max_side_px)
        pictures = (
            (f.time_s, joined(f.planes)) for f in planar_frames(stream, facts, *frames, max_side_px=max_side_px)
        )
        colors = read_colors(stream)
        write_video(path, pictures, width=width, height=height, fps=facts.fps, colors=colors, quality=18)
    return width / facts.width
