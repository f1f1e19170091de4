"""The paper's numbers stand in their cells, and other methods have none."""

import pytest

from humanmm.models.benchmark.tables.paper import paper_row


@pytest.mark.parametrize(("table", "method", "split", "key", "value"), [
    ("ms-AIST", "humanmm", "2 transitions", "pa_mpjpe_mm", 36.82),
    ("ms-AIST", "humanmm", "4 transitions", "foot_sliding_mm", 4.09),
    ("ms-AIST", "GVHMR", "3 transitions", "roe_deg", 99.69),
    ("ms-H3.6M", "WHAM", "4 transitions", "jitter", 18.40),
    ("ablation", "humanmm without trajectory refiner", "all", "foot_sliding_mm", 7.84),
    ("shots", "humanmm", "all", "cut_f1", 0.92),
    ("camera", "humanmm", "all", "cam_rpe_rot_deg", 1.19),
])  # fmt: skip
def test_a_cell_is_where_the_paper_has_it(table: str, method: str, split: str, key: str, value: float) -> None:
    row = paper_row(table, method, split)
    assert row is not None
    assert row.values[key] == value


def test_shifted_cells_are_left_out_and_other_methods_have_no_row() -> None:
    row = paper_row("ms-H3.6M", "GVHMR", "3 transitions")
    assert row is not None
    assert set(row.values) == {"pa_mpjpe_mm", "wa_mpjpe100_mm", "jitter", "foot_sliding_mm"}
    assert paper_row("ms-AIST", "oracle cuts", "2 transitions") is None
    assert paper_row("speed", "humanmm", "all") is None
