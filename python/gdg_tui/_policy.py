"""Exported policies."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._file import PolicyError, read
from ._interface import Interface, rows
from ._networks import Actor, Critics
from ._plans import Graph, Planner, Walk


def load_policy(path: str | os.PathLike[str]) -> Policy:
    """Loads a file written by `gdg-tui export-policy`.

    Raises OSError if the file cannot be read, and PolicyError if it is no exported policy.
    """
    description, arrays = read(path)
    try:
        return Policy(description, arrays)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        problem = f"{os.fspath(path)} is not an exported policy: {error!r}"
        raise PolicyError(problem) from error


class Policy:
    """The actor mu(s, g) of a run; with plans also D(s, g), and walks through bridge points.

    States and goals are in the environment's own units. Actions too: of a Gymnasium environment
    they lie within the bounds of its action space, otherwise in [-1, 1]. Where `__call__`,
    `distance` and `reached` take a state and a goal, they take several as well, one in each row,
    and return as many results.
    """

    description: dict[str, Any]
    """The file's own description: world, method, seed, updates and more."""

    def __init__(self, description: dict[str, Any], arrays: dict[str, np.ndarray]):
        self.description = description
        inputs, plans = description["inputs"], description.get("plans")
        self._actor = Actor(arrays, inputs)
        self._interface = Interface(description.get("interface"), self.state_dim, self.goal_dim)
        self._planner: Planner | None = None
        if plans is not None:
            graph = Graph(arrays, description, self._actor.encoder.achieved)
            critics = Critics(arrays, inputs, plans["critics"])
            self._planner = Planner(graph, critics, self._actor, self._interface)

    @property
    def state_dim(self) -> int:
        """Number of components of a state."""
        return len(self._actor.encoder.centre)

    @property
    def goal_dim(self) -> int:
        """Number of components of a goal."""
        return len(self._actor.encoder.achieved)

    @property
    def action_dim(self) -> int:
        """Number of components of an action."""
        return self._actor.action_dim

    @property
    def has_plans(self) -> bool:
        """Whether it was exported with `--plans`."""
        return self._planner is not None

    @property
    def goal_radius(self) -> float:
        """Distance below which a goal is reached. Files of 0.2 lack it (PolicyError)."""
        if "goal_radius" not in self.description:
            raise PolicyError("this policy does not know its goal radius: export it again")
        return float(self.description["goal_radius"])

    def __call__(self, state: ArrayLike, goal: ArrayLike) -> np.ndarray:
        """Returns the actor's action in `state` (state_dim) towards `goal` (goal_dim), without a
        plan.
        """
        states, goals = self._pairs(state, goal)
        actions = self._interface.actions(self._actor.actions(states, goals))
        return actions[0] if np.ndim(state) < 2 else actions

    def distance(self, state: ArrayLike, goal: ArrayLike) -> float | np.ndarray:
        """Returns D from `state` (state_dim) to `goal` (goal_dim) in steps. Needs plans."""
        distances = self._with_plans().critics.distances(*self._pairs(state, goal))
        return float(distances[0]) if np.ndim(state) < 2 else distances

    def reached(self, state: ArrayLike, goal: ArrayLike) -> bool | np.ndarray:
        """Returns whether `state` (state_dim) reaches `goal` (goal_dim)."""
        states, goals = self._pairs(state, goal)
        apart = np.linalg.norm(states[:, self._actor.encoder.achieved] - goals, axis=1)
        reached = apart < self.goal_radius
        return bool(reached[0]) if np.ndim(state) < 2 else reached

    def walk(self, goal: ArrayLike) -> Walk:
        """Begins a walk to `goal` (goal_dim) through bridge points. Needs plans."""
        return Walk(self._with_plans(), rows(goal, self.goal_dim, "a goal")[0])

    def plan(self, state: ArrayLike, goal: ArrayLike) -> np.ndarray:
        """Returns the waypoints of a walk from `state` (state_dim) to `goal` (goal_dim), the goal
        last: (waypoints, goal_dim). Needs plans.
        """
        walk = self.walk(goal)
        walk.step(state)
        return walk.waypoints()

    def state(self, observation: Any) -> np.ndarray:
        """Returns the state (state_dim) of an observation of the environment: a vector, or a
        dictionary of `observation` and `achieved_goal`.
        """
        return self._interface.state(observation)

    def goal(self, observation: Any, info: Mapping[str, Any] | None = None) -> np.ndarray:
        """Returns the goal (goal_dim) that the environment asks for: `desired_goal` of an
        observation, or `goal` of the `info` that `reset` returned.
        """
        return self._interface.goal(observation, info or {})

    def _pairs(self, state: ArrayLike, goal: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        states, goals = rows(state, self.state_dim, "a state"), rows(goal, self.goal_dim, "a goal")
        if len(states) != len(goals):
            raise ValueError(f"there are {len(states)} states, but {len(goals)} goals")
        return states, goals

    def _with_plans(self) -> Planner:
        if self._planner is None:
            raise PolicyError("this policy has no plans: gdg-tui export-policy --plans adds them")
        return self._planner
