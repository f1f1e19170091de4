"""Without a usable person there are no shots to speak of, and the error says so."""

import numpy as np
import pytest

from humanmm.errors import NoUsablePersonError
from humanmm.models.perception.tracks import ScenePeople
from humanmm.models.shots.assemble import assemble_shots
from humanmm.models.shots.boundaries import Scenes, Transition

SCENES = Scenes(60, (Transition("cut", 30, 30, "scene"),))
K = np.array([[900.0, 0, 480], [0, 900, 270], [0, 0, 1]])


@pytest.mark.parametrize("people", [[None, None], [ScenePeople(0, 30, ()), ScenePeople(30, 60, ())]])
def test_a_video_in_which_nobody_is_seen_is_an_error_in_plain_words(people: list[ScenePeople | None]) -> None:
    with pytest.raises(NoUsablePersonError, match="no usable person"):
        assemble_shots(SCENES, people, time_s=np.arange(60) / 30, fps=30.0, K=K)
