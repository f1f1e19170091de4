"""Networks that are less exact than the shipped ones and three times as fast, for tests of what is done with them."""

from humanmm.models.perception import blazepose, movenet
from humanmm.models.perception.interfaces import Networks

QUICK = Networks(movenet.detect, blazepose.locate_full)
