"""Follows walks of the program with an exported policy, and compares each step.

    python tests/same_walks.py POLICY.safetensors [WITHOUT] < TRACE

A line of the trace is {"begins", "state", "goal", "waypoint", "action"}: whether a walk begins, and
what the program headed for and did in that state. Without "waypoint", the actor alone acted.

Program and module round differently, which matters where a choice is close. Where the module
chooses otherwise, it tries again with errors of D as large as those of rounding, and must make the
program's choice with one of them; how often that was so is counted. Prints the counts as JSON, and
fails at the first step that differs. WITHOUT is one of the RULES, which is left out: where that
makes no difference, the trace does not test it.
"""

import copy
import json
import sys

import numpy as np

import gdg_tui

# Most that an action or a waypoint may differ by.
TOLERANCE = 1e-4

# Most that rounding changes D by, in steps and as a share of D, and how often errors are drawn.
ROUNDING = 2e-4
DRAWS = 200


# Rules of walks, and how to do without each.
RULES = {
    "single plan": lambda graph: setattr(graph.rules, "open_loop", False),
    "delays": lambda graph: setattr(graph, "hops", np.zeros_like(graph.hops)),
    "steps walked": lambda graph: setattr(graph.rules, "walked_slack_steps", np.inf),
    "circles": lambda graph: setattr(graph, "same_place", -1.0),
    "longer bans": lambda graph: setattr(graph.rules, "max_doublings", 0),
}


def with_errors(policy, seed, act):
    """Calls `act` while D has random errors as large as those of rounding."""
    rng, critics = np.random.default_rng(seed), policy._planner.critics
    exact = critics.distances

    def rounded(states, goals):
        distances = exact(states, goals)
        return distances + ROUNDING * (1 + distances) * rng.uniform(-1, 1, len(distances))

    critics.distances = rounded
    try:
        return act()
    finally:
        del critics.distances


def follow(policy, walk, line):
    """Takes the step of a line; returns the walk after it, how much it differs, and whether it took
    errors to make the program's choices.
    """

    def step():
        own = policy.walk(line["goal"]) if line["begins"] else copy.copy(walk)
        action = own.step(line["state"])
        apart = [own.waypoint - line["waypoint"], action - line["action"]]
        return own, np.abs(np.concatenate(apart)).max()

    own, off = step()
    if off < TOLERANCE:
        return own, off, False
    for seed in range(DRAWS):
        other, off = with_errors(policy, seed, step)
        if off < TOLERANCE:
            return other, off, True
    sys.exit(f"heads for {own.waypoint}, {own.strikes} strikes, instead of {line}")


def main():
    policy = gdg_tui.load_policy(sys.argv[1])
    for rule in sys.argv[2:]:
        RULES[rule](policy._planner.graph)
    names = ["steps", "walks", "waypoints", "late", "looked_ahead", "rounded", "largest"]
    counts, walk, before = dict.fromkeys(names, 0), None, None
    for line in map(json.loads, sys.stdin):
        counts["steps"] += 1
        if "waypoint" not in line:
            off = np.abs(policy(line["state"], line["goal"]) - line["action"]).max()
            assert off < TOLERANCE, f"differs by {off} from {line}"
        else:
            strikes = 0 if line["begins"] else walk.strikes
            walk, off, rounded = follow(policy, walk, line)
            own = policy(line["state"], walk.waypoint)
            counts["walks"] += line["begins"]
            counts["waypoints"] += line["begins"] or line["waypoint"] != before
            counts["late"] += walk.strikes > strikes
            counts["looked_ahead"] += bool(np.abs(own - line["action"]).max() > 0.1)
            counts["rounded"] += rounded
            before = line["waypoint"]
        counts["largest"] = max(counts["largest"], float(off))
    print(json.dumps(counts))


if __name__ == "__main__":
    main()
