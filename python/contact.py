"""A finger that pushes a disc over a table, as a Gymnasium environment, and recordings of it.

    pip install gymnasium numpy
    cd python && python contact.py push.npz
    gdg-tui gym:contact:PushDisc-v0 --data push.npz

It is an example of an environment of one's own in which something has to be touched first: the goal is where the disc
is to lie, and most random steps do not move it. Without `--data`, agents find out by themselves.
"""

import sys

import gymnasium
import numpy as np

TABLE = 1.0
STEP = 0.05
RADIUS = 0.12
EPISODE = 150


class PushDisc(gymnasium.Env):
    # Closer than this to a goal, it is reached.
    distance_threshold = 0.08

    def __init__(self):
        place = gymnasium.spaces.Box(-TABLE, TABLE, (2,))
        both = gymnasium.spaces.Box(-TABLE, TABLE, (4,))
        self.observation_space = gymnasium.spaces.Dict(observation=both, achieved_goal=place, desired_goal=place)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,))

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        self.disc = self.np_random.uniform(-0.5, 0.5, 2)
        self.finger = self.disc
        while np.linalg.norm(self.finger - self.disc) < 2 * RADIUS:
            self.finger = self.np_random.uniform(-0.8, 0.8, 2)
        self.goal = self.new_goal()
        return self._observation(), {}

    def new_goal(self):
        return self.np_random.uniform(-0.6, 0.6, 2)

    def step(self, action):
        self.finger = np.clip(self.finger + STEP * np.clip(action, -1.0, 1.0), -TABLE, TABLE)
        apart = self.disc - self.finger
        distance = np.linalg.norm(apart)
        if distance < RADIUS:
            pushed = self.finger + RADIUS * apart / max(distance, 1e-9)
            self.disc = np.clip(pushed, -0.9, 0.9)
        observation = self._observation()
        reward = self.compute_reward(observation["achieved_goal"], observation["desired_goal"], {})
        return observation, float(reward), False, False, {"is_success": reward == 0.0}

    def compute_reward(self, achieved, desired, info):
        return -(np.linalg.norm(achieved - desired, axis=-1) >= self.distance_threshold).astype(float)

    def _observation(self):
        disc = self.disc.astype(np.float32)
        state = np.append(self.finger.astype(np.float32), disc)
        return {"observation": state, "achieved_goal": disc, "desired_goal": self.goal.astype(np.float32)}


gymnasium.register("PushDisc-v0", lambda: PushDisc(), max_episode_steps=EPISODE)


def push(env, rng):
    """Returns a clumsy action that goes behind the disc, then pushes it to the goal."""
    way = env.goal - env.disc
    way /= max(np.linalg.norm(way), 1e-9)
    side = np.array([-way[1], way[0]])
    from_disc = env.finger - env.disc
    along, across = from_disc @ way, from_disc @ side
    if along < -0.8 * RADIUS and abs(across) < 0.4 * RADIUS:
        aim = env.disc
    elif along > -RADIUS:
        aim = env.disc + np.copysign(2.0 * RADIUS, across) * side - 1.5 * RADIUS * way
    else:
        aim = env.disc - 1.3 * RADIUS * way
    action = (aim - env.finger) / STEP + rng.normal(0.0, 0.2, 2)
    if rng.random() < 0.3:
        action = rng.uniform(-1.0, 1.0, 2)
    return np.clip(action, -1.0, 1.0)


def record(path, steps=150_000, seed=0):
    """Writes transitions of an agent that pushes the disc to one goal after another, in OGBench's form."""
    env, rng, rows = PushDisc(), np.random.default_rng(seed), []
    for step in range(steps):
        if step % EPISODE == 0:
            env.reset(seed=seed + step)
        if np.linalg.norm(env.disc - env.goal) < env.distance_threshold:
            env.goal = env.new_goal()
        state, action = env._observation()["observation"], push(env, rng)
        env.step(action)
        rows.append((state, action, (step + 1) % EPISODE == 0))
    observations, actions, terminals = map(np.array, zip(*rows))
    np.savez(path, observations=observations, actions=actions.astype(np.float32), terminals=terminals)


if __name__ == "__main__":
    record(sys.argv[1])
