"""Stage `decode`: the video's own times, and the user's limit on its size."""

import logging
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from held_results import inputs_of

from humanmm.errors import VideoError
from humanmm.tasks import decode as stage
from humanmm.tasks.decode import decode


def test_a_video_has_the_times_at_which_its_pictures_were_written(film: Any) -> None:
    facts = decode(inputs_of("decode", {}, video=film.video))
    assert (facts.width, facts.height) == film.SIZE
    np.testing.assert_allclose(facts.time_s - facts.time_s[0], film.time_s - film.time_s[0], atol=1e-4)


def test_a_video_larger_than_the_user_allows_is_refused(film: Any) -> None:
    with pytest.raises(VideoError, match=r"decode\.max_side_px = 100"):
        decode(inputs_of("decode", {}, video=film.video, decode={"max_side_px": 100}))


def test_the_log_says_of_an_interlaced_video_how_it_is_used(
    film: Any, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    caplog.set_level(logging.INFO)
    facts = decode(inputs_of("decode", {}, video=film.video))
    assert not caplog.messages
    monkeypatch.setattr(stage, "read_facts", lambda *_, **__: replace(facts, first_field="bottom"))
    assert decode(inputs_of("decode", {}, video=film.video)).interlaced
    assert caplog.messages == ["the video is interlaced: every picture is used as its first field (bottom) shows it"]
