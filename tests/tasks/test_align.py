"""Stage `align`: shots that show one person lie in one world, whichever method looks at the cuts."""

from typing import Any

import numpy as np
import pytest
import three_shots
from held_results import inputs_of, scenes_of

from humanmm.models.camera.background.keyframes import KeyFrameFeatures
from humanmm.models.geometry.rotations import rotation_angle
from humanmm.models.records.video import VideoFacts
from humanmm.tasks.align import align

SEEN = three_shots.results()


def _aligned(**settings: Any) -> Any:
    results = {
        "decode": VideoFacts(960, 540, SEEN.time_s, SEEN.time_s == 0, 0, "h264", "mp4"),
        "scenes": scenes_of(SEEN.shots),
        "people": SEEN.scenes,
        "shots": SEEN.shots,
        "keyframes": KeyFrameFeatures(((), (), ())),
        "intrinsics": SEEN.intrinsics,
        "camera": SEEN.cameras,
        "hmr": SEEN.motions,
    }
    return align(inputs_of("align", results, align=settings))


@pytest.mark.parametrize("method", ["bundle", "eight-point"])
def test_the_cameras_of_the_shots_stand_to_one_another_as_they_did(method: str) -> None:
    world = _aligned(method=method)
    assert [cut.method for cut in world.cuts] == [method] * 2 and all(cut.linked for cut in world.cuts)
    for earlier, later in ((0, 1), (1, 2)):
        truth = three_shots.camera(earlier)[0].T @ three_shots.camera(later)[0]
        last, first = (earlier + 1) * three_shots.LENGTH - 1, later * three_shots.LENGTH
        found = world.R_world_cam[last].T @ world.R_world_cam[first]
        assert np.degrees(rotation_angle(found.T @ truth)) < 5.0
    (person,) = world.people
    steps = np.linalg.norm(np.diff(person.pelvis_world, axis=0), axis=1)
    assert steps.max() < 0.1, "somebody who stands does not jump at a cut"
