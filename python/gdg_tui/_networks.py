"""The networks. All arrays have a row for each state or pair."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

# What is outside of its range counts as no farther from its middle than this many half ranges.
MOST_HALF_RANGES = 10.0


class Encoder:
    """Turns states and goals into what networks read."""

    def __init__(self, inputs: dict[str, Any]):
        self.centre = np.array(inputs["state_centre"], dtype=float)
        half = np.array(inputs["state_half_range"], dtype=float)
        # A component whose range is 0 is scaled to 0.
        self.scale = np.where(half > 0, 1 / np.where(half > 0, half, 1), 0.0)
        self.achieved = np.array(inputs["achieved"], dtype=int)
        self.angles = np.pi * 2.0 ** np.arange(inputs["fourier_octaves"])
        self.rates = np.array(inputs["relative_rates"], dtype=float)
        # Files of earlier versions have no contacts.
        self.contacts = inputs.get("contacts", [])
        self.contact_scales = np.array(inputs.get("contact_scales", []), dtype=float)

    def states(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns `[u | F(u_a) | C(s)]`, with u the state scaled to [-1, 1] and C(s) how far contacts are
        apart, and its achieved part u_a.
        """
        scaled = np.clip((states - self.centre) * self.scale, -MOST_HALF_RANGES, MOST_HALF_RANGES)
        at = scaled[:, self.achieved]
        apart = [
            (states[:, c["other"]] - c["slope"] * states[:, c["goal"]] - c["offset"]) / c["width"]
            for c in self.contacts
        ]
        contacts = [np.tanh(a[:, None] / self.contact_scales) for a in apart]
        return np.hstack([scaled, self._fourier(at), *contacts]), at

    def pairs(self, states: np.ndarray, goals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns `[u | F(u_a) | C(s) | w | F(w) | tanh(rate * (goal - achieved))]`, with w the scaled
        goal, and `[u_a, w]`.
        """
        own, at = self.states(states)
        to = (goals - self.centre[self.achieved]) * self.scale[self.achieved]
        to = np.clip(to, -MOST_HALF_RANGES, MOST_HALF_RANGES)
        apart = (goals - states[:, self.achieved])[..., None] * self.rates
        relative = np.tanh(apart).reshape(len(goals), -1)
        return np.hstack([own, to, self._fourier(to), relative]), np.stack([at, to])

    def _fourier(self, values: np.ndarray) -> np.ndarray:
        """Returns `sin(pi v), cos(pi v), sin(2 pi v), ...` of each component in turn."""
        angles = values[..., None] * self.angles
        return np.stack([np.sin(angles), np.cos(angles)], -1).reshape(len(values), -1)


class Network:
    """Layers with ReLU after each but the last, which also read grids at positions."""

    def __init__(self, arrays: dict[str, np.ndarray], prefix: str, inputs: dict[str, Any]):
        def own(name: str) -> np.ndarray:
            return arrays[prefix + name].astype(float)

        hidden = range(inputs["layers"])
        self.layers = [(own(f"layer{i}.weight"), own(f"layer{i}.bias")) for i in hidden]
        self.output = own("output.weight").T, own("output.bias")
        self.grids = [arrays[f"{prefix}grid{i}"] for i in range(inputs["grids"])]

    def __call__(self, rows: np.ndarray, positions: np.ndarray, *more: np.ndarray) -> np.ndarray:
        """Computes the outputs for `rows`, what the grids hold at `positions` (positions of a row,
        rows, axes) in [-1, 1], and what follows.
        """
        read = [read_grid(grid, at) for at in positions for grid in self.grids]
        x = np.hstack([rows, *read, *more])
        for weight, bias in self.layers:
            x = np.maximum(x @ weight + bias, 0.0)
        return x @ self.output[0] + self.output[1]


def read_grid(grid: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Interpolates a grid (last axis, ..., first axis, channels), which spans [-1, 1] along every
    axis, at positions (rows, axes); those outside are moved to its edge.
    """
    corners = grid.shape[0]
    at = np.clip((positions + 1) / 2, 0, 1) * (corners - 1)
    lower = np.minimum(at.astype(int), corners - 2)
    share = at - lower
    values = np.zeros((len(positions), grid.shape[-1]))
    for upper in itertools.product([0, 1], repeat=positions.shape[1]):
        weights = np.where(upper, share, 1 - share).prod(axis=1)
        values += weights[:, None] * grid[tuple((lower + upper).T[::-1])]
    return values


class Actor:
    """The actor mu(s, g)."""

    def __init__(self, arrays: dict[str, np.ndarray], inputs: dict[str, Any]):
        self.encoder = Encoder(inputs)
        self.network = Network(arrays, "", inputs)
        self.action_dim = len(arrays["output.bias"])

    def actions(self, states: np.ndarray, goals: np.ndarray) -> np.ndarray:
        """Returns actions in [-1, 1], (rows, action_dim)."""
        return np.tanh(self.network(*self.encoder.pairs(states, goals)))


class Critics:
    """D(s, g), the dynamics model f(s, a), and lookahead with both."""

    def __init__(
        self, arrays: dict[str, np.ndarray], inputs: dict[str, Any], outputs: dict[str, Any]
    ):
        names = [f"critic{k}." for k in range(outputs["critics"])]
        self.encoder = Encoder(inputs)
        self.critics = [Network(arrays, name, inputs) for name in names]
        self.model = Network(arrays, "model.", inputs)
        self.distance_scale = outputs["distance_scale"]
        self.pessimism = outputs["pessimism"]
        self.change_scale = np.array(outputs["change_scale"], dtype=float)
        self.tried_actions = np.array(outputs["tried_actions"], dtype=float)
        self.good_progress = outputs["good_progress_steps"]
        self.min_gain = outputs["min_gain_steps"]

    def distances(self, states: np.ndarray, goals: np.ndarray) -> np.ndarray:
        """Returns D in steps, (rows): between the mean and the maximum of the critics."""
        rows, positions = self.encoder.pairs(states, goals)
        of_each = [critic(rows, positions)[:, 0] for critic in self.critics]
        first, *others = [self.distance_scale * np.logaddexp(0, z) for z in of_each]
        for other in others:
            apart = np.abs(first - other)
            first = np.maximum(first, other) - (1 - self.pessimism) / 2 * apart
        return first

    def next_states(self, states: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """Predicts the states after actions in [-1, 1]."""
        rows, at = self.encoder.states(states)
        return states + self.change_scale * self.model(rows, at[None], actions)

    def improved(self, state: np.ndarray, goal: np.ndarray, action: np.ndarray) -> np.ndarray:
        """Returns the action with clearly the smallest D(f(s, a), g), of the actor's own and a few
        full steps, if the actor's own makes little progress.
        """
        states, goals = state[None], goal[None]
        after = self.distances(self.next_states(states, action[None]), goals)
        if (self.distances(states, goals) - after)[0] >= self.good_progress:
            return action
        tried = np.vstack([action, *self.tried_actions])
        states, goals = np.repeat(states, len(tried), 0), np.repeat(goals, len(tried), 0)
        distances = self.distances(self.next_states(states, tried), goals)
        distances[0] -= self.min_gain
        return tried[np.argmin(distances)]
