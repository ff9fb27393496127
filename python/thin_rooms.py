"""The four rooms with thin walls in which SoRB and Sparse Graphical Memory were compared, as a Gymnasium environment.

    pip install gymnasium numpy
    cd python && gdg-tui gym:thin_rooms:ThinRooms-v0

It follows the environment of the code of Sparse Graphical Memory (github.com/scottemmons/sgm): rooms of 11 x 11 cells,
enlarged by 5 with walls that stay one cell thick, a point that moves by at most one cell along each axis in ten parts,
one draw of standard normal noise that is added to both components of an action, and goals that are reached within a
cell. Agents start anywhere. A task (`options={"task_id": 1}`) has a goal at 0.9 to 1.0 of the largest distance from
cell to cell and 600 steps. It is also an example of an environment of one's own: of what a `gym:` world needs, nothing
is left out.
"""

import gymnasium
import numpy as np

ROOMS = """
.....#.....
.....#.....
...........
.....#.....
.....#.....
#.####.....
.....###.##
.....#.....
.....#.....
...........
.....#.....
"""
FACTOR = 5
PARTS = 10
NOISE = 1.0
# Steps from cell to cell, also diagonally past corners, between the two cells that are farthest apart.
LARGEST_DISTANCE = 66


def thinned(walls, factor):
    """Enlarges a maze along its rows; walls become longer only towards other walls."""
    right = np.hstack([walls[:, 1:], walls[:, -1:]])
    wide = np.repeat(walls & right, factor, axis=1)
    wide[:, ::factor] = walls
    return wide


def distances(walls, cell):
    """Returns the number of steps to each cell, -1 for walls and what cannot be reached."""
    steps = np.full(walls.shape, -1)
    front = np.zeros_like(walls)
    front[cell] = True
    count = 0
    while front.any():
        steps[front] = count
        count += 1
        padded = np.pad(front, 1)
        height, width = walls.shape
        around = [padded[i : i + height, j : j + width] for i in range(3) for j in range(3)]
        front = np.any(around, axis=0) & ~walls & (steps < 0)
    return steps


class ThinRooms(gymnasium.Env):
    # What tells the program when a goal is reached, what tasks there are, and where walls are.
    distance_threshold = 1.0
    num_tasks = 1

    def __init__(self):
        rooms = np.array([list(row) for row in ROOMS.split()]) == "#"
        self.walls = thinned(thinned(rooms, FACTOR).T, FACTOR).T
        self.maze_map = self.walls.astype(int)
        height, width = self.walls.shape
        size = np.array([width, height], dtype=np.float32)
        self.observation_space = gymnasium.spaces.Box(np.zeros(2, dtype=np.float32), size)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,))

    def ij_to_xy(self, cell):
        return cell[1] + 0.5, cell[0] + 0.5

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        self.at = self._somewhere(~self.walls)
        wanted = ~self.walls
        while options:
            steps = distances(self.walls, (int(self.at[1]), int(self.at[0])))
            wanted = steps >= 0.9 * LARGEST_DISTANCE
            if wanted.any():
                break
            self.at = self._somewhere(~self.walls)
        self.goal = self._somewhere(wanted)
        return self.at.astype(np.float32), {"goal": self.goal.astype(np.float32)}

    def step(self, action):
        action = np.clip(action + self.np_random.normal(0.0, NOISE), -1.0, 1.0)
        for _ in range(PARTS):
            for axis in range(2):
                to = self.at.copy()
                to[axis] += action[axis] / PARTS
                if self._is_free(to):
                    self.at = to
        reached = bool(np.linalg.norm(self.at - self.goal) < self.distance_threshold)
        return self.at.astype(np.float32), 0.0, False, False, {"success": reached}

    def _somewhere(self, cells):
        rows, columns = np.nonzero(cells)
        i = self.np_random.integers(len(rows))
        return np.array([columns[i], rows[i]]) + self.np_random.uniform(size=2)

    def _is_free(self, at):
        x, y = at
        height, width = self.walls.shape
        return 0 <= x < width and 0 <= y < height and not self.walls[int(y), int(x)]


gymnasium.register("ThinRooms-v0", lambda: ThinRooms(), max_episode_steps=600)
