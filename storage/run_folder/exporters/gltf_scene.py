"""One glTF scene of everybody and every camera: skinned bodies, an animation of all, y up, metres, exact frame times.

A person is there from his first frame to his last: before and after, and where he is not seen for long
(`Excerpt.hidden`), the scale of his skeleton is zero, glTF's way to hide a node (section 3.5.3). A camera has the name
of its shot and moves in it alone. Core glTF has no animated field of view: a camera that zooms has the shot's median
one, and its zoom by the extension KHR_animation_pointer, which Blender reads and others leave out. The animation
`scene` moves everybody in step; with several people each has one by himself as well.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from humanmm.models.body.body24 import Body, load_body
from humanmm.models.body.fingers import body_of
from humanmm.models.body.kinematics import chunks
from humanmm.models.drawing.palette import person_color
from humanmm.models.drawing.surface import vertex_normals
from humanmm.models.geometry.intervals import runs_of_true
from humanmm.models.motion.excerpt import Excerpt, continuous_quaternions
from humanmm.models.motion.worlds import world_of_person
from humanmm.models.records.camera import SOURCES
from humanmm.models.records.recording import RecordedPerson
from humanmm.storage.run_folder.exporters.glb import INDICES, VERTICES, Arrays
from humanmm.version import __version__

NEAR_M, FAR_M = 0.05, 1000.0
_STILL = 1e-7

Animation = list[tuple[int, str, int, int, str]]
"""Channels: node, what of it moves (or the JSON pointer of a number), accessors of times and values, interpolation."""
_POINTER = "KHR_animation_pointer"


def write_glb(excerpt: Excerpt, path: Path) -> None:
    """The scene as a .glb."""
    _Scene(excerpt).write(path)


class _Scene:
    def __init__(self, excerpt: Excerpt) -> None:
        self.excerpt = excerpt
        self.arrays = Arrays()
        self.nodes: list[dict[str, Any]] = []
        self.roots: list[int] = []
        self.tree: dict[str, list[dict[str, Any]]] = {"meshes": [], "skins": [], "materials": [], "cameras": []}
        self.times: dict[bytes, int] = {}

    def write(self, path: Path) -> None:
        body = load_body()
        faces = self.arrays.add(body.faces.reshape(-1).astype(np.uint16), target=INDICES) if self.people else -1
        of_people = [self.add_person(person, faces) for person in self.people]
        of_cameras = [self.add_camera(frames) for frames in self.excerpt.shots()]
        moves = {"scene": [channel for one in (*of_people, *of_cameras) for channel in one]}
        if len(self.people) > 1:
            moves |= {_name(person): one for person, one in zip(self.people, of_people, strict=True)}
        recording = self.excerpt.recording
        about = {
            "fps": recording.fps,
            "first_video_frame": int(self.excerpt.source_frame[0]),
            "start_s": float(recording.time_s[0]),
            "cut_s": [float(self.excerpt.seconds[cut]) for cut in recording.cut_frames],
            "shots": [
                {
                    "shot": self.excerpt.shot_of(frames),
                    "frames": [frames.start, frames.stop],
                    "world": recording.world_of_shot(self.excerpt.shot_of(frames)),
                }
                for frames in self.excerpt.shots()
            ],
        }
        tree = {
            "asset": {"version": "2.0", "generator": f"humanmm {__version__}"},
            "scene": 0,
            "scenes": [{"name": "humanmm", "nodes": self.roots, "extras": about}],
            "nodes": self.nodes,
            "animations": [_animation(name, channels) for name, channels in moves.items() if channels],
            "extensionsUsed": [_POINTER] if any(path[0] == "/" for _, path, *_ in moves["scene"]) else [],
            **self.tree,
        }
        self.arrays.write(path, {name: value for name, value in tree.items() if value != []})

    @property
    def people(self) -> Sequence[RecordedPerson]:
        return self.excerpt.recording.people

    # ---- people

    def add_person(self, person: RecordedPerson, faces: int) -> Animation:
        """Skeleton, skin and mesh of a person; returns how he moves."""
        skeleton = self.add_node({"name": _name(person), "extras": self.facts(person)}, root=True)
        first = len(self.nodes)
        rest = self.excerpt.rest_joints(person)
        quaternions, pelvis = self.rotations(person), self.excerpt.points(person.pelvis).astype(np.float32)
        body = body_of(person)
        for joint, name in enumerate(body.joint_names):
            offset = pelvis[0] if joint == 0 else rest[joint] - rest[body.parents[joint]]
            children = [first + child for child, parent in enumerate(body.parents) if parent == joint]
            node = {"name": name, "translation": _floats(offset), "rotation": _floats(quaternions[0, joint])}
            self.add_node({**node, **({"children": children} if children else {})})
        self.nodes[skeleton]["children"] = [first]
        self.add_mesh(person, rest, faces, joints=range(first, first + len(rest)))
        times = self.add_times(self.excerpt.seconds[person.frame])
        moves = self.hidden(person, skeleton)
        if np.ptp(pelvis, axis=0).max() > _STILL:
            moves.append((first, "translation", times, self.arrays.add(pelvis), "LINEAR"))
        for joint in range(len(rest)):
            if np.ptp(quaternions[:, joint], axis=0).max() > _STILL:
                turns = self.arrays.add(np.ascontiguousarray(quaternions[:, joint]))
                moves.append((first + joint, "rotation", times, turns, "LINEAR"))
        return moves

    def facts(self, person: RecordedPerson) -> dict[str, Any]:
        """What a skeleton cannot show."""
        seen = [[int(person.frame[a]), int(person.frame[b - 1]) + 1] for a, b in runs_of_true(person.observed)]
        return {
            "first_frame": int(person.frame[0]),
            "observed_frames": seen,
            "shown_frames": [list(span) for span in runs_of_true(self.excerpt.shown(person))],
            "probability": float(person.probability),
            "world": world_of_person(self.excerpt.recording, person),
        }

    def rotations(self, person: RecordedPerson) -> np.ndarray:
        """(N,J,4) float32 quaternions (x, y, z, w) of the joints, without changes of sign over time."""
        R = np.empty((len(person.frame), len(body_of(person).parents), 3, 3), np.float32)
        for rows in chunks(len(person.frame)):
            R[rows] = self.excerpt.local_rotations(person, rows)
        return _xyzw(R)

    def add_mesh(self, person: RecordedPerson, rest: np.ndarray, faces: int, *, joints: range) -> None:
        body = body_of(person)
        vertices = body.rest_vertices(person.betas).astype(np.float32)
        joint, weight = _skin_weights(body)
        inverse_bind = np.tile(np.eye(4, dtype=np.float32), (len(rest), 1, 1))
        inverse_bind[:, :3, 3] = -rest
        add = self.arrays.add
        attributes = {
            "POSITION": add(vertices, target=VERTICES, bounds=True),
            "NORMAL": add(vertex_normals(body, vertices), target=VERTICES),
            "JOINTS_0": add(joint, target=VERTICES),
            "WEIGHTS_0": add(weight, target=VERTICES),
        }
        color = [float((channel / 255) ** 2.2) for channel in person_color(person)]
        surface = {"baseColorFactor": [*color, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8}
        self.tree["materials"].append({"name": _name(person), "pbrMetallicRoughness": surface})
        primitive = {"attributes": attributes, "indices": faces, "material": len(self.tree["materials"]) - 1}
        self.tree["meshes"].append({"name": f"{_name(person)}_body", "primitives": [primitive]})
        self.tree["skins"].append(
            {"name": _name(person), "joints": list(joints), "inverseBindMatrices": add(inverse_bind)}
        )
        mesh, skin = len(self.tree["meshes"]) - 1, len(self.tree["skins"]) - 1
        self.add_node({"name": f"{_name(person)}_body", "mesh": mesh, "skin": skin}, root=True)

    def hidden(self, person: RecordedPerson, skeleton: int) -> Animation:
        """Scale 0 where a person is not shown; nothing if he is there all the time."""
        shown = self.excerpt.shown(person)
        changes = np.flatnonzero(np.diff(shown)) + 1
        keys = [(self.excerpt.seconds[frame], float(shown[frame])) for frame in (0, *changes)]
        if shown.all():
            return []
        times = self.add_times(np.array([time for time, _ in keys]))
        scale = self.arrays.add(np.repeat(np.array([[value] for _, value in keys], np.float32), 3, axis=1))
        return [(skeleton, "scale", times, scale, "STEP")]

    # ---- cameras

    def add_camera(self, frames: slice) -> Animation:
        """The camera of one shot; returns how it moves."""
        recording = self.excerpt.recording
        K = np.median(recording.K[frames].astype(np.float64), axis=0)
        view = {
            "yfov": float(2 * np.arctan2(recording.height / 2, K[1, 1])),
            "aspectRatio": float(recording.width * K[1, 1] / (recording.height * K[0, 0])),
            "znear": NEAR_M,
            "zfar": FAR_M,
        }
        shot = self.excerpt.shot_of(frames)
        name = f"camera_shot_{shot:03d}"
        self.tree["cameras"].append({"name": name, "type": "perspective", "perspective": view})
        R, t = self.excerpt.cameras(frames)
        rotation, translation = _xyzw(R), t.astype(np.float32)
        facts = {
            "frames": [frames.start, frames.stop],
            "seconds": self.excerpt.seconds[[frames.start, frames.stop - 1]].tolist(),
            "source": SOURCES[int(recording.camera_source[frames.start])],
            "size_px": [recording.width, recording.height],
            "world": recording.world_of_shot(shot),
        }
        node = self.add_node(
            {
                "name": name, "camera": len(self.tree["cameras"]) - 1, "extras": facts,
                "translation": _floats(translation[0]), "rotation": _floats(rotation[0]),
            },
            root=True,
        )  # fmt: skip
        moving = {
            path: values
            for path, values in (("translation", translation), ("rotation", rotation))
            if np.ptp(values, axis=0).max() > _STILL
        }
        yfov = 2 * np.arctan2(recording.height / 2, recording.K[frames, 1, 1].astype(np.float64))
        if np.ptp(yfov) > _STILL:
            moving[f"/cameras/{len(self.tree['cameras']) - 1}/perspective/yfov"] = yfov.astype(np.float32)
        times = self.add_times(self.excerpt.seconds[frames]) if moving else -1
        return [(node, path, times, self.arrays.add(values), "LINEAR") for path, values in moving.items()]

    # ---- parts of the file

    def add_node(self, node: dict[str, Any], *, root: bool = False) -> int:
        self.nodes.append(node)
        if root:
            self.roots.append(len(self.nodes) - 1)
        return len(self.nodes) - 1

    def add_times(self, seconds: np.ndarray) -> int:
        """The accessor of key times; the same times are stored once."""
        values = seconds.astype(np.float32)
        key = values.tobytes()
        if key not in self.times:
            self.times[key] = self.arrays.add(values, bounds=True)
        return self.times[key]


def _skin_weights(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """(V,4) uint8 joints and float32 weights that sum to 1; an unused place names joint 0, as the standard requires."""
    weight = body.skin_weight.astype(np.float32)
    return np.where(weight > 0, body.skin_joint, 0).astype(np.uint8), weight / weight.sum(axis=1, keepdims=True)


def _animation(name: str, moves: Animation) -> dict[str, Any]:
    return {
        "name": name,
        "samplers": [{"input": times, "output": values, "interpolation": how} for _, _, times, values, how in moves],
        "channels": [{"sampler": index, "target": _target(node, path)} for index, (node, path, *_) in enumerate(moves)],
    }


def _target(node: int, path: str) -> dict[str, Any]:
    if path.startswith("/"):
        return {"path": "pointer", "extensions": {_POINTER: {"pointer": path}}}
    return {"node": node, "path": path}


def _name(person: RecordedPerson) -> str:
    return f"person_{person.person:02d}"


def _xyzw(R: np.ndarray) -> np.ndarray:
    """Quaternions in glTF's order, float32."""
    return continuous_quaternions(R)[..., [1, 2, 3, 0]].astype(np.float32)


def _floats(values: np.ndarray) -> list[float]:
    return [float(value) for value in np.asarray(values, np.float32)]
