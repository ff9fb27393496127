"""Runs an actor written by `gdg-tui export-policy` in the real FetchReach-v4 and counts the episodes it solves.

    pip install gymnasium-robotics==1.4.2 mujoco==3.3.7
    python tests/fetch_reach_v4.py POLICY.safetensors [EPISODES] [SEED]

An episode has 50 steps. It prints how many episodes reached the goal (within 5 cm) at any step, and how many were there
at the last step (gymnasium's `is_success`). Other versions of the packages move the arm otherwise.
"""

import json
import sys

import gymnasium
import gymnasium_robotics
import numpy as np

from policy import act, load

gymnasium.register_envs(gymnasium_robotics)
actor = load(sys.argv[1])
episodes = int(sys.argv[2]) if len(sys.argv) > 2 else 100
seed = int(sys.argv[3]) if len(sys.argv) > 3 else 0
world = gymnasium.make("FetchReach-v4")
reached = at_end = steps = 0
for episode in range(episodes):
    seen, _ = world.reset(seed=seed + episode)
    first = None
    for step in range(51):
        near = np.linalg.norm(seen["achieved_goal"] - seen["desired_goal"]) < 0.05
        if near and first is None:
            first = step
        if step == 50:
            at_end += near
            break
        action = act(*actor, seen["observation"], seen["desired_goal"])
        seen, *_ = world.step(action.astype(np.float32))
    reached += first is not None
    steps += first or 0
print(json.dumps({"episodes": episodes, "reached": reached, "at_end": int(at_end), "mean_steps": steps / max(reached, 1)}))
