"""Runs Gymnasium environments for gdg-tui. Needs only Python, numpy and gymnasium.

The program starts an interpreter with this file and exchanges frames with it over `channel`, a
socket of its own: standard output and error are the environments'. A frame is a kind and a length
in bytes, both u32, and that many bytes; all numbers are little-endian. Each request gets one reply:
OK with what was asked for, or FAILED with JSON that says why.
"""

import hashlib
import importlib
import json
import os
import pickle
import random
import select
import signal
import struct
import sys
import time
import traceback
import types

OK, FAILED = 0, 1
OPEN, MAKE, RESET, STEP, SAVE, RESTORE, REWARD, PICTURE = range(1, 9)

# Modules that register well-known environments, for IDs without a package.
KNOWN_PACKAGES = ("gymnasium_robotics", "ogbench")

# Most numbers of an observation, or of an array of a state: more are an image or the like.
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
    # If the program was started with it ignored, nothing would show how children end.
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
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
        # Seed and task of its episode.
        self.begun = None


class Goals:
    """Where an environment has its goals: in the observation, or in `info` as OGBench does."""

    def __init__(self, slot):
        space = slot.env.observation_space
        observation, info = reset(slot, 0)
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
    # Agents may go on beyond the time limit of the registration, as they have other goals: what
    # still is truncated, the environment itself ends.
    how["max_episode_steps"] = sys.maxsize
    env = gym.make(environment_id, disable_env_checker=True, **how)
    # OGBench's end at their own goal: agents have to see what is beyond.
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
            "is_wall": [[bool(cell == 1) for cell in row] for row in cells],
            "first": first.tolist(),
            "cell": [(right - first)[0], (below - first)[1]],
        }
    except Exception:  # It is no maze of a kind that is known.
        traceback.print_exc()
        return None


def reset(slot, seed, task=-1):
    """Begins an episode, of a task unless that is negative; all randomness follows from `seed`."""
    random.seed(seed)
    np.random.seed(seed)
    # OGBench draws actions from it.
    slot.env.unwrapped.action_space.seed(seed)
    slot.ended, slot.begun = False, (seed, task)
    try:
        begun = slot.env.reset(seed=seed, options=None if task < 0 else {"task_id": task})
    except TypeError as error:
        if "reset() got an unexpected keyword argument" in str(error):
            raise Unsupported(
                "its reset takes no seed or options, as in the old gym: change it to"
                " reset(self, *, seed=None, options=None) of Gymnasium"
            ) from error
        raise
    if not isinstance(begun, tuple) or len(begun) != 2:
        raise Unsupported(
            "its reset returns no info, as in the old gym: change it to return observation, info"
        )
    return begun


def step(slot, action):
    """Steps an environment and returns what it observes."""
    try:
        observation, _, terminated, truncated, _ = slot.env.step(action)
    except ValueError as error:  # Of wrappers, too.
        if "values to unpack (expected 5" not in str(error):
            raise
        raise Unsupported(
            "its step does not return five values, as in the old gym: change it to return"
            " observation, reward, terminated, truncated, info"
        ) from error
    slot.ended = bool(terminated or truncated)
    return observation


def objects(env):
    """Returns an environment, its wrappers and the environments in it: what has attributes."""
    found, rest = [], [env]
    while rest:
        item = rest.pop()
        if not any(item is other for other in found):
            found.append(item)
            inner = [value for _, value in sorted(vars(item).items())]
            rest += [value for value in inner if isinstance(value, gym.Env)]
    return found


def is_mujocos(value, name):
    return type(value).__name__ == name and type(value).__module__.startswith("mujoco.")


def describe(value):
    """Returns what a full state has of a value: what JSON can say, and an array; otherwise None."""
    kind, numbers = type(value), (bool, int, float)
    if value is None or kind in numbers:
        return ["number", value], None
    if kind is tuple and all(type(number) in numbers for number in value):
        return ["tuple", *value], None
    if isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind in "fiubcmM":
        if kind is np.ndarray and value.size <= MAX_NUMBERS:
            return ["array", value.dtype.str, *value.shape], value
        if isinstance(value, np.generic):
            return ["scalar", value.dtype.str], value
    if kind is np.random.Generator and type(value.bit_generator) is np.random.PCG64:
        return ["generator", value.bit_generator.state], None
    if is_mujocos(value, "MjData"):
        mujoco = importlib.import_module("mujoco")
        whole = mujoco.mjtState.mjSTATE_INTEGRATION
        numbers = np.empty(mujoco.mj_stateSize(value.model, whole))
        mujoco.mj_getState(value.model, value, numbers, whole)
        return ["mujoco", "<f8", len(numbers)], numbers
    return None


def numbers_of(slot):
    """Returns the attributes that are numbers: a line of JSON, and the arrays that it names."""
    head, arrays = [], []
    for i, item in enumerate(objects(slot.env)):
        for name, value in sorted(vars(item).items()):
            found = describe(value)
            if found is not None:
                head.append([i, name, *found[0]])
                arrays += [] if found[1] is None else [found[1].tobytes()]
    return json.dumps(head).encode() + b"\n" + b"".join(arrays)


def put(slot, body):
    """Gives an environment the attributes that `numbers_of` returned."""
    items, written = objects(slot.env), []
    head, arrays = body.split(b"\n", 1)
    for i, name, kind, *about in json.loads(head):
        own = vars(items[i])
        old = own.get(name)
        if kind == "number":
            # None takes no object's place: what renders has more of those.
            if about[0] is not None or describe(old) is not None:
                own[name] = about[0]
        elif kind == "tuple":
            own[name] = tuple(about)
        elif kind == "generator":
            if type(old) is not np.random.Generator:
                old = own[name] = np.random.Generator(np.random.PCG64())
            old.bit_generator.state = about[0]
        else:
            new = np.frombuffer(arrays, about[0], int(np.prod(about[1:])))
            new, arrays = new.reshape(about[1:]).copy(), arrays[new.nbytes :]
            if kind == "mujoco":
                mujoco = importlib.import_module("mujoco")
                whole = mujoco.mjtState.mjSTATE_INTEGRATION
                mujoco.mj_setState(old.model, old, new, whole)
                # Computes what follows from the state, and changes where the solver begins.
                mujoco.mj_forward(old.model, old)
                mujoco.mj_setState(old.model, old, new, whole)
            elif kind == "scalar":
                own[name] = new[()]
            elif (
                type(old) is np.ndarray
                and (old.dtype, old.shape, old.flags.writeable) == (new.dtype, new.shape, True)
                # One array of two attributes may have become two.
                and not any(old is other for other in written)
            ):
                # In place: others may look at it.
                old[...] = new
                written.append(old)
            else:
                own[name] = new


class Digest(pickle.Pickler):
    """Digests what it is given. The pickle itself is not kept, and nothing is ever unpickled."""

    def __init__(self, known):
        self.hash = hashlib.blake2b(digest_size=8)
        self.known = {id(value): i for i, value in enumerate(known)}
        super().__init__(types.SimpleNamespace(write=self.hash.update), 5)

    def persistent_id(self, value):
        """Returns what stands for a value: its contents count elsewhere, or not at all."""
        if id(value) in self.known:
            return f"known {self.known[id(value)]}"
        if isinstance(value, (type, types.ModuleType)):
            return f"{getattr(value, '__module__', '')}.{value.__name__}"
        if isinstance(value, (set, frozenset)):
            # In an order that is the same in every process.
            return f"set {sorted(map(repr, value))}"
        if type(value).__name__.startswith("Mjv"):
            return "what MuJoCo shows"
        return None

    def reducer_override(self, value):
        if isinstance(value, types.FunctionType):
            kept = [cell.cell_contents for cell in value.__closure__ or ()]
            return tuple, ([value.__module__, value.__qualname__] + kept,)
        if is_mujocos(value, "MjModel"):
            # Without what it only looks like, which may be large.
            names = [name for name in dir(value) if not name.startswith(("_", "tex_", "mesh_"))]
            arrays = [(name, getattr(value, name)) for name in names]
            return tuple, ([pair for pair in arrays if isinstance(pair[1], np.ndarray)],)
        return NotImplemented


def digests(slot):
    """Returns digests of all attributes that are not numbers, by name."""
    items, found = objects(slot.env), {}
    values = [value for item in items for _, value in sorted(vars(item).items())]
    datas = [value for value in values if is_mujocos(value, "MjData")]
    for i, item in enumerate(items):
        for name, value in vars(item).items():
            if describe(value) is None:
                digest = Digest(items + datas)
                try:
                    digest.dump(value)
                except Exception as error:
                    raise Unsupported(
                        f"its attribute {name} cannot be compared with what it is later: {error}"
                    ) from error
                found[f"{i} {name}"] = digest.hash.hexdigest()
    return found


def save(slot):
    """Returns the full state of an environment as bytes.

    That is how its episode began, digests of its attributes that are no numbers, each with that in
    the trial of this process, and those that are numbers.
    """
    others = {name: [digest, trial.get(name)] for name, digest in digests(slot).items()}
    return struct.pack("<Ii", *slot.begun) + json.dumps(others).encode() + b"\n" + numbers_of(slot)


def restore(slot, state):
    """Puts an environment into the full state that `save` returned.

    What is no number has to come back by beginning the same episode. What differs from process to
    process, such as the name of a temporary file, also differs in the trials.
    """
    reset(slot, *struct.unpack("<Ii", state[:8]))
    others, numbers = state[8:].split(b"\n", 1)
    put(slot, numbers)
    now = digests(slot)
    changed = [
        name
        for name, (digest, tried) in json.loads(others).items()
        if tried == trial.get(name) and digest != now.get(name)
    ]
    if changed or numbers_of(slot) != numbers:
        names = ", ".join(name.split()[-1] for name in changed)
        why = f"attributes that are no numbers change: {names}" if changed else "it has changed"
        raise Unsupported(why)


def try_states():
    """Finds out by trying whether full states bring back exactly what follows.

    Returns whether that is so of what is observed, and of all that is known of the environment.
    """

    def walk():
        rows = []
        for action in actions:
            if slot.ended:
                break
            row = np.empty(goals.observed + goals.achieved, dtype=np.float64)
            goals.write(step(slot, action.copy()), row)
            rows.append(row)
        return np.array(rows)

    global trial
    used = lambda: (random.getstate(), str(np.random.get_state(legacy=False)))
    slot = slots[0]
    try:
        space = slot.env.action_space
        low, high = filled_bounds(space)
        draws = np.random.default_rng(0).random((TRIAL_STEPS, len(low)))
        actions = (low + draws * (high - low)).astype(space.dtype)
        reset(slot, 1)
        before = used()
        step(slot, actions[0])
        state = save(slot)
        first = walk()
        # Other random numbers than the environment's own are no part of its state.
        own_randomness = used() == before
        reset(slot, 2)
        try:
            restore(slot, state)
            is_whole = True
        except Unsupported as why:
            print(f"agents will begin new episodes on resuming: {why}")
            is_whole = False
        # Only now, so that all attributes were compared.
        trial = {name: own for name, (own, _) in json.loads(state[8:].split(b"\n", 1)[0]).items()}
        is_same = own_randomness and np.array_equal(first, walk())
        return is_same, is_same and is_whole
    except Exception as error:  # Whatever it is, states cannot be saved.
        print(f"its states cannot be saved: {said(error)}")
        return False, False


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
    if actions.dtype.kind != "f":
        raise Unsupported(
            f"its actions are whole numbers, {actions}: only continuous ones (a Box of floats)"
            " are supported"
        )
    goals = Goals(slot)
    own = slot.env.unwrapped
    radius = getattr(own, "distance_threshold", getattr(own, "_goal_tol", None))
    says_radius = isinstance(radius, (int, float, np.number)) and 0 < radius < float("inf")
    tasks = getattr(own, "num_tasks", None) if not goals.in_observation else None
    limit = gym.spec(slot.env.spec.id).max_episode_steps
    is_same, is_whole = try_states()
    return {
        "observed": goals.observed,
        "achieved": goals.achieved,
        "goal": goals.goal,
        "low": bounds(actions.low),
        "high": bounds(actions.high),
        "time_limit": None if limit is None else int(limit),
        "tasks": tasks,
        "goal_radius": float(radius) if says_radius else None,
        "has_reward": hasattr(own, "compute_reward"),
        "maze": find_maze(own),
        "restorable": is_whole,
        # Pictures are of another environment in the same state.
        "renders": is_same and "rgb_array" in (slot.env.metadata or {}).get("render_modes", ()),
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
            goals.write(step(slot, action.astype(space.dtype)), rows[i])
            slot.last = rows[i]
        else:
            rows[i] = slot.last
        ended[i] = slot.ended
    return rows.tobytes() + bytes(ended)


def reset_one(body):
    index, seed, task = struct.unpack("<IIi", body)
    slot = slots[index]
    observation, info = reset(slot, seed, task)
    row = np.empty(goals.observed + goals.achieved, dtype="<f4")
    goals.write(observation, row)
    slot.last = row
    return row.tobytes() + goals.desired(observation, info).astype("<f4").tobytes()


def attempted(act):
    """Returns what `act` does, or why it cannot be done: states that are lost end no run."""
    try:
        return b"\1" + act()
    except BaseException as error:  # Also what would end this process.
        traceback.print_exc()
        return b"\0" + said(error)[:MAX_TEXT].encode()


def save_all(body):
    count, most = struct.unpack("<II", body)
    states = [save(slot) for slot in slots[:count]]
    if sum(map(len, states)) > most:
        raise Unsupported(f"its states have more than {most >> 20} MiB")
    return b"".join(struct.pack("<I", len(state)) + state for state in states)


def restore_one(body):
    restore(slots[struct.unpack("<I", body[:4])[0]], body[4:])
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
    try:
        rewards = [float(np.asarray(own.compute_reward(a, d, {}))) for a, d in zip(achieved, desired)]
    except Exception as error:
        traceback.print_exc()
        raise Unsupported(
            f"its compute_reward does not say when a goal is reached: give --goal-radius; it"
            f" raised {said(error)}"
        ) from error
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
            renderer = Slot(render_mode="rgb_array")
        if renderer.begun != slots[index].begun:
            reset(renderer, *slots[index].begun)
        put(renderer, numbers_of(slots[index]))
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
        text = said(error)[-1000:]
        if "GL" in text and "MUJOCO_GL" not in os.environ:
            text = f"MUJOCO_GL=egl or osmesa may help without a display; {text}"
        return struct.pack("<II", 0, 0) + text.encode()


def safe(text):
    """Returns a text without halves of characters, as names of files have them: UTF-8 has none."""
    return text.encode(errors="replace").decode()


def said(error):
    """Returns what an exception says."""
    if isinstance(error, Unsupported):
        return safe(str(error))
    return safe("".join(traceback.format_exception_only(type(error), error)).strip())


def why(error):
    """Describes an exception: what it is, and the last places outside this file."""
    text = said(error)
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
            "error": text,
            "places": [safe(place) for place in places[-4:]],
            "searched": [safe(folder or os.getcwd()) for folder in sys.path],
        }
    ).encode()


def serve():
    handlers = {
        OPEN: lambda body: json.dumps(open_environment(json.loads(body))).encode(),
        MAKE: make_all,
        RESET: reset_one,
        STEP: step_all,
        SAVE: lambda body: attempted(lambda: save_all(body)),
        RESTORE: lambda body: attempted(lambda: restore_one(body)),
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
# Digests of what is no number, in the trial of this process.
trial = {}
begin()
worker = os.getpid()
try:
    serve()
except OSError:  # The program has ended, or this is a process that the environment has forked.
    pass
if os.getpid() != worker:
    os._exit(1)
close_all()
