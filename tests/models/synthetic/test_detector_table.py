"""The table of the detector's errors says what the errors are."""

import numpy as np

from humanmm.models.synthetic.detector_errors import PersonErrors
from humanmm.models.synthetic.detector_table import detector_table


def errors(n: int = 10) -> PersonErrors:
    """2D errors of 3 % of the height, 3D errors of 50 mm, found in eight of ten frames, exchanged in two."""
    found = np.arange(n) < 8
    return PersonErrors(
        clip="clip", person=0, rows=np.arange(n), keypoints=np.zeros((n, 33, 3)), landmarks=np.zeros((n, 33, 3)),
        found=found, swapped=np.arange(n) < 2, error=np.tile([0.03, 0.0], (n, 12, 1)),
        landmark_m=np.full((n, 12), 0.05), landmark_turned_m=np.full((n, 12), 0.04),
        turn=np.tile([np.radians(10.0), 0.0, 0.0], (n, 1)), pitch=np.zeros(n), roll=np.zeros(n),
    )  # fmt: skip


def test_every_figure_stands_in_its_line() -> None:
    lines = dict(line.strip("| ").rsplit(" | ", 1) for line in detector_table({"one": [errors()]}).splitlines()[2:])
    assert lines["clips, persons in shots, frames"] == "1, 1, 10"
    assert lines["found, % of the frames in which the truth observes the person"] == "80.0"
    assert lines["2D error, % of height: median"] == "3.00"
    assert lines["left and right exchanged, % of found frames"] == "25.0"
    assert lines["3D landmarks, size put right, mm: median"] == "50"
    assert lines["3D landmarks, best rotation, mm: median"] == "40"
    assert lines["rotation of the 3D posture, °: median"] == "10.0"


def test_a_set_is_a_column() -> None:
    head = detector_table({"one": [errors()], "two": [errors()]}).splitlines()[0]
    assert head == "| | one | two |"
