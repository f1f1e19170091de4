"""The damping loop of Levenberg-Marquardt, for whatever a problem calls its state, its equations and its step."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

State = TypeVar("State")


@dataclass(frozen=True)
class Schedule:
    """How the damping follows success and failure, and when the loop ends."""

    iterations: int
    """Linearisations at most."""
    trials: int
    """Steps tried at one linearisation; when none lowers the cost, the loop ends."""
    damping: float
    """At the start."""
    raise_by: float
    lower_by: float
    least_raised: float = 0.0
    """The damping after a failure is at least this."""
    least_lowered: float = 0.0
    """The damping after a success is at least this."""
    relative_decrease: float = 1e-4
    """A step that lowers the cost by less than this fraction of it is the last one."""


def levenberg_marquardt(
    state: State,
    *,
    cost: Callable[[State], float],
    linearise: Callable[[State], Callable[[float], State | None]],
    schedule: Schedule,
) -> tuple[State, float]:
    """The state after the loop and its cost (Levenberg 1944, Marquardt 1963; Nocedal and Wright 2006, chapter 10.3).

    `linearise` builds the normal equations at a state and returns the function that solves them: from a damping to the
    state after the damped step, or None where the equations cannot be solved. A step is taken if it lowers the cost.
    """
    damping, current = schedule.damping, cost(state)
    for _ in range(schedule.iterations):
        stepped = linearise(state)
        for _trial in range(schedule.trials):
            candidate = stepped(damping)
            if candidate is not None:
                lowered = cost(candidate)
                if lowered < current:
                    break
            damping = max(damping * schedule.raise_by, schedule.least_raised)
        else:
            return state, current
        decrease, state, current = current - lowered, candidate, lowered
        damping = max(damping / schedule.lower_by, schedule.least_lowered)
        if decrease < schedule.relative_decrease * current:
            break
    return state, current
