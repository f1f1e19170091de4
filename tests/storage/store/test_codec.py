"""Results survive the way to disk and back, and equal content has one digest."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from jaxtyping import Float

from humanmm.storage.store.artifact import read_encoded, write_artifact
from humanmm.storage.store.codec import decode, encode
from humanmm.storage.store.recipe import Recipe


@dataclass(frozen=True)
class Inner:
    name: str
    values: np.ndarray


@dataclass(frozen=True)
class Outer:
    number: int
    ratio: float
    kind: Literal["a", "b"]
    maybe: Inner | None
    many: tuple[Inner, ...]
    pair: tuple[int, str]
    typed: Float[np.ndarray, "3"]
    notes: tuple[str, ...] = ()

    @property
    def derived(self) -> int:
        return self.number + 1


VALUE = Outer(
    3, math.nan, "b", None, (Inner("é\n", np.arange(6).reshape(2, 3)), Inner("", np.zeros((0, 4), bool))), (1, "x"),
    np.array([1.0, -0.0, np.inf]), ("one",),
)  # fmt: skip
RECIPE = Recipe("toy", 1, {}, {}, {}, {}, {}, {})


def _through_disk(value: Any, hint: Any, folder: Path) -> Any:
    encoded = encode(value, hint)
    manifest = write_artifact(folder, encoded, RECIPE, unit="video", seconds=0.0, created="", version="0")
    return decode(read_encoded(folder, manifest), hint)


def test_a_result_survives_the_way_to_disk_and_back(tmp_path: Path) -> None:
    back = _through_disk(VALUE, Outer, tmp_path)
    assert encode(back, Outer).digest() == encode(VALUE, Outer).digest()
    assert math.isnan(back.ratio)
    assert back.many[0].name == "é\n"
    assert back.many[1].values.dtype == bool and back.many[1].values.shape == (0, 4)
    assert back.maybe is None and back.pair == (1, "x") and back.notes == ("one",)


@settings(deadline=None, max_examples=30, derandomize=True)
@given(
    arrays(
        st.sampled_from(["u1", "i4", "<i8", "f4", "f8", "?", ">f4"]),
        array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
    )
)
def test_every_array_comes_back_bit_by_bit(tmp_path_factory: pytest.TempPathFactory, array: np.ndarray) -> None:
    back = _through_disk(Inner("x", array), Inner, tmp_path_factory.mktemp("artifact"))
    assert back.values.shape == array.shape
    assert back.values.tobytes() == array.astype(array.dtype.newbyteorder("<")).tobytes()


def test_large_arrays_are_cut_into_chunks_and_come_back(tmp_path: Path) -> None:
    large = np.random.default_rng(0).normal(size=(3_000_000,))
    np.testing.assert_array_equal(_through_disk(Inner("x", large), Inner, tmp_path).values, large)
    assert len(list((tmp_path / "arrays.zarr" / "values").glob("c.*"))) == 3


@pytest.mark.parametrize(
    "other",
    [
        replace(VALUE, number=4),
        replace(VALUE, maybe=Inner("", np.zeros(1))),
        replace(VALUE, typed=np.array([1.0, 0.0, np.inf])),
        replace(VALUE, many=VALUE.many[:1]),
        replace(VALUE, many=(replace(VALUE.many[0], values=VALUE.many[0].values.reshape(3, 2)), VALUE.many[1])),
        replace(VALUE, typed=VALUE.typed.astype(np.float32)),
    ],
)
def test_different_content_has_another_digest(other: Outer) -> None:
    assert encode(other, Outer).digest() != encode(VALUE, Outer).digest()


def test_files_of_the_stage_are_part_of_the_digest() -> None:
    assert encode(VALUE, Outer).digest({"files/a": "1"}) != encode(VALUE, Outer).digest({"files/a": "2"})


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (replace(VALUE, number="3"), "number must be int"),
        (replace(VALUE, kind="c"), "kind must be one of"),
        (replace(VALUE, many=[*VALUE.many]), "many must be a tuple"),
        (replace(VALUE, typed=[1.0, 2.0, 3.0]), "typed must be a numpy array"),
        (replace(VALUE, many=(Inner("x", np.array([object()])),)), "many/0/values has dtype object"),
    ],
)
def test_a_field_of_the_wrong_type_is_named(wrong: Outer, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        encode(wrong, Outer)
