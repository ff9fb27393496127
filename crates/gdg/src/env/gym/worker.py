"""Runs Gymnasium environments for gdg-tui. Needs only Python, numpy and gymnasium.

The program starts an interpreter with this file and exchanges frames with it over `channel`, a
socket of its own: standard output and error are the environments'. A frame is a kind and a length
in bytes, both u32, and that many bytes; all numbers are little-endian. Each request gets one reply:
OK with what was asked for, or FAILED with JSON that says why.
"""

import importlib
import json
import os
import random
import select
import signal
import struct
import sys
import time
import traceback

OK, FAILED = 0, 1
OPEN, MAKE, RESET, STEP, SAVE, RESTORE, REWARD, PICTURE = range(1, 9)

# Modules that register well-known environments, for IDs without a package.
KNOWN_PACKAGES = ("gymnasium_robotics", "ogbench")

# Most numbers of a state: an observation with more is an image or the like.
MAX_NUMBERS = 4096

# Most characters of an exception that are told.
MAX_TEXT = 4000

# Steps taken twice from the same full state, to find out whether it is one.
TRIAL_STEPS = 12

# Bounds of actions beyond this are none.
LARGEST_BOUND = 1e9

# How long an environment may go on once the program has ended, or has given it up.
CLOSING_SECONDS = 0.5


class Unsupported(Exception):
    """The environment is not one that the program can use."""


def begin():
    """Leaves the terminal, and keeps the channel from processes that environments fork."""
    os.setsid()
    be_watched_over()
    nothing = os.open(os.devnull, os.O_RDWR)
    cut = lambda: os.dup2(nothing, channel.fileno(), inheritable=False)
    os.register_at_fork(after_in_child=cut)


def be_watched_over():
    """Starts a process that ends this one, and all that it has started, once the program has ended
    or has given it up, however that was.

    Nothing else runs there: whatever hangs or crashes here does not keep it from that. It is no
    child of this process, as an environment may wait for its children, or end them.
    """
    worker = os.getpid()
    child = os.fork()
    if child:
        os.waitpid(child, 0)
        return
    os.setsid()
    if os.fork():
        os._exit(0)
    for output in (1, 2):
        os.dup2(0, output)
    hang_up = select.poll()
    hang_up.register(channel.fileno(), 0)
    hang_up.poll()
    try:
        began = time.monotonic()
        while time.monotonic() - began < CLOSING_SECONDS:
            os.kill(worker, 0)
            time.sleep(0.01)
    except OSError:  # It has ended by itself.
        pass
    try:
        os.killpg(worker, signal.SIGKILL)
    except OSError:  # Nothing is left.
        pass
    os._exit(0)


def close_all():
    """Has the environments end what they have started."""
    for slot in slots + [renderer]:
        try:
            if slot is not None:
                slot.env.close()
        except BaseException:  # The others are closed too.
            traceback.print_exc()


def flat_numbers(space, what):
    """Returns the length of a one-dimensional Box."""
    if not isinstance(space, gym.spaces.Box):
        raise Unsupported(f"{what} {space}: only vectors of numbers (Box) are supported")
    if len(space.shape) != 1 or space.dtype.kind not in "fiu":
        kind = "images" if len(space.shape) == 3 else f"arrays of shape {space.shape}"
        raise Unsupported(f"{what} {kind}: only vectors of numbers are supported")
    if space.shape[0] > MAX_NUMBERS:
        raise Unsupported(f"{what} {space.shape[0]} numbers: at most {MAX_NUMBERS} are supported")
    return space.shape[0]


class Slot:
    """One environment, and what is known of its state."""

    def __init__(self, **how):
        self.env = make(**how)
        self.ended = False
        self.layout = None


class Goals:
    """Where an environment has its goals: in the observation, or in `info` as OGBench does."""

    def __init__(self, slot):
        space = slot.env.observation_space
        observation, info = reset(slot, 0, None)
        self.in_observation = isinstance(space, gym.spaces.Dict) and {
            "observation",
            "achieved_goal",
            "desired_goal",
        } <= set(space.spaces)
        if self.in_observation:
            self.observed = flat_numbers(space["observation"], "its observations are")
            self.achieved = flat_numbers(space["achieved_goal"], "its goals are")
            self.goal = flat_numbers(space["desired_goal"], "its goals are")
            if self.goal != self.achieved:
                raise Unsupported("its achieved and desired goals differ in length")
        elif isinstance(info, dict) and "goal" in info:
            self.observed, self.achieved = flat_numbers(space, "its observations are"), 0
            self.goal = int(np.asarray(info["goal"]).size)
        else:
            raise Unsupported(
                "it has no goals: its observations need observation, achieved_goal and"
                f" desired_goal, or its info a goal, as in OGBench; they are {space}"
            )

    def write(self, observation, row):
        """Writes an observation, followed by the achieved goal if it is apart, to `row`."""
        if self.in_observation:
            row[: self.observed] = vector(observation["observation"], self.observed, "observation")
            row[self.observed :] = vector(observation["achieved_goal"], self.goal, "achieved goal")
        else:
            row[:] = vector(observation, self.observed, "observation")

    def desired(self, observation, info):
        if self.in_observation:
            return vector(observation["desired_goal"], self.goal, "desired goal")
        return vector(np.reshape(info["goal"], -1), self.goal, "goal")


def vector(numbers, length, what):
    """Returns numbers of an environment as an array, unless there are more or fewer than it has said.

    Assigning them would repeat a single one as often as needed.
    """
    numbers = np.asarray(numbers)
    if numbers.shape != (length,) or numbers.dtype.kind not in "fiub":
        shown = f"shape {numbers.shape} of {numbers.dtype}"
        raise ValueError(f"its {what} has {shown}, but its spaces say {length} numbers")
    return numbers


def make(**how):
    env = gym.make(environment_id, disable_env_checker=True, **how)
    # OGBench's end at their own goal, but agents also have others: they have to see what is beyond.
    if hasattr(env.unwrapped, "_terminate_at_goal"):
        env.unwrapped._terminate_at_goal = False
    return env


def find_maze(own):
    """Returns which cells of an environment's maze are walls, and where cells are, if it has one.

    Gymnasium-Robotics has its maze in `maze`, OGBench in the environment.
    """
    maze = getattr(own, "maze", own)
    cells = getattr(maze, "maze_map", None)
    place = getattr(maze, "cell_rowcol_to_xy", getattr(maze, "ij_to_xy", None))
    if cells is None or place is None:
        return None
    try:
        at = lambda *cell: np.asarray(place(np.array(cell)), dtype=np.float64)
        first, right, below = at(0, 0), at(0, 1), at(1, 0)
        return {
            "is_wall": [[str(cell) == "1" for cell in row] for row in cells],
            "first": first.tolist(),
            "cell": [(right - first)[0], (below - first)[1]],
        }
    except Exception:  # It is no maze of a kind that is known.
        traceback.print_exc()
        return None


def reset(slot, seed, task):
    """Begins an episode; everything random in it follows from `seed`."""
    random.seed(seed)
    np.random.seed(seed)
    slot.ended = False
    options = None if task is None else {"task_id": task}
    begun = slot.env.reset(seed=seed, options=options)
    if slot.layout is None:
        slot.layout = find_layout(slot.env)
    return begun


def objects(env):
    """Returns the environment and those in it that may have a state of their own."""
    own = env.unwrapped
    inner = [value for value in vars(own).values() if isinstance(value, gym.Env)]
    return [own] + inner


def pcg64(generator):
    """Returns a generator's state as numbers of 32 bits, if it is numpy's usual one."""
    state = generator.bit_generator.state
    if state["bit_generator"] != "PCG64":
        raise Unsupported("random numbers of an unusual kind")
    words = [
        state["state"][name] >> shift & 0xFFFFFFFF
        for name in ("state", "inc")
        for shift in range(0, 128, 32)
    ]
    return words + [state["has_uint32"], state["uinteger"]]


def set_pcg64(generator, words):
    words = [int(word) for word in words]
    whole = lambda part: sum(word << 32 * i for i, word in enumerate(part))
    generator.bit_generator.state = {
        "bit_generator": "PCG64",
        "state": {"state": whole(words[:4]), "inc": whole(words[4:8])},
        "has_uint32": words[8],
        "uinteger": words[9],
    }


def find_layout(env):
    """Returns the parts of an environment's full state: MuJoCo's, random numbers, attributes."""
    parts = []
    for item in objects(env):
        model, data = getattr(item, "model", None), getattr(item, "data", None)
        if type(model).__name__ == "MjModel" and not any(part[1] is data for part in parts):
            parts.append(("mujoco", data, model))
        if getattr(item, "_np_random", None) is not None:
            parts.append(("random", item, None))
        for name, value in sorted(vars(item).items()):
            if isinstance(value, (bool, int, float)):
                parts.append(("number", item, name))
            elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
                if value.size <= MAX_NUMBERS:
                    parts.append(("array", item, name))
            elif isinstance(value, tuple) and all(isinstance(v, (int, float)) for v in value):
                parts.append(("tuple", item, name))
    return parts


def save(slot):
    """Returns the full state of an environment as numbers."""
    numbers = []
    for kind, item, name in slot.layout:
        if kind == "mujoco":
            mujoco = importlib.import_module("mujoco")
            whole = mujoco.mjtState.mjSTATE_INTEGRATION
            state = np.empty(mujoco.mj_stateSize(name, whole))
            mujoco.mj_getState(name, item, state, whole)
            numbers.append(state)
        elif kind == "random":
            numbers.append(np.array(pcg64(item.np_random), dtype=np.float64))
        else:
            numbers.append(np.asarray(vars(item)[name], dtype=np.float64).reshape(-1))
    return np.concatenate(numbers) if numbers else np.empty(0)


def restore(slot, numbers):
    """Puts an environment into the full state that `save` returned."""
    rest = numbers

    def take(count):
        nonlocal rest
        if len(rest) < count:
            raise Unsupported("its stored state is of another version of the environment")
        part, rest = rest[:count], rest[count:]
        return part

    for kind, item, name in slot.layout:
        if kind == "mujoco":
            mujoco = importlib.import_module("mujoco")
            whole = mujoco.mjtState.mjSTATE_INTEGRATION
            # MuJoCo takes no array that is read-only.
            state = take(mujoco.mj_stateSize(name, whole)).copy()
            mujoco.mj_setState(name, item, state, whole)
            # Computes what follows from the state, and changes where the solver begins.
            mujoco.mj_forward(name, item)
            mujoco.mj_setState(name, item, state, whole)
        elif kind == "random":
            set_pcg64(item.np_random, take(10))
        elif kind == "number":
            setattr(item, name, type(vars(item)[name])(take(1)[0]))
        elif kind == "tuple":
            setattr(item, name, tuple(take(len(vars(item)[name])).tolist()))
        else:
            value = vars(item)[name]
            value[...] = take(value.size).reshape(value.shape)
    if len(rest):
        raise Unsupported("its stored state is of another version of the environment")
    slot.ended = False


def is_restorable(slot):
    """Finds out by trying whether full states bring back exactly what follows."""

    def walk():
        rows = []
        for action in actions:
            observation, _, terminated, _, _ = slot.env.step(action.copy())
            row = np.empty(goals.observed + goals.achieved, dtype=np.float64)
            goals.write(observation, row)
            rows.append(row)
            if terminated:
                break
        return np.array(rows)

    used = lambda: (random.getstate(), str(np.random.get_state(legacy=False)))
    try:
        space = slot.env.action_space
        low, high = filled_bounds(space)
        draws = np.random.default_rng(0).random((TRIAL_STEPS, len(low)))
        actions = (low + draws * (high - low)).astype(space.dtype)
        reset(slot, 1, None)
        before = used()
        slot.env.step(actions[0])
        state = save(slot)
        first = walk()
        # Other random numbers than the environment's own are no part of its state.
        own_randomness = used() == before
        reset(slot, 2, None)
        restore(slot, state)
        is_same = np.array_equal(first, walk())
        return is_same and own_randomness and bool(np.isfinite(state).all())
    except Exception:  # Whatever it is, states cannot be saved.
        traceback.print_exc()
        return False


def bounds(values):
    """Returns bounds of actions, None where there is none. Some spaces write it as the largest number."""
    return [float(v) if abs(v) <= LARGEST_BOUND else None for v in values]


def filled_bounds(space):
    """Returns lowest and highest actions. Without a bound, a range is as long as [-1, 1], or that."""
    pairs = []
    for low, high in zip(bounds(space.low), bounds(space.high)):
        if low is None:
            low = -1.0 if high is None else high - 2.0
        pairs.append((low, low + 2.0 if high is None else max(low, high)))
    return np.array(pairs).T


def open_environment(config):
    """Imports what is needed, makes the first environment and returns its description."""
    global gym, np, environment_id, goals, actions_length
    # Also for the interpreters that packages start when they are imported, as glfw does.
    is_safe = "PYTHONSAFEPATH" in os.environ
    os.environ["PYTHONSAFEPATH"] = "1"
    np = importlib.import_module("numpy")
    gym = importlib.import_module("gymnasium")
    environment_id = config["id"]
    if config["package"]:
        # Last: files in the present folder are to take the place of nothing else.
        sys.path.append("")
        importlib.import_module(config["package"])
    elif environment_id not in gym.registry:
        for package in KNOWN_PACKAGES:
            try:
                importlib.import_module(package)
            except ImportError:
                pass
    entry = getattr(gym.registry.get(environment_id), "entry_point", None)
    if isinstance(entry, str):
        importlib.import_module(entry.split(":")[0])
    if not is_safe:
        del os.environ["PYTHONSAFEPATH"]
    slot = Slot()
    slots.append(slot)
    actions = slot.env.action_space
    if not isinstance(actions, gym.spaces.Box):
        raise Unsupported(f"its actions are {actions}: only continuous ones (Box) are supported")
    actions_length = flat_numbers(actions, "its actions are")
    goals = Goals(slot)
    own = slot.env.unwrapped
    radius = getattr(own, "distance_threshold", getattr(own, "_goal_tol", None))
    tasks = getattr(own, "num_tasks", None) if not goals.in_observation else None
    return {
        "observed": goals.observed,
        "achieved": goals.achieved,
        "goal": goals.goal,
        "low": bounds(actions.low),
        "high": bounds(actions.high),
        "time_limit": slot.env.spec.max_episode_steps,
        "tasks": tasks,
        "goal_radius": float(radius) if isinstance(radius, (int, float, np.number)) else None,
        "has_reward": hasattr(own, "compute_reward"),
        "maze": find_maze(own),
        "restorable": is_restorable(slot),
        "renders": "rgb_array" in (slot.env.metadata or {}).get("render_modes", ()),
        "versions": versions(config["package"]),
    }


def versions(package):
    found = {"python": sys.version.split()[0]}
    for name in ("gymnasium", "numpy", "mujoco", package.split(".")[0]) + KNOWN_PACKAGES:
        version = getattr(sys.modules.get(name), "__version__", None)
        if isinstance(version, str):
            found[name] = version
    return found


def step_all(body):
    """Steps the first environments, one per row of actions; returns rows and who has ended."""
    space = slots[0].env.action_space
    actions = np.frombuffer(body, dtype="<f4").reshape(-1, actions_length)
    rows = np.zeros((len(actions), goals.observed + goals.achieved), dtype="<f4")
    ended = bytearray(len(actions))
    for i, (slot, action) in enumerate(zip(slots, actions)):
        # Not a number is the action of those that rest.
        if not slot.ended and action[0] == action[0]:
            observation, _, slot.ended, _, _ = slot.env.step(action.astype(space.dtype))
            goals.write(observation, rows[i])
            slot.last = rows[i]
        else:
            rows[i] = slot.last
        ended[i] = bool(slot.ended)
    return rows.tobytes() + bytes(ended)


def reset_one(body):
    index, seed, task = struct.unpack("<IIi", body)
    slot = slots[index]
    observation, info = reset(slot, seed, None if task < 0 else task)
    row = np.empty(goals.observed + goals.achieved, dtype="<f4")
    goals.write(observation, row)
    slot.last = row
    return row.tobytes() + goals.desired(observation, info).astype("<f4").tobytes()


def save_all(body):
    (count,) = struct.unpack("<I", body)
    return np.array([save(slot) for slot in slots[:count]], dtype="<f8").tobytes()


def restore_one(body):
    (index,) = struct.unpack("<I", body[:4])
    slot = slots[index]
    if slot.layout is None:
        reset(slot, 0, None)
    restore(slot, np.frombuffer(body[4:], dtype="<f8"))
    return b""


def make_all(body):
    (count,) = struct.unpack("<I", body)
    while len(slots) < count:
        slots.append(Slot())
    return b""


def reward(body):
    """Returns the reward for pairs of achieved and desired goals."""
    achieved, desired = np.frombuffer(body, dtype="<f8").reshape(2, -1, goals.goal)
    own = slots[0].env.unwrapped
    rewards = [float(np.asarray(own.compute_reward(a, d, {}))) for a, d in zip(achieved, desired)]
    return np.array(rewards, dtype="<f8").tobytes()


def show_goal(own, goal):
    """Moves what marks the goal in pictures, as Gymnasium-Robotics and OGBench have it."""
    if isinstance(getattr(own, "goal", None), np.ndarray) and own.goal.shape == goal.shape:
        own.goal = goal.astype(own.goal.dtype)
        if hasattr(own, "update_target_site_pos"):
            own.update_target_site_pos()
    elif hasattr(own, "cur_goal_xy"):
        own.set_goal(goal_xy=goal[:2])


def picture(body):
    """Returns a picture of an environment, or why there is none: width 0, height 0 and a text.

    Another environment, which renders, is put into its state, so that the others need no window.
    """
    global renderer
    index, width, height = struct.unpack("<III", body[:12])
    try:
        if renderer is None:
            made = Slot(render_mode="rgb_array")
            reset(made, 0, None)
            renderer = made
        restore(renderer, save(slots[index]))
        show_goal(renderer.env.unwrapped, np.frombuffer(body[12:], dtype="<f4"))
        whole = np.asarray(renderer.env.render())
        if whole.ndim != 3 or whole.shape[2] != 3 or whole.dtype != np.uint8:
            raise ValueError(f"an array of shape {whole.shape} of {whole.dtype} is no RGB picture")
        # Each pixel is the mean of a square.
        side = max(1, -(-whole.shape[1] // width), -(-whole.shape[0] // height))
        side = min(side, *whole.shape[:2])
        rows, columns = whole.shape[0] // side, whole.shape[1] // side
        squares = whole[: rows * side, : columns * side].reshape(rows, side, columns, side, 3)
        pixels = squares.mean(axis=(1, 3)).astype(np.uint8).tobytes()
        return struct.pack("<II", columns, rows) + pixels
    except Exception as error:  # Nothing else depends on a picture.
        text = "".join(traceback.format_exception_only(type(error), error)).strip()[-1000:]
        if "GL" in text and "MUJOCO_GL" not in os.environ:
            text = f"MUJOCO_GL=egl or osmesa may help without a display; {text}"
        return struct.pack("<II", 0, 0) + safe(text).encode()


def safe(text):
    """Returns a text without halves of characters, as names of files have them: UTF-8 has none."""
    return text.encode(errors="replace").decode()


def why(error):
    """Describes an exception: what it is, and the last places outside this file."""
    lines = traceback.format_exception_only(type(error), error)
    text = str(error) if isinstance(error, Unsupported) else "".join(lines).strip()
    if len(text) > MAX_TEXT:
        text = text[: MAX_TEXT // 2] + " ... " + text[-MAX_TEXT // 2 :]
    places = [
        f"{place.filename}, line {place.lineno}, in {place.name}"
        for place in traceback.extract_tb(error.__traceback__)
        if place.filename != "<worker>" and "importlib" not in place.filename
    ]
    return json.dumps(
        {
            "unsupported": isinstance(error, Unsupported),
            "missing": error.name if isinstance(error, ModuleNotFoundError) else None,
            "error": safe(text),
            "places": [safe(place) for place in places[-4:]],
        }
    ).encode()


def serve():
    handlers = {
        OPEN: lambda body: json.dumps(open_environment(json.loads(body))).encode(),
        MAKE: make_all,
        RESET: reset_one,
        STEP: step_all,
        SAVE: save_all,
        RESTORE: restore_one,
        REWARD: reward,
        PICTURE: picture,
    }
    while header := stream.read(8):
        kind, length = struct.unpack("<II", header)
        body = stream.read(length)
        try:
            reply = (OK, handlers[kind](body))
        except BaseException as error:  # Also what would end this process.
            reply = (FAILED, why(error))
        channel.sendall(struct.pack("<II", reply[0], len(reply[1])) + reply[1])


slots = []
renderer = None
begin()
worker = os.getpid()
try:
    serve()
except OSError:  # The program has ended, or this is a process that the environment has forked.
    pass
if os.getpid() != worker:
    os._exit(1)
close_all()
