"""Between an environment's observations and actions and those of its policy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


class Interface:
    """What an environment observes and does, and how a policy sees it; by default, the same."""

    def __init__(self, known: dict[str, Any] | None, state_dim: int, goal_dim: int):
        known = known or {}
        self.observed = known.get("observation", state_dim)
        self.achieved = known.get("achieved_goal", 0)
        self.desired = known.get("desired_goal", goal_dim)
        self.state_columns = known.get("state_columns", list(range(state_dim)))
        self.goal_columns = known.get("goal_columns", list(range(goal_dim)))
        bounds = [_bounds(*pair) for pair in zip(known.get("low", [-1]), known.get("high", [1]))]
        self.low, self.high = np.array(bounds, dtype=float).T

    def state(self, observation: Any) -> np.ndarray:
        """Returns the state of an observation."""
        if isinstance(observation, Mapping):
            names = ["observation", "achieved_goal"] if self.achieved else ["observation"]
            observation = np.concatenate([np.ravel(observation[name]) for name in names])
        (row,) = rows(np.ravel(observation), self.observed + self.achieved, "an observation")
        return row[self.state_columns]

    def goal(self, observation: Any, info: Mapping[str, Any]) -> np.ndarray:
        """Returns the goal in an observation or in `info`."""
        holder = observation if isinstance(observation, Mapping) else info
        name = "desired_goal" if isinstance(observation, Mapping) else "goal"
        if name not in holder:
            raise ValueError(f"there is no {name}: give what reset returned")
        (row,) = rows(np.ravel(holder[name]), self.desired, "a goal of the environment")
        return row[self.goal_columns]

    def actions(self, actions: np.ndarray) -> np.ndarray:
        """Scales actions (rows, action_dim) from [-1, 1] to their bounds."""
        return self.low + (np.clip(actions, -1, 1) + 1) / 2 * (self.high - self.low)


def _bounds(low: float | None, high: float | None) -> tuple[float, float]:
    """Returns the range of an action. Without a bound, it is as long as [-1, 1]; without both, that."""
    if low is None:
        return (-1, 1) if high is None else (high - 2, high)
    return low, low + 2 if high is None else high


def rows(values: ArrayLike, width: int, what: str) -> np.ndarray:
    """Returns one or several of something that has `width` components by rows."""
    found = np.atleast_2d(np.asarray(values, dtype=float))
    if found.ndim != 2 or found.shape[1] != width:
        raise ValueError(f"{what} has {width} numbers, not an array of shape {np.shape(values)}")
    return found
