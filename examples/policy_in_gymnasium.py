"""Runs a policy written by `gdg-tui export-policy` in its Gymnasium environment, and counts the
goals that it reaches.

    pip install . gymnasium-robotics==1.4.2 mujoco==3.3.7
    python examples/policy_in_gymnasium.py POLICY.safetensors [EPISODES] [SEED]

With plans (`--plans`), it follows bridge points. A policy of the program's own arm runs in the real
FetchReach-v4; other versions of the packages move the arm otherwise.
"""

import importlib
import json
import sys

import gymnasium

import gdg_tui

ARM = {"package": "gymnasium_robotics", "id": "FetchReach-v4"}


def steps_to_goal(policy, world, seed):
    """Runs an episode; returns the steps until its goal was reached, None if it was not."""
    observation, info = world.reset(seed=seed)
    goal = policy.goal(observation, info)
    walk = policy.walk(goal) if policy.has_plans else None
    steps, ended = 0, False
    while not policy.reached(state := policy.state(observation), goal):
        if ended:
            return None
        action = walk.step(state) if walk else policy(state, goal)
        observation, _, terminated, truncated, _ = world.step(action.astype("float32"))
        steps, ended = steps + 1, terminated or truncated
    return steps


policy = gdg_tui.load_policy(sys.argv[1])
episodes = int(sys.argv[2]) if len(sys.argv) > 2 else 100
seed = int(sys.argv[3]) if len(sys.argv) > 3 else 0
known = policy.description.get("interface", ARM)
importlib.import_module(known["package"] or ARM["package"])
world = gymnasium.make(known["id"])
taken = [steps_to_goal(policy, world, seed + episode) for episode in range(episodes)]
reached = [steps for steps in taken if steps is not None]
mean = sum(reached) / max(len(reached), 1)
print(json.dumps({"episodes": episodes, "reached": len(reached), "mean_steps": mean}))
