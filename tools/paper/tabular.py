"""Tabular learners, which are given the number of each place instead of sensors.

References:
    Sutton & Barto, "Reinforcement Learning: An Introduction", 2nd edition 2018:
    Q-learning, section 6.5; tabular Dyna-Q, section 8.2; the settings are those of
    examples 6.6 (a step of 0.5, a tenth at random) and 8.1 (a discount of 0.95, up to
    50 planning updates). Brafman & Tennenholtz 2002: R-max.
"""

import numpy as np
from numpy.typing import NDArray

from tools.paper.worlds_as_tables import Stage

STEP, DISCOUNT, TRIES, UPDATES = 0.5, 0.95, 0.1, 50
"""Of learners of values: size of a step, discount, share of random actions, and
planning updates per step of Dyna-Q."""


class Walker:
    """A walker in a world given as a table; it observes the number of its place."""

    def __init__(self, stage: Stage, seed: int) -> None:
        self.stage = stage
        self.random = np.random.default_rng(seed)
        self.place = self.begin()

    def begin(self) -> int:
        """Begin an episode; return where."""
        shares = self.stage.start
        self.place = int(self.random.choice(len(shares), p=shares))
        return self.place

    def step(self, action: int) -> int:
        """Take an action; return the place it leads to."""
        draw = float(self.random.random())
        self.place = self.stage.follow(self.place, action, draw)
        return self.place


def q_learning(
    stage: Stage, goal: NDArray[np.bool_], steps: int, seed: int, updates: int = 0
) -> NDArray[np.intp]:
    """Learn the values of actions for one goal; a reward of 1 is given there.

    Args:
        stage: The world.
        goal: ``(places,)``; an episode is over there, too.
        steps: How many actions are taken.
        seed: Draws all there is to draw.
        updates: Of the model, after each step: Dyna-Q.

    Returns:
        ``(places,)``: what it would do at each place, the best by its values.
    """
    walker = Walker(stage, seed)
    count = len(stage.actions)
    values = [[0.0] * count for _ in range(len(stage.over))]
    last = (stage.over | goal).tolist()
    rewards = goal.astype(float).tolist()
    model: dict[tuple[int, int], int] = {}
    visited: list[tuple[int, int]] = []
    random = walker.random

    def learn(place: int, action: int, after: int) -> None:
        ahead = 0.0 if last[after] else DISCOUNT * max(values[after])
        row = values[place]
        row[action] += STEP * (rewards[after] + ahead - row[action])

    for _ in range(steps):
        place = walker.place if not last[walker.place] else walker.begin()
        row = values[place]
        if random.random() < TRIES:
            action = int(random.integers(count))
        else:
            best = max(row)
            equals = [k for k in range(count) if row[k] == best]
            action = equals[int(random.random() * len(equals))]
        after = walker.step(action)
        learn(place, action, after)
        if updates:
            if (place, action) not in model:
                visited.append((place, action))
            model[place, action] = after
            for pick in random.integers(len(visited), size=updates).tolist():
                at, taken = visited[pick]
                learn(at, taken, model[at, taken])
    return np.array([int(np.argmax(row)) for row in values], np.intp)


class PlaceTable:
    """Explores by a table of what each action led to from each place.

    It goes to the nearest place with an action not tried there, and where there is none
    ends the episode or acts at random: R-max for a world without chance.
    """

    def __init__(self, stage: Stage, steps: int, seed: int) -> None:
        self._count = len(stage.actions)
        self.led: dict[tuple[int, int], int] = {}
        self.tried: list[int] = []
        walker = Walker(stage, seed)
        plan: list[int] = []
        for _ in range(steps):
            if stage.over[walker.place]:
                walker.begin()
                plan = []
            plan = plan or self._plan(walker.place, stage.over)
            action = plan.pop(0) if plan else int(walker.random.integers(self._count))
            place = walker.place
            after = walker.step(action)
            if self.led.get((place, action), after) != after:
                plan = []  # it did not do what it did before
            self.led[place, action] = after
            self.tried.append(len(self.led))

    def _plan(self, start: int, over: NDArray[np.bool_]) -> list[int]:
        """Return the actions to the nearest one not tried, or to the nearest end."""
        ways: dict[int, list[int]] = {start: []}
        end: list[int] = []
        for place in (frontier := [start]):
            for action in range(self._count):
                after = self.led.get((place, action))
                way = [*ways[place], action]
                if after is None:
                    return way
                if over[after]:
                    end = end or way
                elif after not in ways:
                    ways[after] = way
                    frontier.append(after)
        return end

    def policy(self, goal: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Return what to do at each place to get to a goal soonest: ``(places,)``.

        Value iteration over what was tried, without a discount.
        """
        far = np.where(goal, 0.0, np.inf)
        choice = np.zeros(len(goal), np.intp)
        pairs = [(p, a, after) for (p, a), after in self.led.items() if not goal[p]]
        changed = True
        while changed:
            changed = False
            for place, action, after in pairs:
                if far[after] + 1 < far[place]:
                    far[place], choice[place] = far[after] + 1, action
                    changed = True
        return choice


def follow(
    stage: Stage,
    choice: NDArray[np.intp],
    start: int,
    goal: NDArray[np.bool_],
    limit: int,
    seed: int,
) -> int:
    """Return the steps from a place to a goal; -1 if it is not reached in time."""
    random = np.random.default_rng(seed)
    place = start
    for steps in range(limit + 1):
        if goal[place]:
            return steps
        if stage.over[place]:
            break
        place = stage.follow(place, int(choice[place]), float(random.random()))
    return -1
