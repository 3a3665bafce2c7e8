"""Plans several steps ahead by waves that start in predicted states.

From an imagined state the consequences of every action are asked for, a round of waves
for all states that are as many steps away. What an action guarantees is the next
imagined state. The first that has all of the target gives the shortest plan there is in
what has been learned. It is kept until something comes that it did not expect.

An action can be imagined where each of its contexts has been met: of a context that
never was, nothing has been learned, though it may seem to imply a lot.

What is left to chance is never guaranteed. A planner with a target does not take the
outcome of an action that slips, nor of one after it, for unknown. Where no plan is sure
to lead to the target, it takes the one with the greatest chance (`chances`); if there
is none, it goes on greedily, and does not end the episode. What is drawn at random is
none of the actions that are known to end it, unless all do.

Once no sensor can be grown, what is imagined wrong stays wrong. Then it asks first what
followed in the past, and imagines where that tells nothing.

One that is to prefer some sensations to others has no end to plan to: it always asks
what followed in the past, and takes what promises most.

References:
    Not the paper's, whose planner looks one step ahead ([GK] "Algorithm: Greedy
    Reactive Planning") and names "replanning in the face of failure" as future work.
"""

from collections.abc import Generator, Iterator, Mapping
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.agent.chances import SURE, plan_by_chance
from neurosnap.agent.curiosity import Curiosity
from neurosnap.agent.experience import Experience
from neurosnap.agent.plan import AnyPlan, ContingentPlan, ImaginedState, Names, Plan
from neurosnap.agent.planner import Planner, target_literals, weighed_literals
from neurosnap.agent.policy import (
    EXPLORE,
    Aim,
    Deliberation,
    Signal,
    checked_share,
)
from neurosnap.agent.random_draws import RandomNumbers, pick
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.history_questions import Question
from neurosnap.sensorium import Sensorium, complement

STATES: Final = 2000
"""Imagined states a decision may take, unless another number is given."""
_SHOWN = 4  # literals that a reason names
_Search: TypeAlias = Generator[list[Signal] | Question, Any, AnyPlan | None]


class ImaginingPlanner:
    """A policy that plans by imagined waves, and greedily where these find no plan.

    Args:
        body: What is sensed and done.
        target: Literals to be achieved jointly; none: to explore is all there is to do.
            Or, as a mapping, what it prefers: what each of some literals is worth.
        seed: Draws among equals, and when to act at random.
        explore: The share of random actions, in [0, 1].
        experience: What was met so far; kept up to date by the caller.
        states: How many states a decision may imagine.
        curious: Whether to go to the nearest action with an unknown outcome where no
            plan leads to the target, unless what it does there is left to chance; of
            one that prefers, whether it prefers to all else what was hardly tried.

    Raises:
        InvalidValueError: As for `Planner`; or there is neither a target nor
            curiosity; or it prefers something, and the body grows no sensors, whose
            past readings tell what promises most.
    """

    def __init__(
        self,
        body: Body,
        target: Aim,
        seed: int,
        explore: float,
        experience: Experience,
        states: int = STATES,
        curious: bool = False,
    ) -> None:
        if states < 1:
            raise InvalidValueError("imagine", "must be 1 or more", states)
        prefers = target if isinstance(target, Mapping) else {}
        wanted = () if prefers else tuple(target)
        self._prefers = weighed_literals(body, prefers)
        if prefers and not (body.room and body.context):
            rule = "must go with an agent that grows sensors (such as grow = 30)"
            raise InvalidValueError("prefer", rule, dict(prefers))
        if not (wanted or curious or prefers):
            rule = "must name a sensation to achieve, or come with exploration"
            raise InvalidValueError("target", rule, "nothing")
        given = body, wanted, seed, 0.0, experience
        self._greedy = Planner(*given) if wanted else None
        self._target = list(target_literals(body, wanted)) if wanted else []
        self._explore = checked_share(explore)
        self._random = RandomNumbers(seed)
        self._experience = experience
        self._states = states
        self._curious = curious
        self._own = len(body.own)
        self._names = body.actions
        experience.aim()
        self.grow(body)

    def grow(self, body: Body) -> None:
        """Go on with a body that has grown, or retired, a sensor; the plan is kept."""
        self._body, self._actions = body, Actions(body)
        self._said = Names(body.actions, Sensorium(body.sensors))
        self._looked_at = body.looked_at
        self._first = 2 * (self._own + len(body.actions))  # contextual literal
        if self._greedy is not None:
            self._greedy.grow(body)

    def decide(self, tick: int, state: NDArray[np.bool_]) -> Deliberation:
        """Follow the plan, or ask what actions lead to until there is one."""
        draws, known = self._random.at(tick), self._experience
        if draws[1] < self._share_at_random:
            if isinstance(known.plan, Plan):  # its next step is not taken
                known.plan = None
            return (yield from self._at_random(state, draws[0], ", to explore"))
        if self._prefers:
            return (yield from self._by_preference(state, draws[0]))
        here = state & self._looked_at
        place = here.tobytes()
        if known.plan is None or not known.plan.goes_on(state, known.history.tick):
            known.plan = yield from self._plan(state, here, draws[0])
        if known.plan is not None:
            why = known.plan.reason(state, self._said)
            action, known.plan = known.plan.step(state)
            return action, why
        if self._greedy is not None:
            action, why = yield from self._greedy.decide(tick, state)
            return action, f"{known.no_way[place]}; {why}"
        return (yield from self._at_random(state, draws[0], ""))

    @property
    def _share_at_random(self) -> float:
        """The share of random actions: some, where it might go in circles."""
        plan = self._experience.plan
        guesses = isinstance(plan, ContingentPlan) and plan.why == "guesses"
        return max(self._explore, EXPLORE if guesses else 0.0)

    def _plan(
        self, state: NDArray[np.bool_], here: NDArray[np.bool_], draw: float
    ) -> _Search:
        """Imagine a way, or ask what followed in the past; None if neither tells."""
        known, plan = self._experience, None
        if not self._body.has_room and self._may_ask(here):
            plan = yield from self._by_chance(state)
        if plan is None and here.tobytes() not in known.no_way:
            plan = yield from self._search(here, draw)
            if self._body.has_room and self._is_left_to_chance(here, plan):
                plan = (yield from self._by_chance(state)) or plan
        return plan

    def _by_preference(self, state: NDArray[np.bool_], draw: float) -> Deliberation:
        """Take what promises most, where anything is known of what follows."""
        known = self._experience
        tick, plan = known.history.tick, known.plan
        fresh = isinstance(plan, ContingentPlan) and tick <= plan.until
        if not fresh and tick > known.asked_until and known.history.ticks:
            plan = yield from self._by_chance(state)
        known.plan = plan
        if plan is not None and plan.goes_on(state, tick):
            return plan.step(state)[0], plan.reason(state, self._said)
        return (yield from self._at_random(state, draw, ": nothing was tried here"))

    def _is_left_to_chance(self, here: NDArray[np.bool_], plan: AnyPlan | None) -> bool:
        """Tell whether to ask what chance leads to: no plan is sure to arrive."""
        known = self._experience
        if not (known.hopeless.any() and known.history.ticks):
            return False
        if self._target:
            return plan is None or bool(plan.why)  # that tries out what is unknown
        return self._may_ask(here)

    def _may_ask(self, here: NDArray[np.bool_]) -> bool:
        """Tell whether to ask what followed in the past.

        Not where the episode is over, and while it told nothing only now and then.
        """
        known = self._experience
        due = known.history.tick > known.asked_until and not known.is_end(here, -1)
        return due and known.history.ticks > 0

    def _by_chance(self, state: NDArray[np.bool_]) -> _Search:
        """Return the plan that promises most where chance decides, if there is any."""
        known = self._experience
        aim, doubted = (self._target, self._prefers), known.tossed
        if not any(aim):  # a coin would have each place explored twice
            doubted = known.slipping
        plan = yield from plan_by_chance(
            self._body, *aim, known.history, state, doubted, self._curious
        )
        if plan is not None:
            known.no_way.pop((state & self._looked_at).tobytes(), None)
        elif not self._target:  # else the next place may be one that is known
            known.asked_until = known.history.tick + SURE
        return plan

    def _lacks(self, reachable: NDArray[np.bool_], whole: bool) -> str:
        """Return why no way to the target was found.

        Args:
            reachable: ``(2N,)``: the literals that some imagined state has.
            whole: Whether that was all there is to imagine.
        """
        lacks = [a for a in self._target if not reachable[a]]
        if not whole:
            return f"knows no way among {self._states:,} states"
        if not lacks:
            return "knows no way to all of it at once"
        names = ", ".join(map(self._said.sensors.name, lacks[:_SHOWN]))
        more = ", …" if len(lacks) > _SHOWN else ""
        return f"knows no way: nothing tried leads to {names}{more}"

    def _at_random(
        self, state: NDArray[np.bool_], draw: float, why: str
    ) -> Deliberation:
        """Draw an action that is not known to end the episode, if there is one."""
        known, options = self._experience, list(range(len(self._names)))
        if known.ends or known.ended:
            bounds = guaranteed((yield self._actions.signals(state)))
            safe = [a for a in options if not known.foresees_end(state, a, bounds[a])]
            options = safe or options
        return pick(np.array(options), draw), f"at random{why}"

    def _search(self, here: NDArray[np.bool_], draw: float) -> _Search:
        """Imagine, all states of one distance at a time, until the target is met.

        Returns:
            The shortest plan. If there is none and the planner is curious, that to the
            best thing to try; see `Curiosity`. None if there is neither.
        """
        told = self._experience
        frontier, seen, left = [ImaginedState(here)], {here.tobytes()}, self._states
        met = told.met
        always = met & ~complement(met)  # a sensor that never changed
        curiosity = Curiosity(told, self._names, bool(self._target))
        reachable = here.copy()  # by any action
        whole = True  # that is all there is to imagine
        chance, searched = False, {here.tobytes()}
        while frontier and not curiosity.is_settled(frontier[0].steps):
            asked = [*self._asked(frontier, curiosity)]
            searched.update(at.place.tobytes() for at, _, _ in asked)
            signals = [signal for _, _, signal in asked]
            bounds = guaranteed((yield signals)) if signals else ()
            frontier = []
            for (at, action, _), bound in zip(asked, bounds, strict=True):
                state = self._body.carried(at.place, bound | always)
                reachable |= state
                if self._target and state[self._target].all():
                    return _planned(ImaginedState(state, at, action), "")
                if told.has_ended(at.place, action):
                    curiosity.end(at, action)
                    continue
                place = state & self._looked_at
                # One who only explores tests what seems to be known all the same.
                by_chance = bool(self._target) and (
                    at.by_chance or told.by_chance(place, action)
                )
                chance |= by_chance
                if not by_chance and told.is_whole(place, action):
                    curiosity.known(at, action)
                elif not by_chance:
                    curiosity.unknown(at, action)
                key = place.tobytes()
                if key not in seen and len(frontier) == left:
                    whole = False
                elif key not in seen:
                    seen.add(key)
                    reached = ImaginedState(place, at, action, at.steps + 1, by_chance)
                    frontier.append(reached)
            left -= len(frontier)
        trial = curiosity.choice(draw) if self._curious else None
        if trial is None:
            # From none of them more can be imagined than from here, chance aside.
            chance = chance or bool(told.hopeless.any())
            places = searched if whole and not chance else [here.tobytes()]
            told.note_no_way(places, self._lacks(reachable, whole))
            return None
        at, action, why = trial
        return _planned(ImaginedState(np.zeros_like(here), at, action), why)

    def _asked(
        self, frontier: list[ImaginedState], curiosity: Curiosity
    ) -> Iterator[tuple[ImaginedState, int, Signal]]:
        """Yield what to ask of the actions in some states; put down the rest."""
        told = self._experience
        for at in frontier:
            # Where it is now an action is due in any case.
            if at.before is not None and told.is_end(at.place, at.action):
                curiosity.end(at)
                continue
            possible = self._imaginable(at.place)
            for action, signal in enumerate(self._actions.signals(at.place)):
                if possible[action]:
                    yield at, action, signal
                elif told.has_ended(at.place, action):
                    curiosity.end(at, action)
                elif not at.by_chance:
                    curiosity.unknown(at, action)

    def _imaginable(self, state: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return for each action whether all its contexts in a state have been met."""
        met = self._experience.met[self._first :: 2]
        never = self._actions.hold(state) & ~met
        possible = np.ones(len(self._names), np.bool_)
        possible[self._actions.action[never]] = False
        return possible


def _planned(last: ImaginedState, why: str) -> Plan:
    first, *way = last.way()
    return Plan(
        tuple(state.action for state in way),
        np.stack([state.place for state in (first, *way[:-1])]),
        why,
    )
