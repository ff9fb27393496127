"""Runs an actor written by `gdg-tui export-policy`, with numpy alone.

    python tests/policy.py POLICY.safetensors < pairs.jsonl

reads {"state": [...], "goal": [...]} from each line and prints the action as a JSON list.
"""

import itertools
import json
import sys

import numpy as np


def load(path):
    """Returns the description of a policy and its arrays by name."""
    data = open(path, "rb").read()
    start = 8 + int.from_bytes(data[:8], "little")
    header = json.loads(data[8:start])
    policy = json.loads(header.pop("__metadata__")["policy"])
    arrays = {
        name: np.frombuffer(data[start:][slice(*entry["data_offsets"])], "<f4").reshape(entry["shape"])
        for name, entry in header.items()
    }
    return policy, arrays


def read_grid(grid, position):
    """Interpolates a grid (last axis, ..., first axis, channels) on [-1, 1] at a position."""
    corners = grid.shape[0]
    at = np.clip((position + 1) / 2, 0, 1) * (corners - 1)
    lower = np.minimum(at.astype(int), corners - 2)
    share = at - lower
    value = 0.0
    for bits in itertools.product([0, 1], repeat=len(position)):
        weight = np.prod([s if bit else 1 - s for bit, s in zip(bits, share)])
        value = value + weight * grid[tuple((lower + bits)[::-1])]
    return value


def act(policy, arrays, state, goal):
    """Returns the actor's action."""
    p = {name: np.array(value) for name, value in policy["inputs"].items()}
    half, own = p["state_half_range"], p["achieved"]
    scale = np.where(half > 0, 1 / np.where(half > 0, half, 1), 0)
    u = (np.array(state) - p["state_centre"]) * scale
    at, to = u[own], (np.array(goal) - p["state_centre"][own]) * scale[own]
    angles = np.pi * 2.0 ** np.arange(p["fourier_octaves"])
    fourier = lambda v: np.stack([np.sin(np.outer(v, angles)), np.cos(np.outer(v, angles))], -1).ravel()
    relative = np.tanh(np.outer(np.array(goal) - np.array(state)[own], p["relative_rates"])).ravel()
    grids = [read_grid(arrays[f"grid{i}"], v) for v in (at, to) for i in range(p["grids"])]
    x = np.concatenate([u, fourier(at), to, fourier(to), relative, *grids])
    for i in range(p["layers"]):
        x = np.maximum(0, x @ arrays[f"layer{i}.weight"] + arrays[f"layer{i}.bias"])
    return np.tanh(arrays["output.weight"] @ x + arrays["output.bias"])


if __name__ == "__main__":
    actor = load(sys.argv[1])
    for line in sys.stdin:
        pair = json.loads(line)
        print(json.dumps(act(*actor, pair["state"], pair["goal"]).tolist()))
