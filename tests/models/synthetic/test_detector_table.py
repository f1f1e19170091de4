"""The table of the detector's errors holds the errors that it was given."""

import numpy as np

from humanmm.models.synthetic.detector_errors import PersonErrors
from humanmm.models.synthetic.detector_table import detector_table


def _errors(n: int, error: float) -> PersonErrors:
    """Half of the frames found, all limbs off by `error` heights along x, every fourth found frame swapped."""
    found = np.arange(n) % 2 == 0
    return PersonErrors(
        clip="a", person=0, rows=np.arange(n), keypoints=np.zeros((n, 33, 3)), landmarks=np.zeros((n, 33, 3)),
        found=found, swapped=np.arange(n) % 8 == 0, error=np.full((n, 12, 2), [error, 0.0]),
        landmark_m=np.full((n, 12), 0.05), landmark_rotated_m=np.full((n, 12), 0.04),
        rotation=np.tile(np.radians([3.0, 4, 0]), (n, 1)), pitch=np.zeros(n), roll=np.zeros(n),
    )  # fmt: skip


def test_every_column_is_a_set_and_its_figures_are_known() -> None:
    lines = detector_table({"one": [_errors(80, 0.02)], "two": [_errors(80, 0.02), _errors(80, 0.04)]}).splitlines()
    cells = {line.split(" | ")[0].strip("| "): line.strip("| ").split(" | ")[1:] for line in lines[2:]}
    assert lines[0] == "| | one | two |"
    assert cells["clips, persons in shots, frames"] == ["1, 1, 80", "1, 2, 160"]
    assert cells["2D error, % of height: median"] == ["2.00", "3.00"]
    assert cells["left-right swaps, % of found frames"] == ["25.0", "25.0"]
    assert cells["3D landmarks, best rotation, mm: median"] == ["40", "40"]
    assert cells["rotation of the 3D posture, °: median"] == ["5.0", "5.0"]
    assert cells["… about x, y, z, °: mean"] == ["3.0, 4.0, 0.0", "3.0, 4.0, 0.0"]
