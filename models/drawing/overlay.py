"""The body on the video: a solid, lit surface for each person, floor contacts, and where we are in the shots.

Frames in which a person was not observed are hatched and pale; in shots that never show a person, that person is not
drawn at all (the shot may be of another place). `Overlay.draw` changes one picture in place.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.drawing import palette
from humanmm.models.drawing.canvas import Canvas
from humanmm.models.drawing.lettering import Lettering
from humanmm.models.drawing.lit_surfaces import NEAR_M, Region, project, rasterise
from humanmm.models.drawing.surface import PosedSurface
from humanmm.models.geometry import projection
from humanmm.models.records.recording import CONTACT_JOINTS, RecordedPerson, Recording
from humanmm.models.records.shots import ShotList
from humanmm.models.video.colors import BT601, Colors

OPACITY = 0.9
NOT_OBSERVED = 0.5 / OPACITY
"""How opaque a body is that was not observed, as a part of one that was."""
CONTACT_PROBABILITY = 0.5
_TOE_BASE = {7: 10, 10: 10, 8: 11, 11: 11}
"""The toe base of the foot that a joint belongs to; ankles rise over a foot that still touches the floor."""
_SOLE_M = 0.03
"""Height of body24's toe base above the sole."""
_CONTACT_RADIUS_M = 0.11
_CIRCLE = np.stack([np.cos(a := np.linspace(0, 2 * np.pi, 25)[:-1]), np.sin(a), np.zeros_like(a)], axis=1)
_FLASH_S = 0.3
"""How long the frame of the picture shines after a cut."""


@dataclass(frozen=True)
class Mark:
    """A change of shot as it is shown: [start, end) is a gradual transition, start == end a cut."""

    name: str
    start: int
    end: int


def marks_of(shot_list: ShotList) -> tuple[Mark, ...]:
    """The changes of shot of a video."""
    transitions = [shot.transition for shot in shot_list.shots if shot.transition is not None]
    return tuple(Mark(t.type, t.start, t.end) for t in transitions)


class Overlay:
    """Draws one recording onto the pictures of a video, scaled to width × height (even). One thread at a time."""

    def __init__(
        self,
        recording: Recording,
        marks: tuple[Mark, ...],
        width: int,
        height: int,
        colors: Colors = BT601,
        *,
        opacity: float = OPACITY,
    ) -> None:
        self._recording = recording
        self._marks = marks
        self._size = width, height
        self._opacity = opacity
        scale = np.array([width / recording.width, height / recording.height, 1.0])
        self._K = recording.K * scale[:, None]
        self._seen_in_shot = [set(recording.shot_index[p.frame[p.observed]].tolist()) for p in recording.people]
        self._surfaces = [PosedSurface(person) for person in recording.people]
        self._colors = colors
        self._ramps = [self._ramp(palette.person_color(p)) for p in recording.people]
        self._pale_ramp = self._ramp(palette.NOT_OBSERVED)
        unit = max(11, round(min(width, height) / 38))
        self._text = Lettering(unit)
        self._bold = Lettering(unit, bold=True)
        self._pad = max(4, unit // 2)
        self._bar = colors.samples(_shot_bar(recording, marks, width, max(4, round(height / 180) * 2)))

    def draw(self, image: UInt8[np.ndarray, "HplusHalf W"], frame: int) -> None:
        """Draw everything that belongs to one frame of the video into its planes (as `Canvas` takes them)."""
        canvas = Canvas(image, self._colors)
        self.draw_people(canvas, frame)
        self._draw_status(canvas, frame)

    def draw_people(self, canvas: Canvas, frame: int) -> None:
        """Draw the bodies of one frame, where they stand, and their numbers."""
        people, shot = self._recording.people, int(self._recording.shot_index[frame])
        rows = [frame - int(p.frame[0]) if len(p.frame) else -1 for p in people]
        present = [i for i, p in enumerate(people) if 0 <= rows[i] < len(p.frame) and shot in self._seen_in_shot[i]]
        for index in present:
            self._draw_contacts(canvas, frame, self._recording.people[index], rows[index])
        self._draw_bodies(canvas, frame, present, rows)
        for index in present:
            self._label(canvas, frame, self._recording.people[index], rows[index])

    def _draw_bodies(self, canvas: Canvas, frame: int, present: list[int], rows: list[int]) -> None:
        R, t, K = self._recording.R_world_cam[frame], self._recording.t_world_cam[frame], self._K[frame]
        triangles = []
        for index in present:
            surface = self._surfaces[index]
            vertices, normals = surface.in_camera(rows[index], R, t)
            triangles.append(project(vertices, normals, surface.faces, K, R[2]))
        for region in rasterise(triangles, *self._size):
            in_region = np.unique(region.surface[::4, ::4]) if len(present) > 1 else np.array([0])
            for member in in_region[in_region >= 0]:
                index = present[member]
                observed = bool(self._recording.people[index].observed[rows[index]])
                only = None if len(present) == 1 else int(member)
                weight = self._weight(region, observed, only)
                ramp = self._ramps[index] if observed else self._pale_ramp
                canvas.surface(region.x, region.y, region.shade, weight, ramp)

    def _ramp(self, color: palette.RGB) -> UInt8[np.ndarray, "256 3"]:
        """Samples of a surface of one colour, from dark to lit."""
        return self._colors.samples(palette.shading_ramp(color))

    def _weight(self, region: Region, observed: bool, only: int | None) -> Float[np.ndarray, "h w"]:
        """Opacity 0..1 of a region's surfaces (of one of them): pale and hatched where nobody was observed."""
        weight = region.coverage.astype(np.float32)
        weight *= self._opacity * (1.0 if observed else NOT_OBSERVED) / 255
        if only is not None:
            weight *= region.surface == only
        if not observed:
            height, width = weight.shape
            period = max(6, self._size[1] // 60)
            diagonal = np.arange(region.x, region.x + width) + np.arange(region.y, region.y + height)[:, None]
            weight *= np.where(diagonal % period < period // 2, 1.0, 0.5).astype(np.float32)
        return weight

    def _draw_contacts(self, canvas: Canvas, frame: int, person: RecordedPerson, row: int) -> None:
        """A disc under every foot joint in contact: on the floor, or on the wall or stair that carries the foot."""
        for joint, probability in zip(CONTACT_JOINTS, person.contacts[row], strict=True):
            if probability < CONTACT_PROBABILITY or not person.observed[row]:
                continue
            center = person.joints[row, joint].copy()
            center[2] = max(0.0, person.joints[row, _TOE_BASE[joint], 2] - _SOLE_M)
            ring = self._project(frame, center + _CIRCLE * _CONTACT_RADIUS_M)
            if ring is not None:
                canvas.polygon(ring, palette.CONTACT, outline=palette.INK)

    def _project(self, frame: int, points_world: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, "P 2"] | None:
        """Pixels of world points, or None when one of them is behind the camera or far outside the picture."""
        R, t = self._recording.R_world_cam[frame], self._recording.t_world_cam[frame]
        in_camera = projection.world_to_camera(points_world, R, t)
        if not projection.in_front(in_camera, NEAR_M).all():
            return None
        pixels = projection.project(in_camera, self._K[frame], near_m=NEAR_M)
        return None if np.abs(pixels).max() > 8 * max(self._size) else pixels

    def _label(self, canvas: Canvas, frame: int, person: RecordedPerson, row: int) -> None:
        head = self._project(frame, person.joints[row, 15:16] + np.array([0, 0, 0.32]))
        if head is None:
            return
        observed = bool(person.observed[row])
        text = f"{person.person}" if observed else f"{person.person}  not observed"
        width = self._bold.width(text) + 2 * self._pad
        x, y = round(head[0, 0] - width / 2), round(head[0, 1] - self._bold.height)
        color = palette.person_color(person) if observed else palette.NOT_OBSERVED
        canvas.rectangle(x, y, x + width, y + self._bold.height + self._pad // 2, color, 0.85)
        canvas.stamp(x + self._pad, y + self._pad // 4, self._bold.mask(text), palette.INK)

    def _draw_status(self, canvas: Canvas, frame: int) -> None:
        recording = self._recording
        shot = int(recording.shot_index[frame])
        title = f"shot {shot}"
        detail = f"frame {frame}   {recording.time_s[frame] - recording.time_s[0]:.2f} s"
        pad, line = self._pad, self._text.height
        width = max(self._bold.width(title), self._text.width(detail)) + 3 * pad
        canvas.rectangle(pad, pad, pad + width, 2 * (pad + line), palette.INK, 0.6)
        canvas.rectangle(pad, pad, pad + max(3, pad // 2), 2 * (pad + line), palette.shot_color(shot))
        canvas.stamp(2 * pad, pad + pad // 2, self._bold.mask(title), palette.WHITE)
        canvas.stamp(2 * pad, pad + pad // 2 + line, self._text.mask(detail), palette.WHITE)
        self._draw_mark(canvas, frame)
        height = len(self._bar)
        canvas.paste(canvas.height - height, self._bar)
        x = min(int((frame + 0.5) / recording.num_frames * canvas.width), canvas.width - 1)
        canvas.rectangle(x - 1, canvas.height - 2 * height, x + 2, canvas.height, palette.WHITE)

    def _draw_mark(self, canvas: Canvas, frame: int) -> None:
        """A shining frame and a word while the shot changes, and shortly after a cut."""
        time_s = self._recording.time_s
        for mark in self._marks:
            fresh = mark.start == mark.end and 0 <= time_s[frame] - time_s[min(mark.start, len(time_s) - 1)] < _FLASH_S
            if not (mark.start <= frame < mark.end or (fresh and frame >= mark.start)):
                continue
            thickness = max(3, self._pad // 2)
            canvas.border(thickness, palette.CUT)
            width = self._bold.width(mark.name) + 2 * self._pad
            x, y = canvas.width - width - self._pad, self._pad
            canvas.rectangle(x, y, x + width, y + self._bold.height + self._pad // 2, palette.CUT, 0.9)
            canvas.stamp(x + self._pad, y + self._pad // 4, self._bold.mask(mark.name), palette.INK)


def _shot_bar(recording: Recording, marks: tuple[Mark, ...], width: int, height: int) -> UInt8[np.ndarray, "h W 3"]:
    """The strip along the lower edge: shots in their colours, gradual transitions hatched, cuts as dark lines."""
    frame = np.minimum((np.arange(width) + 0.5) / width * recording.num_frames, recording.num_frames - 1).astype(int)
    colors = np.array([palette.shot_color(int(s)) for s in range(len(recording.cut_frames) + 1)], np.uint8)
    bar = np.repeat(colors[recording.shot_index[frame]][None], height, axis=0)
    for mark in marks:
        if mark.end > mark.start:
            inside = (frame >= mark.start) & (frame < mark.end)
            stripes = (np.arange(width) + np.arange(height)[:, None]) % 6 < 3
            bar[inside[None] & stripes] = palette.CUT
    for cut in recording.cut_frames:
        x = round(cut / recording.num_frames * width)
        bar[:, max(x - 1, 0) : x + 1] = palette.INK
    return bar
