#!/usr/bin/env python3
"""Trains Stable-Baselines3's SAC with HerReplayBuffer in a Gymnasium environment and prints its success.

    python3 -m venv venv && venv/bin/pip install torch stable-baselines3 gymnasium-robotics==1.4.2 mujoco==3.3.7
    venv/bin/python tests/sb3_gym.py PointMaze_UMaze-v3 [--steps 12496] [--every 2000] [--seed 0] [--tasks 100]

Everything is Stable-Baselines3's default, but that learning starts after the first episode, as HerReplayBuffer needs
one. Tasks are the environment's own resets, each with its time limit; reached once is success. One line of JSON for
each evaluation.
"""

import argparse
import json
import time

import gymnasium
import gymnasium_robotics
import torch
from stable_baselines3 import SAC, HerReplayBuffer

gymnasium.register_envs(gymnasium_robotics)


def success(model, env, tasks, seed):
    reached = 0
    for task in range(tasks):
        seen, _ = env.reset(seed=1_000_000 * (seed + 1) + task)
        over = False
        while not over:
            action, _ = model.predict(seen, deterministic=True)
            seen, _, terminated, truncated, info = env.step(action)
            if info.get("success", info.get("is_success")):
                reached += 1
                break
            over = terminated or truncated
    return reached / tasks


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("id")
    parser.add_argument("--steps", type=int, default=12_496)
    parser.add_argument("--every", type=int, default=2_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--tasks", type=int, default=100)
    args = parser.parse_args()
    torch.set_num_threads(1)
    env = gymnasium.make(args.id)
    model = SAC(
        "MultiInputPolicy",
        env,
        seed=args.seed,
        replay_buffer_class=HerReplayBuffer,
        replay_buffer_kwargs={"n_sampled_goal": 4, "goal_selection_strategy": "future"},
        learning_starts=env.spec.max_episode_steps + 1,
        device="cpu",
    )
    began, done, evaluation = time.process_time(), 0, gymnasium.make(args.id)
    while done < args.steps:
        more = min(args.every, args.steps - done)
        model.learn(more, reset_num_timesteps=done == 0)
        done += more
        spent = time.process_time() - began
        share = success(model, evaluation, args.tasks, args.seed)
        record = {"id": args.id, "seed": args.seed, "steps": done, "success": share, "cpu_seconds": round(spent, 1)}
        print(json.dumps(record), flush=True)


if __name__ == "__main__":
    main()
