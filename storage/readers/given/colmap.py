"""A sparse model of COLMAP, as text (cameras.txt, images.txt) or binary (cameras.bin, images.bin).

Both hold the same (https://colmap.github.io/format.html): of each camera its lens model, the size of its pictures and
its parameters; of each image the rotation and translation from the world to the camera, its camera and its name. Points
are skipped.
"""

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from humanmm.errors import InputError

LENSES = {
    "SIMPLE_PINHOLE": (0, 3, 1), "PINHOLE": (1, 4, 2), "SIMPLE_RADIAL": (2, 4, 1), "RADIAL": (3, 5, 1),
    "OPENCV": (4, 8, 2), "FULL_OPENCV": (6, 12, 2),
}  # fmt: skip
"""Model of a lens → its number in binary files, how many parameters it has, how many focal lengths come first; then
the principal point, then distortion. Fisheye lenses are left out."""
FILES = (("cameras.txt", "images.txt"), ("cameras.bin", "images.bin"))
MAX_NAME = 4096


@dataclass(frozen=True)
class ColmapCamera:
    """A lens: pixels of pictures of width × height."""

    number: int
    width: float
    height: float
    num_focals: int
    parameters: tuple[float, ...]


@dataclass(frozen=True)
class ColmapImage:
    """One image's place: x_cam = R(quat_wxyz) x_world + t_cam_world."""

    name: str
    camera: int
    quat_wxyz: tuple[float, ...]
    t_cam_world: tuple[float, ...]


@dataclass(frozen=True)
class ColmapModel:
    """Everything that is read of a model."""

    cameras: tuple[ColmapCamera, ...]
    images: tuple[ColmapImage, ...]


def colmap_model(contents: Mapping[str, bytes]) -> ColmapModel:
    """The model in the files of a folder, text before binary. InputError says what is wrong with it."""
    if all(name in contents for name in FILES[0]):
        cameras, images = (_lines(name, contents[name]) for name in FILES[0])
        return ColmapModel(tuple(map(_camera_of_line, cameras)), tuple(_images_of_lines(images)))
    cameras_bin, images_bin = (_Bytes(name, contents[name]) for name in FILES[1])
    return ColmapModel(tuple(_cameras_of(cameras_bin)), tuple(_images_of(images_bin)))


def _lines(name: str, content: bytes) -> list[str]:
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{name} is no text") from None
    return [line for line in text.splitlines() if not line.startswith("#")]


def _camera_of_line(line: str) -> ColmapCamera:
    words = line.split()
    if len(words) < 5 or words[1] not in LENSES:
        raise InputError(f"cameras.txt has the line {line[:60]!r}; expected one of {', '.join(LENSES)}")
    values = _floats([words[0], *words[2:]], "a camera in cameras.txt")
    return _camera(int(values[0]), words[1], values[1], values[2], values[3:])


def _camera(number: int, lens: str, width: float, height: float, parameters: tuple[float, ...]) -> ColmapCamera:
    _, count, num_focals = LENSES[lens]
    if len(parameters) != count or not min(width, height, *parameters[:num_focals]) > 0:
        raise InputError(
            f"camera {number} ({lens}, {width:.0f}×{height:.0f}) has parameters {parameters}; "
            f"expected {count}, sides and focal lengths above zero"
        )
    return ColmapCamera(number, width, height, num_focals, parameters)


def _images_of_lines(lines: list[str]) -> Iterator[ColmapImage]:
    rows = iter(lines)
    for line in rows:
        if not line.strip():
            continue
        next(rows, None)  # its points
        words = line.split(maxsplit=9)
        if len(words) != 10:
            raise InputError(f"images.txt has the line {line[:80]!r}; expected an image: 9 numbers and a name")
        values = _floats(words[:9], "an image in images.txt")
        yield ColmapImage(words[9], int(values[8]), values[1:5], values[5:8])


def _floats(words: list[str], what: str) -> tuple[float, ...]:
    try:
        values = tuple(float(word) for word in words)
    except ValueError:
        values = ()
    if not values or not np.isfinite(values).all():
        raise InputError(f"{what} reads {' '.join(words)[:80]!r}; expected numbers")
    return values


class _Bytes:
    """A binary file that is read from its beginning on."""

    def __init__(self, name: str, content: bytes) -> None:
        self.name, self._content, self._at = name, content, 0

    def take(self, layout: str) -> tuple[float, ...]:
        """The next numbers, little-endian, laid out as `struct` says."""
        size = struct.calcsize("<" + layout)
        self.skip(size)
        values = struct.unpack_from("<" + layout, self._content, self._at - size)
        if not np.isfinite(values).all():
            raise InputError(f"{self.name} holds numbers that are not finite")
        return values

    def skip(self, size: int) -> None:
        if size > len(self._content) - self._at:
            raise InputError(f"{self.name} ends in the middle: is it damaged, or no file of COLMAP?")
        self._at += size

    def text(self) -> str:
        """The next characters up to a zero byte."""
        end = self._content.find(b"\0", self._at, self._at + MAX_NAME)
        start = self._at
        self.skip((end if end >= 0 else len(self._content)) + 1 - start)
        return self._content[start:end].decode("utf-8", "replace")


def _cameras_of(file: _Bytes) -> Iterator[ColmapCamera]:
    by_number = {number: lens for lens, (number, _, _) in LENSES.items()}
    (count,) = file.take("Q")
    for _ in range(int(count)):
        number, lens, width, height = map(int, file.take("iiQQ"))
        if lens not in by_number:
            raise InputError(f"camera {number} of {file.name} has lens model {lens}; expected {', '.join(LENSES)}")
        name = by_number[lens]
        yield _camera(number, name, width, height, file.take(f"{LENSES[name][1]}d"))


def _images_of(file: _Bytes) -> Iterator[ColmapImage]:
    (count,) = file.take("Q")
    for _ in range(int(count)):
        _, *values, camera = file.take("i7di")
        name = file.text()
        (points,) = file.take("Q")
        file.skip(24 * int(points))  # x and y as doubles, the number of the point in space
        yield ColmapImage(name, int(camera), tuple(values[:4]), tuple(values[4:]))
