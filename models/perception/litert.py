"""Running shipped networks on LiteRT: interpreters are built once per process and lent to one caller at a time."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from threading import Lock

import numpy as np
from ai_edge_litert.interpreter import Interpreter

from humanmm.machine import num_processors
from humanmm.models.weights.shipped import read_weights

_BUILDING = Lock()
"""One interpreter is built at a time in the process: standard error is redirected meanwhile."""


class InterpreterPool:
    """Interpreters of one model for one shape of its input; results do not depend on the number of threads."""

    def __init__(self, model: bytes, threads: int, shape: tuple[int, ...] | None = None) -> None:
        self._model, self._threads, self._shape = model, threads, shape
        self._idle: list[Interpreter] = []
        self._lock = Lock()

    @contextmanager
    def lend(self) -> Iterator[Interpreter]:
        """An interpreter for the caller alone; a new one is built when all are lent."""
        with self._lock:
            interpreter = self._idle.pop() if self._idle else None
        if interpreter is None:
            with _BUILDING, _without_greeting():
                interpreter = Interpreter(model_content=self._model, num_threads=self._threads)
                if self._shape is not None:
                    interpreter.resize_tensor_input(interpreter.get_input_details()[0]["index"], self._shape)
                interpreter.allocate_tensors()
        try:
            yield interpreter
        finally:
            with self._lock:
                self._idle.append(interpreter)

    def run(self, tensor: np.ndarray, wanted: tuple[str, ...] = ()) -> list[np.ndarray]:
        """Outputs of one inference by tensor name (a network may have large ones that nobody needs); else all."""
        with self.lend() as interpreter:
            outputs = {output["name"]: output["index"] for output in interpreter.get_output_details()}
            interpreter.set_tensor(interpreter.get_input_details()[0]["index"], tensor)
            interpreter.invoke()
            return [interpreter.get_tensor(outputs[name]) for name in wanted or outputs]


@lru_cache(maxsize=16)
def pool(name: str, shape: tuple[int, ...] | None = None) -> InterpreterPool:
    """The process's interpreters of one shipped network; `shape` of the input where the network leaves it open."""
    return InterpreterPool(_weights(name), min(2, num_processors()), shape)


@lru_cache(maxsize=4)
def _weights(name: str) -> bytes:
    """Read and checked once, however many shapes its input takes."""
    return read_weights(name)


@contextmanager
def _without_greeting() -> Iterator[None]:
    """Keep the runtime's own line about its delegate, for which it has no switch, off standard error."""
    try:
        kept = os.dup(2)
    except OSError:  # standard error is closed
        yield
        return
    silent = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(silent, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(silent)
