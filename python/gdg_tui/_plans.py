"""Walks through bridge points: the graph of a run, and what an agent heads for on its way.

The same search and the same rules as in the program's `bridge` module, where the reasons are.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._interface import Interface, rows
from ._networks import Actor, Critics

GOAL = -1
"""What a walk heads for at its end; otherwise the index of a candidate."""


class Graph:
    """Bridge candidates, the paths observed between them, and edges. Costs are in steps."""

    def __init__(
        self, arrays: dict[str, np.ndarray], description: dict[str, Any], achieved: np.ndarray
    ):
        self.rules = SimpleNamespace(**description["plans"]["rules"])
        # How far apart the components of two states may be that count as one.
        self.same_place = np.float32(self.rules.same_place) * np.float32(self.rules.change_scale)
        self.goal_radius = np.float32(description["goal_radius"])
        self.achieved = achieved
        self.states = arrays["candidates"]
        self.points = self.states[:, achieved]
        self.kinds = self.kinds_of(self.states)
        self.hops = arrays["hops"]
        count = len(self.states)
        start, end = arrays["edges.from"].astype(int), arrays["edges.to"].astype(int)
        observed_from = np.repeat(np.arange(count), np.diff(arrays["observed.ends"], prepend=0))
        observed_to = arrays["observed.to"].astype(int)
        if any((index >= count).any() for index in (start, end, observed_to)):
            raise ValueError("a path leads to a candidate that there is not")
        # Sorted, as both are; the last one is never found.
        self.observed_pairs = np.append(observed_from * count + observed_to, -1)
        self.observed_steps = np.append(arrays["observed.steps"].astype(float), np.inf)
        by_end = np.argsort(end, kind="stable")
        self.first = np.searchsorted(end[by_end], np.arange(count + 1)).tolist()
        self.start = start[by_end].tolist()
        self.units = self.cost_units(arrays["edges.cost"][by_end])

    def cost_units(self, costs: np.ndarray) -> list[int]:
        """Returns costs as whole numbers of small parts of a step, for searches to add up."""
        units = np.asarray(costs, dtype=np.float32) * np.float32(self.rules.cost_units_per_step)
        return [int(unit) for unit in np.minimum(units, 2**32 - 1)]

    def kinds_of(self, states: np.ndarray) -> np.ndarray:
        """Returns what tells states apart beside the goal, (states, others)."""
        others = [
            np.floor((states[:, component].astype(np.float32) - np.float32(low)) / np.float32(width))
            for component, width, low in getattr(self.rules, "told_apart_by", [])
        ]
        return np.stack(others, axis=1) if others else np.zeros((len(states), 0))

    def alike(self, candidates: ArrayLike, state: np.ndarray) -> np.ndarray:
        """Returns which candidates nothing but the goal tells apart from `state`."""
        return (self.kinds[candidates] == self.kinds_of(state[None])[0]).all(axis=-1)

    def around(self, state: np.ndarray) -> np.ndarray:
        """Returns a few of the candidates: those of the kind of `state` first, the nearest first."""
        kinds = np.abs(self.kinds - self.kinds_of(state[None])).sum(axis=1)
        order = np.lexsort((self.apart(self.points, state), kinds))
        return order[: self.rules.link_candidates]

    def apart(self, points: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Returns the straight-line distances of points from what `state` achieves, in single
        precision, as equally far candidates are in the order of their indices.
        """
        at = state[self.achieved].astype(np.float32)
        return np.sqrt(np.square(at - points.astype(np.float32)).sum(axis=1))

    def reached(self, points: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Returns which of the points `state` reaches."""
        return self.apart(points, state) < self.goal_radius

    def nearby(self, distances: np.ndarray) -> np.ndarray:
        """Returns a few of the candidates, the nearest first, given how far all of them are."""
        return np.argsort(distances, kind="stable")[: self.rules.link_candidates]

    def observed(self, start: ArrayLike, end: ArrayLike) -> np.ndarray:
        """Returns the fewest steps of any trajectory between candidates; infinite without one."""
        pairs = np.asarray(start) * len(self.states) + np.asarray(end)
        at = np.searchsorted(self.observed_pairs[:-1], pairs)
        steps = np.where(self.observed_pairs[at] == pairs, self.observed_steps[at], np.inf)
        return np.where(np.equal(start, end), 0.0, steps)

    def late_after(self, distance: ArrayLike) -> np.ndarray:
        """Returns the steps after which a waypoint is late, given D to it."""
        return self.rules.late_factor * np.asarray(distance) + self.rules.late_slack_steps

    def link_costs(self, start: ArrayLike, end: ArrayLike, distance: np.ndarray) -> np.ndarray:
        """Returns the costs of hops from near candidates `start` to near `end`, given D; infinite
        where they may not be planned.
        """
        rules = self.rules
        ahead, back = self.observed(start, end), self.observed(end, start)
        walked = np.isfinite(ahead) & rules.verify_edges
        steps = np.where(walked, np.maximum(distance, ahead - rules.walked_slack_steps), distance)
        arrived, failed = self.hops[np.minimum(steps.astype(int), len(self.hops) - 1)].T
        delay = failed / (arrived + 1.0) * self.late_after(steps)
        verified = ahead <= rules.observed_factor * distance + rules.observed_slack_steps
        by_distance = (distance < rules.edge_cutoff_steps) & (verified | (not rules.verify_edges))
        length = np.maximum(
            np.where(np.isfinite(ahead), ahead, back), np.minimum(distance, rules.edge_cutoff_steps)
        )
        penalty = np.where(
            np.isfinite(ahead), rules.observed_penalty_steps, rules.reversed_penalty_steps
        )
        otherwise = length + penalty if rules.keep_observed_edges else np.inf
        otherwise = np.where((self.kinds[start] == self.kinds[end]).all(axis=-1), otherwise, np.inf)
        return np.where(by_distance, steps, otherwise) + delay

    def shortest_paths(self, links: Sequence[tuple[int, int]]) -> tuple[np.ndarray, list[int]]:
        """Finds the cheapest paths to a goal, given the candidates linked to it and the costs of
        these links as whole numbers. Returns the cost from each candidate, infinite if there is no
        path, and the next one on its path: itself if the goal comes next.
        """
        best: list[float] = [np.inf] * len(self.states)
        following = list(range(len(best)))
        for candidate, cost in links:
            best[candidate] = min(cost, best[candidate])
        reached = [(cost, candidate) for candidate, cost in links]
        heapq.heapify(reached)
        while reached:
            ahead, candidate = heapq.heappop(reached)
            if ahead > best[candidate]:
                continue
            for i in range(self.first[candidate], self.first[candidate + 1]):
                start, cost = self.start[i], ahead + self.units[i]
                if cost < best[start]:
                    best[start], following[start] = cost, candidate
                    heapq.heappush(reached, (cost, start))
        costs = np.array(best, dtype=np.float32) / np.float32(self.rules.cost_units_per_step)
        return costs, following


@dataclass(frozen=True)
class Route:
    """Cheapest paths to one goal: see `Graph.shortest_paths`."""

    costs: np.ndarray
    next: list[int]
    nearest: list[int]
    """The candidate nearest to the goal by D, of each kind that there is near it."""
    links: list[tuple[int, int]]
    has_unverified_links: bool = False


@dataclass(frozen=True)
class Options:
    """What a walk can head for next."""

    candidates: np.ndarray
    distances: np.ndarray
    """D to each."""
    costs: np.ndarray
    """Costs of the hops there, infinite where they may not be planned."""
    to_goal: float
    """D to the goal."""
    direct: float
    """Cost of going there straight, infinite if that may not be planned."""


@dataclass(frozen=True)
class Planner:
    """What walks depend on."""

    graph: Graph
    critics: Critics
    actor: Actor
    interface: Interface


class Walk:
    """An agent's walk to its goal through bridge points.

    It commits to a waypoint until that is reached or late, then chooses the next one. Call `step`
    once for each step of the environment.
    """

    goal: np.ndarray
    """The goal, (goal_dim)."""
    strikes: int
    """Number of waypoints in a row that were late: an agent with two is stuck."""

    def __init__(self, planner: Planner, goal: np.ndarray):
        self.goal, self.strikes = goal, 0
        self._graph, self._critics = planner.graph, planner.critics
        self._actor, self._interface = planner.actor, planner.interface
        self._target: int | None = None
        self._clock = self._began = self._deadline = 0
        self._turned, self._landmark = False, None
        self._remaining = np.inf
        self._banned: list[tuple[int, int]] = []
        self._at: int | None = None
        self._route = self._find_route()

    def step(self, state: ArrayLike) -> np.ndarray:
        """Advances the walk in `state` (state_dim) and returns the action of the next step."""
        at = rows(state, len(self._actor.encoder.centre), "a state")[0]
        rules, target = self._graph.rules, self._keep_target(at)
        if target is None:
            target, distance = self._planned(at) or self._choose(at)
            self._began, self._turned, self._landmark = self._clock, False, None
            self._deadline = self._clock + int(self._graph.late_after(distance))
        self._target = target
        self._clock += 1
        aim = self._position(target)
        (action,) = self._actor.actions(at[None], aim[None])
        if rules.lookahead and (self.strikes % 2 == 0) != self._turned:
            action = self._critics.improved(at, aim, action)
        return self._interface.actions(action[None])[0]

    @property
    def waypoint(self) -> np.ndarray | None:
        """What the latest step headed for, (goal_dim); None before the first."""
        return None if self._target is None else self._position(self._target)

    def waypoints(self) -> np.ndarray:
        """Returns the waypoints still ahead, the goal last: (waypoints, goal_dim)."""
        ahead: list[np.ndarray] = []
        at = self._target
        while at is not None and at != GOAL and len(ahead) <= len(self._route.next):
            ahead.append(self._position(at))
            at = self._route.next[at] if self._route.next[at] != at else GOAL
        return np.array([*ahead, self.goal])

    def _position(self, target: int) -> np.ndarray:
        return self.goal if target == GOAL else self._graph.points[target].astype(float)

    def _keep_target(self, state: np.ndarray) -> int | None:
        """Returns the current target, unless it has been reached or given up."""
        target, rules = self._target, self._graph.rules
        if target is None:
            return None
        reached = bool(self._graph.reached(self._position(target)[None], state)[0])
        reached = reached and (target == GOAL or bool(self._graph.alike(target, state)))
        circles = rules.progress_check and self._goes_in_circles(state)
        late = rules.progress_check and self._clock >= self._deadline or circles and self._turned
        if circles:
            self._began, self._turned, self._landmark = self._clock, True, None
        if reached and target != GOAL:
            self._remaining, self.strikes, self._at = self._route.costs[target], 0, target
        elif late and not reached:
            self._remaining, self._at = np.inf, None
            self.strikes += 1
            times = sum(late == target for late, _ in self._banned)
            ban = rules.ban_steps << min(times, rules.max_doublings)
            self._banned = [*self._banned, (target, self._clock + ban)]
        return None if late or reached else target

    def _banned_now(self) -> list[int]:
        return [late for late, until in self._banned if until > self._clock]

    def _goes_in_circles(self, state: np.ndarray) -> bool:
        """Returns whether the agent is back where it was on its way to the target."""
        state, landmark = state.astype(np.float32), self._landmark
        again = landmark is not None
        again = again and bool((np.abs(state - landmark) <= self._graph.same_place).all())
        since = self._clock - self._began
        if since > 0 and since & (since - 1) == 0:
            self._landmark = state
        return again

    def _planned(self, state: np.ndarray) -> tuple[int, float] | None:
        """Returns the next target, and D to it, of a walk with a single plan that is under way."""
        if self._at is None or not self._graph.rules.open_loop:
            return None
        following = self._route.next[self._at]
        target = following if following != self._at else GOAL
        return target, self._critics.distances(state[None], self._position(target)[None])[0]

    def _choose(self, state: np.ndarray) -> tuple[int, float]:
        """Returns the best next target, and D to it: of nearby candidates the one that minimises D
        and the cost from there, or the goal if that is no longer.
        """
        nearby = self._graph.around(state)
        promising = self._promising(state, nearby)
        options = self._options(state, promising)
        waypoint = self._best_waypoint(state, options, True)
        if waypoint is None and len(promising) < len(nearby):
            options = self._options(state, nearby)
            waypoint = self._best_waypoint(state, options, True)
        waypoint = waypoint or self._best_waypoint(state, options, False)
        if waypoint is None and np.isinf(options.direct) and self._link_unverified():
            waypoint = self._best_waypoint(state, options, True)
            waypoint = waypoint or self._best_waypoint(state, options, False)
        banned = GOAL in self._banned_now()
        direct = np.inf if banned else options.direct
        if waypoint is not None and not (np.isfinite(direct) and direct <= waypoint[2]):
            return waypoint[:2]
        if np.isfinite(direct):
            return GOAL, options.to_goal
        return GOAL, min(options.to_goal, self._graph.rules.window_steps)

    def _promising(self, state: np.ndarray, nearby: np.ndarray) -> np.ndarray:
        """Returns those nearby for which D is worth asking: the nearest ones, and those with the
        shortest ways to the goal.
        """
        rules = self._graph.rules
        if not rules.verify_edges or self.strikes >= rules.max_strikes or len(nearby) == 0:
            return nearby
        observed = self._graph.observed(nearby[0], nearby)
        # In single precision, as the sums of unobserved ones are often the same there.
        steps = np.where(np.isfinite(observed), observed, rules.unobserved).astype(np.float32)
        steps += self._route.costs[nearby]
        steps[~self._may_head_for(state, nearby)] = np.inf
        best = np.lexsort((nearby, steps))[: rules.promising_candidates]
        chosen = np.arange(len(nearby)) < rules.nearest_candidates
        chosen[best[np.isfinite(steps[best])]] = True
        return nearby[chosen]

    def _may_head_for(self, state: np.ndarray, candidates: np.ndarray) -> np.ndarray:
        """Returns which candidates lead on towards the goal, and are not banned."""
        return (
            (self._route.costs[candidates] < self._remaining)
            & ~np.isin(candidates, self._banned_now())
            & ~(
                self._graph.reached(self._graph.points[candidates], state)
                & self._graph.alike(candidates, state)
            )
        )

    def _options(self, state: np.ndarray, nearby: np.ndarray) -> Options:
        goals = np.vstack([self._graph.points[nearby], self.goal])
        distances = self._critics.distances(np.repeat(state[None], len(goals), 0), goals)
        costs, direct = np.full(len(nearby), np.inf), np.inf
        alike = self._graph.alike(nearby, state)
        if alike.any():
            here = nearby[np.argmin(np.where(alike, distances[:-1], np.inf))]
            costs = self._graph.link_costs(here, nearby, distances[:-1])
            for nearest in self._route.nearest:
                straight = self._graph.link_costs(here, np.array([nearest]), distances[-1:])[0]
                direct = min(direct, straight)
        return Options(nearby, distances[:-1], costs, distances[-1], direct)

    def _best_waypoint(
        self, state: np.ndarray, options: Options, verified: bool
    ) -> tuple[int, float, float] | None:
        """Returns the best candidate to head for, D to it and the total cost, if there is one: over
        verified links alone, or over any.
        """
        costs, rules = options.costs, self._graph.rules
        if not verified:
            alike = self._graph.alike(options.candidates, state)
            otherwise = np.where(alike, rules.unverified_factor * options.distances, np.inf)
            costs = np.where(np.isfinite(costs), costs, otherwise)
        totals = costs + self._route.costs[options.candidates]
        usable = np.isfinite(totals) & self._may_head_for(state, options.candidates)
        if not usable.any():
            return None
        # A stuck agent takes the shortest hop away from there.
        keys = options.distances if self.strikes >= rules.max_strikes else totals
        i = int(np.argmin(np.where(usable, keys, np.inf)))
        return int(options.candidates[i]), options.distances[i], totals[i]

    def _find_route(self) -> Route:
        """Finds the cheapest paths to the goal, with the links that may be planned."""
        graph, (nearby, distances) = self._graph, self._near_goal()
        if len(nearby) == 0:
            return Route(np.empty(0), [], [], [])
        by_kind: dict[tuple[float, ...], int] = {}
        for i in nearby[np.argsort(distances, kind="stable")].tolist():
            by_kind.setdefault(tuple(graph.kinds[i]), i)
        nearest = list(by_kind.values())
        costs = graph.rules.hop_steps + np.min(
            [graph.link_costs(nearby, np.full(len(nearby), end), distances) for end in nearest],
            axis=0,
        )
        known = np.isfinite(costs)
        links = list(zip(nearby[known].tolist(), graph.cost_units(costs[known])))
        return Route(*graph.shortest_paths(links), nearest, links)

    def _link_unverified(self) -> bool:
        """Finds the cheapest paths again with all links to the goal, if that makes a difference."""
        route, graph = self._route, self._graph
        if route.has_unverified_links or not graph.rules.verify_edges:
            return False
        nearby, distances = self._near_goal()
        others = ~np.isin(nearby, [candidate for candidate, _ in route.links])
        costs = graph.rules.unverified_factor * distances[others] + graph.rules.hop_steps
        links = [*route.links, *zip(nearby[others].tolist(), graph.cost_units(costs))]
        self._route = Route(*graph.shortest_paths(links), route.nearest, links, True)
        return True

    def _near_goal(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns a few candidates around the goal, and D from each to it."""
        graph, goal = self._graph, self.goal.astype(np.float32)
        nearby = graph.nearby(np.sqrt(np.square(goal - graph.points).sum(axis=1)))
        goals = np.repeat(self.goal[None], len(nearby), 0)
        return nearby, self._critics.distances(graph.states[nearby].astype(float), goals)
