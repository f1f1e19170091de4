"""Synthetic shots with known cameras: random points before a static, rotating or moving camera."""

from collections.abc import Callable

import pytest
from filmed_points import Scene, make_scene


@pytest.fixture
def scene_of() -> Callable[..., Scene]:
    return make_scene
