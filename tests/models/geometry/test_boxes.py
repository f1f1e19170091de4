"""Boxes and their overlap."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanmm.models.geometry.boxes import box_area, box_iou, covered

corners = st.tuples(*[st.integers(0, 12)] * 4)


def test_known_overlaps() -> None:
    box = np.array([0.0, 0, 10, 10])
    assert box_iou(box, box) == 1
    assert box_iou(box, box + 30) == 0
    assert box_iou(box, box + np.array([5, 0, 5, 0])) == pytest.approx(1 / 3)
    assert box_iou(np.zeros(4), np.zeros(4)) == 0


@given(corners, corners)
def test_the_overlap_is_that_of_counted_cells(first: tuple[int, ...], second: tuple[int, ...]) -> None:
    cells = [np.zeros((12, 12), bool) for _ in range(2)]
    for (x0, y0, x1, y1), grid in zip((first, second), cells, strict=True):
        grid[y0:y1, x0:x1] = True
    either = (cells[0] | cells[1]).sum()
    expected = (cells[0] & cells[1]).sum() / either if either else 0.0
    a, b = np.array(first, float), np.array(second, float)
    assert box_iou(a, b) == pytest.approx(expected)
    assert box_area(a) == cells[0].sum()


def test_shapes_broadcast_to_every_pair() -> None:
    rng = np.random.default_rng(4)
    low = rng.uniform(0, 9, (7, 2))
    boxes = np.concatenate([low, low + rng.uniform(0, 5, (7, 2))], axis=1)
    every = box_iou(boxes[:3, None], boxes[None])
    np.testing.assert_array_equal(every, [[box_iou(a, b) for b in boxes] for a in boxes[:3]])


def test_of_a_box_that_is_covered_which_lies_in_any_of_the_others_once() -> None:
    boxes = np.array([[0.0, 0, 10, 10], [20, 0, 30, 10], [40, 0, 50, 10]])
    others = np.array([[0.0, 0, 5, 10], [2, 0, 5, 10], [15, -5, 35, 15]])
    np.testing.assert_allclose(covered(boxes, others), [0.5, 1.0, 0.0])
