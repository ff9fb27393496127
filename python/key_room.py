"""Two rooms with a locked door between them, and the key in one of them, as a Gymnasium environment.

    pip install gymnasium numpy
    cd python && gdg-tui gym:key_room:KeyRoom-v0

It is an example of an environment of one's own in Gymnasium-Robotics's form, in which what has to be achieved is only
a part of the state: a place, while the state says as well whether the agent has the key. Half of the goals can only be
reached by going for the key first.
"""

import gymnasium
import numpy as np

SIZE = np.array([10.0, 6.0])
WALL = 5.0
DOOR = (2.0, 4.0)
KEY = np.array([1.0, 5.0])
KEY_RADIUS = 0.7
STEP = 0.5


class KeyRoom(gymnasium.Env):
    # Closer than this to a goal, it is reached.
    distance_threshold = 0.5

    def __init__(self):
        place = gymnasium.spaces.Box(0.0, SIZE.max(), (2,))
        observed = gymnasium.spaces.Box(0.0, SIZE.max(), (3,))
        self.observation_space = gymnasium.spaces.Dict(
            observation=observed, achieved_goal=place, desired_goal=place
        )
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,))

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        self.at = self.np_random.uniform((0.0, 0.0), (WALL, SIZE[1]))
        self.has_key = False
        self.goal = self.np_random.uniform((0.0, 0.0), SIZE)
        return self._observation(), {}

    def step(self, action):
        for axis in range(2):
            to = self.at.copy()
            to[axis] = np.clip(to[axis] + STEP * np.clip(action[axis], -1.0, 1.0), 0.0, SIZE[axis])
            passes = (to[0] < WALL) != (self.at[0] < WALL)
            if not passes or (self.has_key and DOOR[0] < to[1] < DOOR[1]):
                self.at = to
        self.has_key |= bool(np.linalg.norm(self.at - KEY) < KEY_RADIUS)
        observation = self._observation()
        reward = self.compute_reward(observation["achieved_goal"], observation["desired_goal"], {})
        return observation, float(reward), False, False, {"is_success": reward == 0.0}

    def compute_reward(self, achieved, desired, info):
        return -(np.linalg.norm(achieved - desired, axis=-1) >= self.distance_threshold).astype(float)

    def _observation(self):
        place = self.at.astype(np.float32)
        state = np.append(place, np.float32(self.has_key))
        return {"observation": state, "achieved_goal": place, "desired_goal": self.goal.astype(np.float32)}


gymnasium.register("KeyRoom-v0", lambda: KeyRoom(), max_episode_steps=100)
