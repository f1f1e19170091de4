"""The body on the video: a solid, lit surface for each person, floor contacts, and where we are in the shots.

Frames in which a person was not observed are hatched and pale; in shots that never show a person, that person is not
drawn at all (the shot may be of another place). `Overlay.draw` changes one picture in place.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.motion.recording import CONTACT_JOINTS, RecordedPerson, Recording
from humanmm.models.pictures import palette
from humanmm.models.pictures.lettering import Lettering
from humanmm.models.pictures.raster import NEAR_M, Region, project, rasterise
from humanmm.models.pictures.surface import PosedSurface
from humanmm.models.shots.boundaries import ShotList

OPACITY = 0.9
OPACITY_NOT_OBSERVED = 0.5
CONTACT_PROBABILITY = 0.5
_TOE_BASE = {7: 10, 10: 10, 8: 11, 11: 11}
"""The toe base of the foot that a joint belongs to; ankles rise over a foot that still stands."""
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
    """Draws one recording onto pictures of width × height. One thread at a time."""

    def __init__(self, recording: Recording, marks: tuple[Mark, ...], width: int, height: int) -> None:
        self._recording = recording
        self._marks = marks
        self._size = width, height
        scale = np.array([width / recording.width, height / recording.height, 1.0])
        self._K = recording.K * scale[:, None]
        self._seen_in_shot = [set(recording.shot_index[p.frame[p.observed]].tolist()) for p in recording.people]
        self._surfaces = [PosedSurface(person) for person in recording.people]
        self._ramps = [palette.shading_ramp(palette.person_color(p.person))[:, None] for p in recording.people]
        self._pale_ramp = palette.shading_ramp(palette.NOT_OBSERVED)[:, None]
        unit = max(11, round(min(width, height) / 38))
        self._text = Lettering(unit)
        self._bold = Lettering(unit, bold=True)
        self._pad = max(4, unit // 2)
        self._bar = _shot_bar(recording, marks, width, max(4, round(height / 90)))

    def draw(self, image: UInt8[np.ndarray, "H W 3"], frame: int) -> None:
        """Draw everything that belongs to one frame of the video into an RGB picture."""
        people, shot = self._recording.people, int(self._recording.shot_index[frame])
        rows = [frame - int(p.frame[0]) if len(p.frame) else -1 for p in people]
        present = [i for i, p in enumerate(people) if 0 <= rows[i] < len(p.frame) and shot in self._seen_in_shot[i]]
        for index in present:
            self._draw_contacts(image, frame, self._recording.people[index], rows[index])
        self._draw_people(image, frame, present, rows)
        for index in present:
            self._label(image, frame, self._recording.people[index], rows[index])
        self._draw_status(image, frame)

    def _draw_people(self, image: np.ndarray, frame: int, present: list[int], rows: list[int]) -> None:
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
                _blend(image, region, self._ramps[index] if observed else self._pale_ramp, observed, only)

    def _draw_contacts(self, image: np.ndarray, frame: int, person: RecordedPerson, row: int) -> None:
        """A disc under every foot joint that stands: on the floor, or on the wall or stair that carries the foot."""
        for joint, probability in zip(CONTACT_JOINTS, person.contacts[row], strict=True):
            if probability < CONTACT_PROBABILITY or not person.observed[row]:
                continue
            center = person.joints[row, joint].copy()
            center[2] = max(0.0, person.joints[row, _TOE_BASE[joint], 2] - _SOLE_M)
            ring = self._project(frame, center + _CIRCLE * _CONTACT_RADIUS_M)
            if ring is not None:
                points = np.rint((ring - 0.5) * 16).astype(np.int32)
                cv2.fillConvexPoly(image, points, palette.CONTACT, cv2.LINE_AA, 4)
                cv2.polylines(image, [points], True, palette.INK, 1, cv2.LINE_AA, 4)

    def _project(self, frame: int, points_world: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, "P 2"] | None:
        """Pixels of world points, or None when one of them is behind the camera or far outside the picture."""
        R, t = self._recording.R_world_cam[frame], self._recording.t_world_cam[frame]
        in_camera = (points_world - t) @ R
        if (in_camera[:, 2] <= NEAR_M).any():
            return None
        pixels = in_camera / in_camera[:, 2:] @ self._K[frame].T
        return None if np.abs(pixels).max() > 8 * max(self._size) else np.asarray(pixels[:, :2])

    def _label(self, image: np.ndarray, frame: int, person: RecordedPerson, row: int) -> None:
        head = self._project(frame, person.joints[row, 15:16] + np.array([0, 0, 0.32]))
        if head is None:
            return
        observed = bool(person.observed[row])
        text = f"{person.person}" if observed else f"{person.person}  not observed"
        width = self._bold.width(text) + 2 * self._pad
        x, y = round(head[0, 0] - width / 2), round(head[0, 1] - self._bold.height)
        color = palette.person_color(person.person) if observed else palette.NOT_OBSERVED
        _panel(image, x, y, width, self._bold.height + self._pad // 2, color, 0.85)
        self._bold.write(image, text, x + self._pad, y + self._pad // 4, palette.INK)

    def _draw_status(self, image: np.ndarray, frame: int) -> None:
        recording = self._recording
        shot = int(recording.shot_index[frame])
        num_shots = len(recording.cut_frames) + 1
        title = f"shot {shot + 1} of {num_shots}"
        detail = f"frame {frame}   {recording.time_s[frame] - recording.time_s[0]:.2f} s"
        pad, line = self._pad, self._text.height
        width = max(self._bold.width(title), self._text.width(detail)) + 3 * pad
        _panel(image, pad, pad, width, 2 * line + pad, palette.INK, 0.6)
        image[pad : pad + 2 * line + pad, pad : pad + max(3, pad // 2)] = palette.shot_color(shot)
        self._bold.write(image, title, 2 * pad, pad + pad // 2, palette.WHITE)
        self._text.write(image, detail, 2 * pad, pad + pad // 2 + line, palette.WHITE)
        self._draw_mark(image, frame)
        height = self._bar.shape[0]
        image[-height:] = self._bar
        x = min(int((frame + 0.5) / recording.num_frames * image.shape[1]), image.shape[1] - 1)
        image[-2 * height :, max(x - 1, 0) : x + 2] = palette.WHITE

    def _draw_mark(self, image: np.ndarray, frame: int) -> None:
        """A shining frame and a word while the shot changes, and shortly after a cut."""
        time_s = self._recording.time_s
        for mark in self._marks:
            fresh = mark.start == mark.end and 0 <= time_s[frame] - time_s[min(mark.start, len(time_s) - 1)] < _FLASH_S
            if not (mark.start <= frame < mark.end or (fresh and frame >= mark.start)):
                continue
            thickness = max(3, self._pad // 2)
            cv2.rectangle(image, (0, 0), (image.shape[1] - 1, image.shape[0] - 1), palette.CUT, thickness)
            text = mark.name
            width = self._bold.width(text) + 2 * self._pad
            x = image.shape[1] - width - self._pad
            _panel(image, x, self._pad, width, self._bold.height + self._pad // 2, palette.CUT, 0.9)
            self._bold.write(image, text, x + self._pad, self._pad + self._pad // 4, palette.INK)


def _blend(image: np.ndarray, region: Region, ramp: np.ndarray, observed: bool, only: int | None) -> None:
    height, width = region.shade.shape
    part = image[region.y : region.y + height, region.x : region.x + width]
    weight = region.coverage.astype(np.float32)
    weight *= (OPACITY if observed else OPACITY_NOT_OBSERVED) / 255
    if only is not None:
        weight *= region.surface == only
    if not observed:
        period = max(6, image.shape[0] // 60)
        diagonal = np.arange(region.x, region.x + width) + np.arange(region.y, region.y + height)[:, None]
        weight *= np.where(diagonal % period < period // 2, 1.0, 0.5).astype(np.float32)
    color = cv2.applyColorMap(region.shade, ramp)
    cv2.blendLinear(color, part, weight, 1 - weight, dst=part)


def _panel(image: np.ndarray, x: int, y: int, width: int, height: int, color: palette.RGB, opacity: float) -> None:
    """A tinted rectangle, cut off at the picture's edges."""
    part = image[max(y, 0) : max(y + height, 0), max(x, 0) : max(x + width, 0)]
    if part.size:
        cv2.addWeighted(part, 1 - opacity, np.full_like(part, color), opacity, 0, dst=part)


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
