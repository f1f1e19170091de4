"""Stage `decode`: the video's own times, and the user's limit on its size."""

from typing import Any

import numpy as np
import pytest
from held_results import inputs_of

from humanmm.errors import VideoError
from humanmm.tasks.decode import decode


def test_a_video_has_the_times_at_which_its_pictures_were_written(film: Any) -> None:
    facts = decode(inputs_of("decode", {}, video=film.video))
    assert (facts.width, facts.height) == film.SIZE
    np.testing.assert_allclose(facts.time_s - facts.time_s[0], film.time_s - film.time_s[0], atol=1e-4)


def test_a_video_larger_than_the_user_allows_is_refused(film: Any) -> None:
    with pytest.raises(VideoError, match=r"decode\.max_side_px = 100"):
        decode(inputs_of("decode", {}, video=film.video, decode={"max_side_px": 100}))
