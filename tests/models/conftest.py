"""What tests of all rooms take: random numbers, and a pack of motion capture made of arithmetic."""

import numpy as np
import pytest
from walking_pack import pack, sequences

__all__ = ["pack", "rng", "sequences"]


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers that are the same in every test, in whatever order tests run."""
    return np.random.default_rng(0)
