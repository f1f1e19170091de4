"""Interpreters that several threads share."""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from humanmm.models.perception.runtime.litert import InterpreterPool
from humanmm.models.weights.shipped import read_weights


def test_interpreters_may_be_built_in_two_threads_and_give_equal_answers_and_leave_standard_error_alone() -> None:
    pool = InterpreterPool(read_weights("pose_landmark_full.tflite"), threads=1)
    tensor = np.random.default_rng(0).random((1, 256, 256, 3), np.float32)

    def scores(_: int) -> np.ndarray:
        with pool.lend() as interpreter:
            interpreter.set_tensor(interpreter.get_input_details()[0]["index"], tensor)
            interpreter.invoke()
            return np.asarray(interpreter.get_tensor(interpreter.get_output_details()[0]["index"]))

    before = os.fstat(2)
    with ThreadPoolExecutor(2) as threads:
        one, two = threads.map(scores, range(2))
    np.testing.assert_array_equal(one, two)
    assert (os.fstat(2).st_ino, os.fstat(2).st_dev) == (before.st_ino, before.st_dev)
