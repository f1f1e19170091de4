"""Text masks: as wide as they say, dark where there is a letter, the baseline the same for all."""

import numpy as np

from humanmm.models.drawing.lettering import Lettering


def test_a_mask_is_as_wide_and_high_as_it_says() -> None:
    text = Lettering(20)
    for words in ("", "shot 1 of 3", "äöü"):
        assert text.mask(words).shape == (text.height, text.width(words))
    assert text.width("ab") == text.width("a") + text.width("b")


def test_letters_leave_marks_and_spaces_none() -> None:
    text = Lettering(20)
    assert text.mask("H").max() == 255
    assert not text.mask("   ").any()


def test_letters_stand_on_one_baseline_and_descenders_below_it() -> None:
    text = Lettering(40)
    bottom = {letter: np.flatnonzero(text.mask(letter).any(axis=1)).max() for letter in "HEg"}
    assert abs(bottom["H"] - bottom["E"]) <= 1 < bottom["g"] - bottom["H"]


def test_bold_is_bolder_and_twice_the_size_is_twice_as_wide() -> None:
    plain, bold = Lettering(30), Lettering(30, bold=True)
    assert bold.mask("shot").sum() > 1.2 * plain.mask("shot").sum()
    assert abs(Lettering(60).width("shot 1") - 2 * plain.width("shot 1")) <= 6
