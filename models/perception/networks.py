"""The shipped pairs of detector and pose network."""

from humanmm.models.perception import fusion, movenet
from humanmm.models.perception.interfaces import Networks

BEST = Networks(movenet.detect, fusion.locate_best)
"""What `people.detector` and `people.pose` name when nothing is set."""
FAST = Networks(movenet.detect, fusion.locate_fast)
