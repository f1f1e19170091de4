"""Which frame of a video a file shows, by the file's name."""

import re

from humanmm.errors import InputError


def frame_number(name: str) -> int:
    """The last number in a file's name, without folder and ending; InputError where it has none."""
    found = re.findall(r"\d+", name.rsplit("/", 1)[-1].rsplit(".", 1)[0])
    if not found:
        raise InputError(f"no number in the name {name!r} says which frame it is")
    return int(found[-1])
