"""Collects a point maze dataset of OGBench by its published recipe.

    pip install ogbench numpy
    python collect_ogbench.py pointmaze-giant-stitch-v0 FILE.npz [--seed 0] [--steps 1000000]

A datum is what the environment shows, and the direction to the next block on a shortest way to the
goal, plus Gaussian noise, as the action. In `navigate`, a goal that is reached is followed by
another one, in any block but a hallway; in `stitch`, the goal is four blocks away from the start,
and the ball stays there. Files have the arrays of the official ones, without `qpos` and `qvel`,
which are the observations and 0. With the same seed and packages, the same file.
"""

import argparse
import os
import sys

import gymnasium
import numpy as np
import ogbench  # noqa: F401, registers the environments

NOISE = 0.5
STITCH_BLOCKS = 4
# Blocks around one, in the order in which the environment's own oracle looks at them.
AROUND = [(-1, 0), (0, -1), (1, 0), (0, 1)]


def steps_of_an_episode(maze, kind):
    """Returns the rows of an episode."""
    if kind == "stitch":
        return 201
    return 2001 if maze == "giant" else 1001


def distances(free, goal):
    """Returns the blocks on a shortest way to `goal` by block, where there is one."""
    found, queue = {goal: 0}, [goal]
    for block in queue:
        for i, j in AROUND:
            near = (block[0] + i, block[1] + j)
            if near in free and near not in found:
                found[near] = found[block] + 1
                queue.append(near)
    return found


def is_hallway(free, block):
    """Returns whether `block` only leads straight on."""
    i, j = block
    sides = [(i - 1, j) in free, (i + 1, j) in free, (i, j - 1) in free, (i, j + 1) in free]
    return sides in ([True, True, False, False], [False, False, True, True])


class Collector:
    """Episodes in one maze."""

    def __init__(self, maze, kind):
        env = gymnasium.make(f"pointmaze-{maze}-v0", terminate_at_goal=False)
        self.env, self.kind = env.unwrapped, kind
        self.steps = steps_of_an_episode(maze, kind)
        self.blocks = [(int(i), int(j)) for i, j in np.argwhere(self.env.maze_map == 0)]
        free = set(self.blocks)
        self.goals = [block for block in self.blocks if not is_hallway(free, block)]
        self.ways = {goal: distances(free, goal) for goal in self.blocks}

    def draw(self, blocks):
        return blocks[np.random.randint(len(blocks))]

    def ends(self):
        """Draws start and goal."""
        start = self.draw(self.blocks)
        if self.kind == "navigate":
            return start, self.draw(self.goals)
        ways = self.ways[start]
        near = [block for block in self.blocks if ways.get(block) == STITCH_BLOCKS]
        return start, self.draw(near) if near else start

    def action(self, position):
        """Returns the noisy direction to the middle of the next block, or to that of this one."""
        here, goal = (self.env.xy_to_ij(xy) for xy in (position, self.env.cur_goal_xy))
        way, aim = self.ways[goal], here
        for i, j in AROUND:
            near = (here[0] + i, here[1] + j)
            # Out of the block that is walled in, no way leads.
            if near in way and way[near] < way.get(aim, -1):
                aim = near
        direction = np.array(self.env.ij_to_xy(aim)) - position
        direction /= np.linalg.norm(direction) + 1e-6
        return np.clip(direction + np.random.normal(0, NOISE, 2), -1, 1)

    def episode(self):
        """Yields the state and the action of every step."""
        start, goal = self.ends()
        task = {"init_ij": start, "goal_ij": goal}
        state, _ = self.env.reset(options={"task_info": task})
        for _ in range(self.steps):
            # A teleport moves the ball after it is observed.
            action = self.action(self.env.get_xy())
            yield state, action
            state, _, _, _, info = self.env.step(action)
            if info["success"] and self.kind == "navigate":
                self.env.set_goal(self.draw(self.goals))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", help="such as pointmaze-giant-stitch-v0")
    parser.add_argument("file")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=1_000_000, help="transitions, at least")
    args = parser.parse_args()
    try:
        world, maze, kind, _ = args.dataset.split("-")
        assert world == "pointmaze" and kind in ("navigate", "stitch")
        np.random.seed(args.seed)
        collector = Collector(maze, kind)
        collector.env.action_space.seed(args.seed)
    except (ValueError, AssertionError, gymnasium.error.Error):
        sys.exit(f"{args.dataset}: give pointmaze-MAZE-navigate-v0 or pointmaze-MAZE-stitch-v0")
    # The last step of an episode is no transition.
    episodes = -(-args.steps // (collector.steps - 1))
    rows = [list(collector.episode()) for _ in range(episodes)]
    states, actions = (
        np.array([row[part] for episode in rows for row in episode], np.float32) for part in (0, 1)
    )
    ends = np.zeros(len(states), bool)
    ends[collector.steps - 1 :: collector.steps] = True
    # Whole or not at all, also if two are at it.
    part = f"{args.file}.{os.getpid()}.part"
    with open(part, "wb") as file:
        np.savez_compressed(file, observations=states, actions=actions, terminals=ends)
    os.replace(part, args.file)


if __name__ == "__main__":
    main()
