"""The damping loop on problems whose answers are known."""

from collections.abc import Callable

import numpy as np
import pytest

from humanmm.models.geometry.levenberg_marquardt import Schedule, levenberg_marquardt

SCHEDULE = Schedule(iterations=200, trials=8, damping=1e-3, raise_by=8, lower_by=4, relative_decrease=0.0)


def rosenbrock(x: np.ndarray) -> np.ndarray:
    """Residuals whose sum of squares is Rosenbrock's valley, lowest at (1, 1)."""
    return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])


def cost(x: np.ndarray) -> float:
    return 0.5 * float(np.sum(rosenbrock(x) ** 2))


def linearise(x: np.ndarray) -> Callable[[float], np.ndarray | None]:
    J, r = np.array([[-20 * x[0], 10.0], [-1.0, 0.0]]), rosenbrock(x)
    H = J.T @ J
    return lambda damping: x - np.linalg.solve(H + damping * np.diag(np.diag(H)), J.T @ r)


def test_it_follows_rosenbrocks_valley_to_its_end() -> None:
    found, left = levenberg_marquardt(np.array([-1.2, 1.0]), cost=cost, linearise=linearise, schedule=SCHEDULE)
    np.testing.assert_allclose(found, [1.0, 1.0], atol=1e-8)
    assert left == pytest.approx(cost(found))


def test_where_no_step_helps_the_start_is_returned() -> None:
    start = np.array([-1.2, 1.0])
    found, left = levenberg_marquardt(start, cost=cost, linearise=lambda x: lambda damping: None, schedule=SCHEDULE)
    assert found is start
    assert left == cost(start)
