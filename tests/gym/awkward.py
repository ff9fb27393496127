"""Environments that misbehave on demand, for the tests of environments in Python.

All are a point in a square that moves by its action, with a goal. What goes wrong goes wrong after
AWKWARD_AFTER steps of the process, or from the start. With AWKWARD_EXTRA, observations have so many
more numbers, and AWKWARD_BOUND, AWKWARD_LIMIT, AWKWARD_SIDE and AWKWARD_RADIUS are its largest action,
time limit, observation and goal radius: another version of the environment, which AWKWARD_VERSION says.
AWKWARD_SPEED is how far an action leads.
"""

import ctypes
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import time
import types

import gymnasium as gym
import numpy as np

SIDE = float(os.environ.get("AWKWARD_SIDE", "5"))
RADIUS = float(os.environ.get("AWKWARD_RADIUS", "0.5"))
AFTER = int(os.environ.get("AWKWARD_AFTER", "1000000000"))
EXTRA = int(os.environ.get("AWKWARD_EXTRA", "0"))
BOUND = float(os.environ.get("AWKWARD_BOUND", "0.5"))
LIMIT = int(os.environ.get("AWKWARD_LIMIT", "40"))
SPEED = float(os.environ.get("AWKWARD_SPEED", "1"))
if "AWKWARD_VERSION" in os.environ:
    __version__ = os.environ["AWKWARD_VERSION"]
assert sys.argv[0] != "-c" or len(sys.argv) == 1, "packages may read them"
steps = 0
number = None


class Point(gym.Env):
    """A well-behaved environment; the others change one thing each."""

    distance_threshold = RADIUS

    def __init__(self):
        box = lambda size: gym.spaces.Box(-SIDE, SIDE, (size,), np.float64)
        self.observation_space = gym.spaces.Dict(
            observation=box(3 + EXTRA), achieved_goal=box(2), desired_goal=box(2)
        )
        self.action_space = gym.spaces.Box(-BOUND, BOUND, (2,), np.float32)
        self.at, self.goal, self.wind = np.zeros(2), np.zeros(2), 0.0

    def observe(self):
        return {
            # What is achieved comes second.
            "observation": np.concatenate([[self.wind], self.at, np.zeros(EXTRA)]),
            "achieved_goal": self.at.copy(),
            "desired_goal": self.goal.copy(),
        }

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        self.at = self.np_random.uniform(-SIDE, SIDE, 2)
        self.goal = self.np_random.uniform(-SIDE, SIDE, 2)
        self.wind = 0.0
        return self.observe(), {}

    def step(self, action):
        global steps
        steps += 1
        if steps > AFTER:
            self.misbehave()
        assert (np.abs(action) <= 0.5).all(), "actions are scaled"
        # Its own random numbers are part of its state.
        self.wind = 0.9 * self.wind + 0.01 * self.np_random.normal()
        self.at = np.clip(self.at + SPEED * action + [self.wind, 0.0], -SIDE, SIDE)
        return self.observe(), 0.0, self.is_over(), False, {}

    def is_over(self):
        return False

    def misbehave(self):
        pass


class Strict(Point):
    """Has bounds of double precision, which single precision rounds outward."""

    def __init__(self, **how):
        super().__init__(**how)
        self.action_space = gym.spaces.Box(-0.1, 0.1, (2,), np.float64)

    def step(self, action):
        assert self.action_space.contains(action), "actions are within their bounds"
        return super().step(action)


class Raises(Point):
    def misbehave(self):
        raise ValueError("the point is \x1b[31mlost")


class Misnames(Point):
    def misbehave(self):
        raise ModuleNotFoundError("the third module", name=3)


class Wanders(Point):
    """Its goal moves within episodes."""

    def step(self, action):
        self.goal = self.goal + 0.01
        return super().step(action)


class Shouts(Point):
    """Says more than fits, and half of a character."""

    def misbehave(self):
        raise ValueError("no such file: \udcff" + 100_000 * "!" + " that is it")


class Shrinks(Point):
    """Its goals become single numbers, which numpy would repeat."""

    def observe(self):
        observation = super().observe()
        return {**observation, "achieved_goal": self.at[:1]} if steps > AFTER else observation


class Drifts(Point):
    """Becomes another one after its first look, of 320 steps: asks for goals within other bounds, which
    it may."""

    def step(self, action):
        answer = super().step(np.clip(action, -0.5, 0.5))
        if steps > 400:
            self.drift()
        return answer

    def drift(self):
        self.observation_space["desired_goal"] = gym.spaces.Box(-9.0, 9.0, (2,), np.float64)


class Strengthens(Drifts):
    def drift(self):
        self.action_space.high[1] = 2.0


class Rescales(Drifts):
    def drift(self):
        self.observation_space["observation"] = gym.spaces.Box(-1.0, 1.0, (3,), np.float64)


class Chooses(Drifts):
    def drift(self):
        self.action_space = gym.spaces.Discrete(3)


class Regroups(Drifts):
    """Has longer goals than it says, or both."""

    def observe(self):
        observation = super().observe()
        return {**observation, "desired_goal": np.zeros(3)} if steps > 400 else observation


class Lengthens(Drifts):
    def drift(self):
        self.observation_space["achieved_goal"] = gym.spaces.Box(-9.0, 9.0, (3,), np.float64)


class Unknown(Point):
    def misbehave(self):
        self.wind = float("nan")


class Dies(Point):
    """Crashes while a process that it has forked goes on."""

    def misbehave(self):
        print("dying now", file=sys.stderr, flush=True)
        if os.fork() == 0:
            time.sleep(1000)
        os.kill(os.getpid(), signal.SIGSEGV)


class Exits(Point):
    def misbehave(self):
        sys.exit("that was all")


class Hangs(Point):
    def misbehave(self):
        # Nothing else runs in this process meanwhile, as in an extension that hangs.
        ctypes.PyDLL(None).sleep(1000)


class Simulator(Point):
    """Has a process that close() ends, and two and a folder that go as its own process ends.

    Lists in a file who they are, and says there when it begins to hang.
    """

    def __init__(self, **how):
        super().__init__(**how)
        self.simulator = subprocess.Popen(["sleep", "1000"])
        fork = multiprocessing.get_context("fork")
        self.daemon = fork.Process(target=time.sleep, args=(1000,), daemon=True)
        self.daemon.start()
        self.folder = tempfile.TemporaryDirectory()
        helper = subprocess.Popen(["sleep", "1000"])
        self.note(os.getpid(), self.simulator.pid, self.daemon.pid, helper.pid, self.folder.name)

    def note(self, *words):
        with open("started", "a") as started:
            started.writelines(f"{word}\n" for word in words)

    def misbehave(self):
        self.note("hangs")
        time.sleep(1000)

    def close(self):
        # All of them together take longer than they have.
        time.sleep(0.5)
        self.note("closed")
        self.simulator.kill()


class Writes(Point):
    """Prints, reads the standard input, and has no terminal."""

    def __init__(self, **how):
        super().__init__(**how)
        assert os.getsid(0) == os.getpid(), "a session of its own"

    def step(self, action):
        print("stepping by", action, sys.stdin.read())
        return super().step(action)


class Pit(Point):
    """Ends an episode on the left."""

    def is_over(self):
        return bool(self.at[0] < -0.2 * SIDE)


class Imports(Point):
    """Has a speed that was drawn when its module was imported."""

    speed = np.random.uniform(0.1, 1.0)

    def step(self, action):
        return super().step(self.speed * action)


class Brief(Point):
    """Ends each episode with its first step."""

    def is_over(self):
        return True


class Still(Point):
    """Nothing moves."""

    def step(self, action):
        return self.observe(), 0.0, False, False, {}


class Freezes(Point):
    """No longer obeys, while the wind goes on."""

    def step(self, action):
        return super().step(action * (steps < AFTER))


class Tells(Point):
    """Has another idea of success than its goal radius."""

    def step(self, action):
        is_near = np.linalg.norm(self.at - self.goal) < 2 * RADIUS
        return (*super().step(action)[:4], {"is_success": np.array([is_near])})


class Global(Point):
    """Draws from numpy's random numbers for all."""

    def step(self, action):
        return super().step(action * np.random.uniform(0.5, 1.0))


class Elsewhere(Point):
    """Draws from random numbers that are no state of its own, and begin anew with no seed."""

    drawn = np.random.default_rng(1)

    def step(self, action):
        return super().step(action * self.drawn.uniform(0.5, 1.0))


class Shares(Point):
    """All environments of a process move one object."""

    def reset(self, seed=None, options=None):
        begun = super().reset(seed=seed)
        Shares.object = self.at
        return begun

    def step(self, action):
        self.at = Shares.object
        moved = super().step(action)
        Shares.object = self.at
        return moved


class Hidden(Point):
    """Keeps what matters late in an object."""

    def reset(self, seed=None, options=None):
        self.world = types.SimpleNamespace(steps=0)
        return super().reset(seed=seed)

    def step(self, action):
        self.world.steps += 1
        return super().step(action * (0.5 if self.world.steps > 25 else 1.0))


class Counts(Point):
    """Where it begins depends on how often it has begun."""

    def reset(self, seed=None, options=None):
        self.log = [*getattr(self, "log", []), seed]
        super().reset(seed=seed)
        self.at = self.at / (1 + len(self.log) % 2)
        return self.observe(), {}


class Cut(Point):
    """Truncates its episodes itself, and is not stepped any more then."""

    def reset(self, seed=None, options=None):
        self.left = 7
        return super().reset(seed=seed)

    def step(self, action):
        assert self.left > 0, "the episode is over"
        self.left -= 1
        observation, reward, terminated, _, info = super().step(action)
        return observation, reward, terminated, self.left == 0, info


class Tasks(Point):
    """Has its goal in `info` and three tasks, as OGBench has."""

    num_tasks = np.int64(3)
    _goal_tol = RADIUS

    def __init__(self, **how):
        super().__init__(**how)
        self.observation_space = gym.spaces.Box(-SIDE, SIDE, (3,), np.float64)

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        task = (options or {}).get("task_id", 1)
        self.at, self.goal = np.array([-4.0, -4.0]), np.array([4.0, 4.0 * (task - 2)])
        # A goal is a whole observation, as of its ants.
        return self.observed(), {"goal": np.concatenate([self.goal, [0.0]])}

    def observed(self):
        return np.concatenate([self.at, [self.wind]])

    def step(self, action):
        return (self.observed(), *super().step(action)[1:])


class Aimless(Tasks):
    """Its goals have no components."""

    def reset(self, seed=None, options=None):
        return super().reset(seed=seed, options=options)[0], {"goal": []}


class Maze(Tasks):
    """A maze of cells of two units, which says where its walls are, as OGBench's do."""

    maze_map = np.array([[0, 0, 0, 0, 0], [1, 1, 0, 1, 0], [0, 0, 0, 1, 0], [1] * 5, [0] * 5])

    def __init__(self, **how):
        super().__init__(**how)
        self._terminate_at_goal = True

    def ij_to_xy(self, cell):
        return 2.0 * cell[1] - 4.0, 4.0 - 2.0 * cell[0]

    def is_over(self):
        return self._terminate_at_goal and bool(np.linalg.norm(self.at - self.goal) <= RADIUS)


class FloatMaze(Maze):
    maze_map = Maze.maze_map.astype(float)


class BoolMaze(Maze):
    maze_map = Maze.maze_map.astype(bool)


class Moved(Maze):
    """Says where its walls are in another unit."""

    def ij_to_xy(self, cell):
        return [100 + place for place in super().ij_to_xy(cell)]


class Extra(Point):
    """Observes more than is read."""

    def __init__(self, **how):
        super().__init__(**how)
        self.observation_space["time"] = gym.spaces.Box(0, 1, (1,), np.float64)

    def observe(self):
        return {**super().observe(), "time": np.zeros(1)}


class Whole(Point):
    def __init__(self, **how):
        super().__init__(**how)
        self.action_space = gym.spaces.Box(-1, 1, (2,), np.int64)


class Empty(Point):
    def __init__(self, **how):
        super().__init__(**how)
        self.observation_space["observation"] = gym.spaces.Box(0, 1, (0,), np.float64)


class OldStep(Point):
    def step(self, action):
        return (*super().step(action)[:3], {})


class OldReset(Point):
    def reset(self):
        return super().reset()[0]


class NoInfo(Point):
    def reset(self, seed=None, options=None):
        return super().reset(seed=seed)[0]


class Discrete(Point):
    def __init__(self, **how):
        super().__init__(**how)
        self.action_space = gym.spaces.Discrete(4)


class Image(Point):
    def __init__(self, **how):
        super().__init__(**how)
        self.observation_space = gym.spaces.Box(0, 255, (8, 8, 3), np.uint8)

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros((8, 8, 3), np.uint8), {"goal": self.goal}


class Goalless(Point):
    def __init__(self, **how):
        super().__init__(**how)
        self.observation_space = gym.spaces.Box(-SIDE, SIDE, (2,), np.float64)

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        return self.at, {}


class Dense(Point):
    """Does not say when a goal is reached."""

    distance_threshold = None


class Zero(Dense):
    distance_threshold = 0.0


class Dawdles(Point):
    """Hangs in the processes that AWKWARD_SLOW counts, from 1 for the first one of a folder."""

    def __init__(self, **how):
        super().__init__(**how)
        global number
        if number is None:
            with open("processes", "a+") as processes:
                processes.write("1")
                number = processes.tell()

    def step(self, action):
        # Later than when it is opened, which takes 25 steps.
        if steps > 40 and str(number) in os.environ.get("AWKWARD_SLOW", "").split(","):
            time.sleep(1000)
        return super().step(action)


class Once(Point):
    """Raises late in an episode that it has had before."""

    def __init__(self, **how):
        super().__init__(**how)
        self.seeds, self.again, self.steps = set(), False, 0

    def reset(self, seed=None, options=None):
        self.again, self.steps = seed in self.seeds, 0
        self.seeds.add(seed)
        return super().reset(seed=seed)

    def step(self, action):
        self.steps += 1
        if self.again and self.steps == 30:
            raise ValueError("not again")
        return super().step(action)


class Slow(Point):
    def __init__(self, **how):
        super().__init__(**how)
        time.sleep(1000)


for kind in list(globals().values()):
    if isinstance(kind, type) and issubclass(kind, Point):
        gym.register(f"{kind.__name__}-v0", kind, max_episode_steps=LIMIT)
gym.register("Endless-v0", Point, max_episode_steps=sys.maxsize)
