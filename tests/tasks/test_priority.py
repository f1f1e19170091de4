"""What runs at low priority gives its result, and the caller keeps its own priority."""

import os
import sys
import threading

import pytest

from humanmm.tasks.priority import LOWEST_PRIORITY, at_low_priority


def test_a_call_at_low_priority_gives_its_result_and_leaves_the_caller_its_priority() -> None:
    before = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())
    within = at_low_priority(lambda: os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))
    assert os.getpriority(os.PRIO_PROCESS, threading.get_native_id()) == before
    assert within == (LOWEST_PRIORITY if sys.platform == "linux" else before)


def test_an_error_at_low_priority_is_raised_to_the_caller() -> None:
    with pytest.raises(ZeroDivisionError):
        at_low_priority(lambda: 1 // 0)
