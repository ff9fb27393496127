#!/usr/bin/env python3
"""Compares `her --preset sb3` with Stable-Baselines3's DDPG and HerReplayBuffer on an empty map.

    python3 -m venv venv && venv/bin/pip install torch stable-baselines3
    venv/bin/python tests/sb3.py [--side 16] [--steps 20000] [--seeds 2] [--program target/release/gdg-tui]

Both train one agent for the same number of steps, one update a step, with the same networks (2 x 256), noise (sigma .2),
episodes (150 steps from anywhere, to the end even if the goal is reached) and tasks: six distances up to .9 of the
diameter, 500 steps each. Everything else is Stable-Baselines3's default. The world is the program's maze: a point that
slides in ten substeps along walls, with a goal radius of one cell. Exits with status 1 if the mean success rates differ
by more than .05.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import gymnasium
import numpy as np
import torch
from stable_baselines3 import DDPG, HerReplayBuffer
from stable_baselines3.common.noise import NormalActionNoise

EPISODE_STEPS = 150
BUDGET_STEPS = 500
RADIUS = 1.0
SUBSTEPS = 10


class EmptyMaze(gymnasium.Env):
    """The point maze without inner walls; positions are scaled to [-1, 1], as the program's are."""

    def __init__(self, side):
        self.side = side
        box = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = gymnasium.spaces.Dict(observation=box, achieved_goal=box, desired_goal=box)
        self.action_space = box
        self.at = self.goal = np.zeros(2)
        self.clock = 0

    def scaled(self, at):
        return (2.0 * at / self.side - 1.0).astype(np.float32)

    def observe(self):
        at = self.scaled(self.at)
        return {"observation": at, "achieved_goal": at, "desired_goal": self.scaled(self.goal)}

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        self.at, self.goal = self.np_random.uniform(0.0, self.side, (2, 2))
        self.clock = 0
        return self.observe(), {}

    def compute_reward(self, achieved, desired, info):
        distance = np.linalg.norm(achieved - desired, axis=-1) * self.side / 2.0
        return -(distance >= RADIUS).astype(np.float32)

    def step(self, action):
        move = np.clip(action, -1.0, 1.0) / SUBSTEPS
        for _ in range(SUBSTEPS):
            for axis in range(2):
                to = self.at[axis] + move[axis]
                if 0.0 <= to < self.side:
                    self.at[axis] = to
        self.clock += 1
        seen = self.observe()
        reward = float(self.compute_reward(seen["achieved_goal"], seen["desired_goal"], {}))
        return seen, reward, False, self.clock >= EPISODE_STEPS, {"is_success": reward == 0.0}


def tasks(side, each, rng):
    """Pairs of cell centres at six distances; on an empty map, a cell is as many steps away as the longer axis says."""
    pairs = []
    for i in range(1, 7):
        distance = round(0.9 * (side - 1) * i / 6)
        own = []
        while len(own) < each:
            start, goal = rng.integers(0, side, (2, 2))
            if abs(start - goal).max() == distance:
                own.append((start + 0.5, goal + 0.5))
        pairs += own
    return pairs


def success(model, side, pairs):
    reached = 0
    env = EmptyMaze(side)
    env.reset(seed=0)
    for start, goal in pairs:
        env.at, env.goal = start.copy(), goal
        for _ in range(BUDGET_STEPS):
            if np.linalg.norm(env.at - env.goal) < RADIUS:
                reached += 1
                break
            action, _ = model.predict(env.observe(), deterministic=True)
            env.step(action)
    return reached / len(pairs)


def train_sb3(side, steps, seed, each):
    model = DDPG(
        "MultiInputPolicy",
        EmptyMaze(side),
        seed=seed,
        replay_buffer_class=HerReplayBuffer,
        replay_buffer_kwargs={"n_sampled_goal": 4, "goal_selection_strategy": "future"},
        action_noise=NormalActionNoise(np.zeros(2), 0.2 * np.ones(2)),
        learning_starts=EPISODE_STEPS,
        policy_kwargs={"net_arch": [256, 256]},
        train_freq=1,
        gradient_steps=1,
        device="cpu",
    )
    model.learn(steps)
    return success(model, side, tasks(side, each, np.random.default_rng(seed)))


def train_ours(program, side, steps, seed, each):
    with tempfile.TemporaryDirectory() as folder:
        map_file = pathlib.Path(folder) / "empty.txt"
        map_file.write_text(("." * side + "\n") * side)
        updates = steps - EPISODE_STEPS
        command = [program, "--no-ui", str(map_file), "--method", "her", "--preset", "sb3", "--seed", str(seed)]
        command += ["--set", f"learning_starts={EPISODE_STEPS}", "--max-updates", str(updates)]
        command += ["--eval-tasks", str(each), "--threads", "1"]
        lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    records = [json.loads(line) for line in lines]
    last = [record for record in records if record["event"] == "evaluation"][-1]
    return last["alone"]["success"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--side", type=int, default=16)
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--tasks", type=int, default=20)
    parser.add_argument("--program", default="target/release/gdg-tui")
    args = parser.parse_args()
    torch.set_num_threads(1)
    found = []
    for seed in range(1, args.seeds + 1):
        ours = train_ours(args.program, args.side, args.steps, seed, args.tasks)
        theirs = train_sb3(args.side, args.steps, seed, args.tasks)
        print(f"seed {seed}, {args.steps} steps: ours {ours:.3f}, Stable-Baselines3 {theirs:.3f}", flush=True)
        found.append((ours, theirs))
    ours, theirs = np.mean(found, axis=0)
    print(f"mean: ours {ours:.3f}, Stable-Baselines3 {theirs:.3f}")
    sys.exit(0 if abs(ours - theirs) <= 0.05 else 1)


if __name__ == "__main__":
    main()
