"""Runs Gymnasium environments for gdg-tui. Needs only Python, numpy and gymnasium.

The program starts an interpreter with this file and exchanges messages with it over `channel`, a
socket of its own: standard output and error are the environments'. A message is a kind and a length
in bytes, both u32, and that many bytes: f64 numbers, unless stated otherwise, all little-endian.
Each request gets one reply: OK with what was asked for, or FAILED with JSON that says why.
"""

import atexit
import importlib
import json
import os
import random
import re
import select
import signal
import struct
import sys
import threading
import time
import traceback
import zlib

OK, FAILED = 0, 1
OPEN, MAKE, RESET, STEP = range(1, 5)

# Modules that register well-known environments, for IDs without a package.
KNOWN_PACKAGES = ("gymnasium_robotics", "ogbench")

# Of observations with goals.
PARTS = "observation", "achieved_goal", "desired_goal"

# Most numbers of an observation: more are an image or the like.
MAX_NUMBERS = 4096

# Most characters of an exception that are told.
MAX_TEXT = 4000

# Bounds of actions beyond this are none.
LARGEST_BOUND = 1e9
# Steps of a process in which it is found out whether they draw from the shared generators.
FIRST_STEPS = 400

# What is installed below a folder is no part of an environment there: with it, a virtual environment.
INSTALLED = re.compile("(^|/)((site|dist)-packages|lib/python3[^/]*)/")

# Most files of an environment that are compared, and most bytes of them that are read for that.
MOST_FILES, MOST_READ = 1000, 64 << 20

# When Gymnasium-Robotics' mazes count a goal as reached: the number is within their code.
MAZE_RADIUS = 0.45

# How long an environment may go on once the program has ended, or has given it up.
CLOSING_SECONDS = 0.5

# How long environments are closed one after another.
PATIENCE_SECONDS = 0.2


class Unsupported(Exception):
    """The environment is not one that the program can use."""


def begin():
    """Leaves the terminal, and keeps the channel from processes that environments fork."""
    # They are for lists of processes; packages may read the command line.
    del sys.argv[1:]
    os.setsid()
    threading.Thread(target=watch, daemon=True).start()
    # At the very end, what environments have started and not ended.
    atexit.register(lambda: os.getpid() == worker and os.killpg(0, signal.SIGKILL))
    nothing = os.open(os.devnull, os.O_RDWR)
    cut = lambda: os.dup2(nothing, channel.fileno(), inheritable=False)
    os.register_at_fork(after_in_child=cut)
    # Batch systems send these to all processes of a job: the program saves the run, and ends this one. What
    # environments start ends by them as usual: programs inherit no handlers, and forks get the usual ones.
    ending = signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2, signal.SIGXCPU
    outlive = lambda *_: None
    usual = {number: signal.signal(number, outlive) for number in ending}
    own = lambda: (pair for pair in usual.items() if signal.getsignal(pair[0]) is outlive)
    os.register_at_fork(after_in_child=lambda: [signal.signal(*pair) for pair in own()])


def watch():
    """Ends this process, and all of its group that it has started, half a second after the program
    has ended or has given it up, however that was."""
    hang_up = select.poll()
    hang_up.register(channel.fileno(), 0)
    hang_up.poll()
    time.sleep(CLOSING_SECONDS)
    os.killpg(0, signal.SIGKILL)


def close_all():
    """Has the environments end what they have started, all at once where that takes long."""
    left = iter(slots)

    def close():
        for slot in left:
            try:
                slot.env.close()
            except BaseException:  # The others are closed too.
                traceback.print_exc()

    hurry = lambda: [threading.Thread(target=close).start() for _ in slots]
    timer = threading.Timer(PATIENCE_SECONDS, hurry)
    try:
        timer.start()
    finally:
        close()
        timer.cancel()


def supported(number, what):
    """Returns a number of numbers, unless there are none or too many."""
    if number > MAX_NUMBERS:
        raise Unsupported(f"{what} {number} numbers: at most {MAX_NUMBERS} are supported")
    if number == 0:
        raise Unsupported(f"{what} no numbers at all: at least one is needed")
    return number


def flat_numbers(space, what):
    """Returns the length of a one-dimensional Box."""
    if not isinstance(space, gym.spaces.Box):
        raise Unsupported(f"{what} {space}: only vectors of numbers (Box) are supported")
    if len(space.shape) != 1 or space.dtype.kind not in "fiu":
        kind = "images" if len(space.shape) == 3 else f"arrays of shape {space.shape}"
        raise Unsupported(f"{what} {kind}: only vectors of numbers are supported")
    return supported(space.shape[0], what)


class Slot:
    """One environment, whether its episode has ended, and what was observed last.

    Those in one process share the generators of `random` and `np.random`. Where steps draw from them, each environment
    has states of its own, so that the others change nothing.
    """

    draws, steps = False, 0

    def __init__(self):
        self.env = make()
        self.ended = self.moves_goal = False
        self.told, self.last, self.generators = 0, None, None

    def row(self):
        """Returns what is observed, followed by the achieved goal if it is apart, and 1 at the end; 2 more
        where the desired goal has moved within an episode, 4 where the environment says whether it is
        reached, and 8 where it is."""
        return np.append(self.last, self.ended + 2 * self.moves_goal + self.told)


class Goals:
    """Where an environment has its goals: in the observation, or in `info` as OGBench does."""

    def __init__(self, slot):
        observation, info = reset(slot, 0)
        space = slot.env.observation_space
        self.in_observation = isinstance(space, gym.spaces.Dict) and set(PARTS) <= set(space.spaces)
        self.start, self.left_out = observation, []
        if self.in_observation:
            self.start, self.left_out = observation["achieved_goal"], sorted(set(space.spaces) - set(PARTS))
            self.observed = flat_numbers(space["observation"], "its observations are")
            self.achieved = flat_numbers(space["achieved_goal"], "its goals are")
            self.goal = flat_numbers(space["desired_goal"], "its goals are")
            if self.goal != self.achieved:
                raise Unsupported("its achieved and desired goals differ in length")
        elif isinstance(info, dict) and "goal" in info:
            self.observed, self.achieved = flat_numbers(space, "its observations are"), 0
            self.goal = supported(np.asarray(info["goal"]).size, "its goals are")
        else:
            raise Unsupported(
                "it has no goals: its observations need observation, achieved_goal and"
                f" desired_goal, or its info a goal, as in OGBench; they are {space}"
            )

    def spaces(self, env):
        """Returns the spaces of an environment by name."""
        seen = env.observation_space
        has_parts = self.in_observation and isinstance(seen, gym.spaces.Dict)
        parts = {name: seen[name] for name in PARTS} if has_parts else {"observation": seen}
        return {"action": env.action_space, **parts}

    def observe(self, observation):
        """Returns an observation, followed by the achieved goal if it is apart."""
        if not self.in_observation:
            return vector(observation, self.observed, "observation").copy()
        seen = vector(observation["observation"], self.observed, "observation")
        self.desired(observation, None)
        return np.append(seen, vector(observation["achieved_goal"], self.goal, "achieved goal"))

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


def check_form(spaces):
    """Refuses spaces that are others than at first. Goals may get other bounds."""
    for name, space in spaces.items():
        is_box = isinstance(space, gym.spaces.Box)
        sides = [space.low, space.high] if is_box and not name.endswith("_goal") else []
        key = is_box, space.shape, *(side.tobytes() for side in sides)
        # On the way of every step.
        if keys.get(name) == key:
            continue
        ranges = enumerate(zip(*(side.ravel().tolist() for side in sides)))
        form = [f"shape {space.shape}" if is_box else f"{space}"]
        form += [f"component {i} from {low:g} to {high:g}" for i, (low, high) in ranges]
        first = forms.setdefault(name, form)
        if form != first:
            was, now = next((a, b) for a, b in zip(first, form) if a != b)
            raise Unsupported(f"the space of its {name} had {was} when it was opened, and has {now} now")
        keys[name] = key


def make():
    # Agents may go on beyond the time limit of the registration, as they have other goals: what
    # still is truncated, the environment itself ends.
    env = gym.make(environment_id, max_episode_steps=sys.maxsize, disable_env_checker=True)
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


def is_free(maze, position):
    """Whether a position is in a free cell of a maze that `find_maze` has found."""
    column, row = np.rint((np.asarray(position)[:2] - maze["first"]) / maze["cell"])
    cells = maze["is_wall"]
    return 0 <= row < len(cells) and 0 <= column < len(cells[0]) and not cells[int(row)][int(column)]


def of_gymnasium(wanted, ask):
    """Returns what an environment answers, unless that is the old gym's: less, or an error of a wrapper."""
    try:
        answer = ask()
        if isinstance(answer, tuple) and len(answer) == len(wanted.split(", ")):
            return answer
    except (TypeError, ValueError) as error:
        if "reset() got an unexpected" not in str(error) and "to unpack (exp" not in str(error):
            raise
    raise Unsupported(
        f"its interface is that of the old gym: reset takes seed and options, and this has to return {wanted}"
    )


def reset(slot, seed, task=-1):
    """Begins an episode, of a task unless that is negative; all randomness follows from `seed`."""
    random.seed(seed)
    np.random.seed(seed)
    # OGBench draws actions from it.
    slot.env.unwrapped.action_space.seed(seed)
    slot.ended = False
    options = None if task < 0 else {"task_id": task}
    begun = of_gymnasium("observation, info", lambda: slot.env.reset(seed=seed, options=options))
    slot.generators = random.getstate(), np.random.get_state()
    return begun


def step(slot, action):
    """Steps an environment and returns what it observes."""
    wanted = "observation, reward, terminated, truncated, info"
    Slot.steps += 1
    owns = slot.generators is not None and (Slot.draws or Slot.steps <= FIRST_STEPS)
    if owns:
        random.setstate(slot.generators[0])
        np.random.set_state(slot.generators[1])
    observation, _, terminated, truncated, info = of_gymnasium(wanted, lambda: slot.env.step(action))
    if owns:
        before, slot.generators = slot.generators, (random.getstate(), np.random.get_state())
        Slot.draws = Slot.draws or drawn(before, slot.generators)
    slot.ended = bool(terminated or truncated)
    told = info.get("is_success", info.get("success")) if isinstance(info, dict) else None
    slot.told = 4 + 8 * bool(told) if np.size(told) == 1 and told is not None else 0
    return observation


def drawn(before, after):
    """Whether something has been drawn between two states of the generators."""
    (own, (_, keys, *rest)), (own_after, (_, keys_after, *rest_after)) = before, after
    return own != own_after or rest != rest_after or not np.array_equal(keys, keys_after)


def bounds(values):
    """Returns bounds of a space, None where there is none. Some spaces write it as the largest number."""
    return [float(v) if abs(v) <= LARGEST_BOUND else None for v in values]


def open_environment(body):
    """Imports what is needed, makes the first environment and describes it. Body and answer are JSON."""
    config = json.loads(body)
    global gym, np, environment_id, goals, actions_length
    # Also for the interpreters that packages start when they are imported, as glfw does.
    is_safe = "PYTHONSAFEPATH" in os.environ
    os.environ["PYTHONSAFEPATH"] = "1"
    np = importlib.import_module("numpy")
    gym = importlib.import_module("gymnasium")
    environment_id = config["id"]
    # What packages draw when they are imported is the same in all processes.
    random.seed(0)
    np.random.seed(0)
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
            f"its actions are whole numbers, {actions}: only continuous ones (a Box of floats) are supported"
        )
    goals = Goals(slot)
    check_form(goals.spaces(slot.env))
    return json.dumps(describe(slot, config["package"])).encode()


def describe(slot, package):
    actions, own = slot.env.action_space, slot.env.unwrapped
    spaces = goals.spaces(slot.env)
    seen = [spaces[name] for name in PARTS[:2] if name in spaces]
    radius = getattr(own, "distance_threshold", getattr(own, "_goal_tol", None))
    if radius is None and type(own).__module__.startswith("gymnasium_robotics.envs.maze"):
        radius = MAZE_RADIUS
    is_number = isinstance(radius, (int, float, np.number)) and not isinstance(radius, bool)
    says_radius = is_number and 0 < radius < float("inf")
    limit = gym.spec(slot.env.spec.id).max_episode_steps
    tasks = None if goals.in_observation else getattr(own, "num_tasks", None)
    maze, notes = find_maze(own), []
    if goals.left_out:
        notes.append("its observations are read without " + ", ".join(map(str, goals.left_out)))
    if maze and not is_free(maze, goals.start):
        maze = None
        notes.append("its walls are left out, as it begins in none of its maze's free cells: in another unit?")
    return {
        "observed": goals.observed,
        "achieved": goals.achieved,
        "goal": goals.goal,
        "bounds": [pair for own in seen for pair in zip(bounds(own.low), bounds(own.high))],
        "low": bounds(actions.low),
        "high": bounds(actions.high),
        "time_limit": None if limit is None else int(limit),
        "tasks": int(tasks) if isinstance(tasks, (int, np.integer)) else None,
        "goal_radius": float(radius) if says_radius else None,
        "maze": maze,
        "notes": notes,
        "versions": versions(package),
        "sources": sources(type(own).__module__, package),
    }


def versions(package):
    found = {"python": sys.version.split()[0]}
    for name in ("gymnasium", "numpy", "mujoco", package.split(".")[0]) + KNOWN_PACKAGES:
        version = getattr(sys.modules.get(name), "__version__", None)
        if isinstance(version, str):
            found[name] = version
    return found


def sources(*modules):
    """Returns checksums, by name, of the files of all that has been imported so far from the packages of
    these modules, or from beside them."""
    places, found, left = {}, {}, MOST_READ
    for top in (sys.modules.get(name.split(".")[0]) for name in modules):
        for folder in map(os.path.realpath, getattr(top, "__path__", ())):
            beside = os.path.dirname(folder) + os.sep
            places[folder + os.sep if INSTALLED.search(beside) else beside] = beside
        if not hasattr(top, "__path__") and getattr(top, "__file__", None):
            file = os.path.realpath(top.__file__)
            beside = os.path.dirname(file) + os.sep
            places[file if INSTALLED.search(beside) else beside] = beside
    # Asked for an attribute that it lacks, a module may import more.
    files = (getattr(module, "__dict__", {}).get("__file__") for module in list(sys.modules.values()))
    for path in sorted({os.path.realpath(file) for file in files if isinstance(file, str)}):
        place = next((place for place in places if path.startswith(place)), None)
        if place and not INSTALLED.search(path[len(place) :]) and len(found) < MOST_FILES and left > 0:
            try:
                with open(path, "rb") as file:
                    content = file.read(left)
            except OSError:
                continue
            left -= len(content)
            found[safe(os.path.relpath(path, places[place]))] = zlib.crc32(content)
    return found


def numbers(body):
    return np.frombuffer(body, dtype="<f8")


def step_all(body):
    """Steps the first environments, one per row of actions; returns their rows."""
    actions = numbers(body).reshape(-1, actions_length)
    for slot, action in zip(slots, actions):
        # Not a number is the action of those that rest.
        if not slot.ended and action[0] == action[0]:
            space = slot.env.action_space
            check_form({"action": space})
            # Bounds of double precision have been rounded on the way.
            action = np.clip(action.astype(space.dtype), space.low, space.high)
            observation = step(slot, action)
            slot.last = goals.observe(observation)
            if goals.in_observation and Slot.steps <= FIRST_STEPS:
                slot.moves_goal |= not np.array_equal(observation["desired_goal"], slot.goal)
    return np.concatenate([slot.row() for slot in slots[: len(actions)]])


def reset_one(body):
    """Begins an episode, given environment, seed and task; returns its row and the desired goal."""
    index, seed, task = map(int, numbers(body))
    slot = slots[index]
    observation, info = reset(slot, seed, task)
    check_form(goals.spaces(slot.env))
    slot.last, slot.goal = goals.observe(observation), goals.desired(observation, info).copy()
    return np.append(slot.row(), slot.goal)


def make_all(body):
    """Has at least so many environments."""
    (count,) = map(int, numbers(body))
    while len(slots) < count:
        slots.append(Slot())
        if len(slots) == 2 and share_a_world(*slots):
            raise Unsupported(
                "what one of its environments does changes another in the same process, as they share what they "
                "simulate: give each a process of its own, with --workers as many as agents, 16 at least"
            )
    return ()


def share_a_world(one, other):
    """Whether one environment goes on differently after another has been reset and stepped."""
    reset(one, 0)
    action = one.env.action_space.sample()
    move_other = lambda: (reset(other, 1), step(other, action))

    def after(between):
        reset(one, 0)
        step(one, action)
        between()
        # What is observed may be a step or two old.
        return [goals.observe(step(one, action)).tobytes() for _ in range(3)]

    # Chance, or a count of episodes, decides in another way each time.
    tries = [after(between) for between in (tuple, move_other, move_other, tuple)]
    return tries[0] == tries[3] != tries[1] == tries[2]


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
    is_missing, name = isinstance(error, ModuleNotFoundError), getattr(error, "name", None)
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
            "missing": safe(name) if is_missing and isinstance(name, str) else None,
            "error": text,
            "places": [safe(place) for place in places[-4:]],
            "searched": [safe(folder or os.getcwd()) for folder in sys.path],
        }
    ).encode()


def serve():
    handlers = {OPEN: open_environment, MAKE: make_all, RESET: reset_one, STEP: step_all}
    while header := stream.read(8):
        kind, length = struct.unpack("<II", header)
        body = stream.read(length)
        try:
            answer = handlers[kind](body)
            reply = OK, answer if isinstance(answer, bytes) else np.asarray(answer, dtype="<f8").tobytes()
        except BaseException as error:  # Also what would end this process.
            reply = FAILED, why(error)
        channel.sendall(struct.pack("<II", reply[0], len(reply[1])) + reply[1])


slots, forms, keys = [], {}, {}
worker = os.getpid()
begin()
try:
    serve()
except OSError:  # The program has ended, or this is a process that the environment has forked.
    pass
if os.getpid() != worker:
    os._exit(1)
close_all()
