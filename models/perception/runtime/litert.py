"""Networks on the processor, by LiteRT: interpreters are built once and lent to one caller at a time."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

import numpy as np
from ai_edge_litert.interpreter import Interpreter

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

    def sample_input(self) -> np.ndarray:
        """A picture that the network takes, of noise: always the same."""
        with self.lend() as interpreter:
            (details,) = interpreter.get_input_details()
        noise = np.random.default_rng(0).random(tuple(details["shape"]), np.float32)
        whole_numbers = details["dtype"] != np.float32
        return (255 * noise).astype(np.int32) if whole_numbers else noise


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
