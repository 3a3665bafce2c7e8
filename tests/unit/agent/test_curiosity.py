"""The agent explores one of the actions whose results it has computed."""

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.curiosity import Curiosity, Trial
from neurosnap.agent.experience import BEGINNING, Experience
from neurosnap.agent.plan import ImaginedState

BODY = Body.full(["a", "b", "c"], ["go", "stay"])


def place(number: int) -> NDArray[np.bool_]:
    found = np.zeros(2 * len(BODY.sensors), np.bool_)
    for sensor in range(3):
        found[2 * sensor + (not number >> sensor & 1)] = True
    return found


def states(count: int) -> list[ImaginedState]:
    """A way from the first of them to the last."""
    found = [ImaginedState(place(0))]
    for number in range(1, count):
        found.append(ImaginedState(place(number), found[-1], 0, number))
    return found


def choices(curiosity: Curiosity) -> set[tuple[int, int, str]]:
    """What may be tried: the steps there, the action, and why."""
    found: list[Trial | None] = [
        curiosity.choice(draw) for draw in np.arange(0, 1, 1 / 32).tolist()
    ]
    return {
        (trial[0].steps, trial[1], trial[2].split(" ")[1])
        for trial in found
        if trial is not None
    }


def test_the_nearest_unknown_outcomes_are_equal() -> None:
    curiosity = Curiosity(Experience(BODY), BODY.actions, aims=False)
    here, near, far = states(3)
    assert not choices(curiosity)
    assert not curiosity.is_settled(0)
    curiosity.unknown(far, 0)
    curiosity.unknown(near, 1)
    curiosity.unknown(near, 0)
    assert choices(curiosity) == {(1, 0, "learn"), (1, 1, "learn")}
    assert not curiosity.is_settled(0)
    assert curiosity.is_settled(1)
    curiosity.unknown(here, 1)
    assert choices(curiosity) == {(0, 1, "learn")}
    assert curiosity.is_settled(0)


def test_a_known_outcome_is_as_good_as_it_surprised_before() -> None:
    experience = Experience(BODY)
    here, near, far = states(3)
    experience.surprises[0] += (1, False)  # a third
    curiosity = Curiosity(experience, BODY.actions, aims=False)
    curiosity.unknown(far, 1)
    curiosity.known(here, 0)
    assert choices(curiosity) == {(0, 0, "test"), (2, 1, "learn")}  # a third a step
    curiosity.known(near, 1)  # half a surprise in two steps
    assert choices(curiosity) == {(0, 0, "test"), (2, 1, "learn")}
    curiosity.known(here, 1)
    assert choices(curiosity) == {(0, 1, "test")}


def test_what_was_seen_is_seen_again_if_there_is_nothing_else() -> None:
    experience = Experience(BODY)
    here, near, far = states(3)
    for state in (here, near):
        experience.leave(state.place, ends=False, action=0)
    curiosity = Curiosity(experience, BODY.actions, aims=False)
    curiosity.known(here, 0)
    curiosity.known(near, 0)
    assert choices(curiosity) == {(0, 0, "test"), (1, 0, "test")}
    curiosity.end(far)
    found = choices(curiosity)
    assert {(0, 0, "test"), (1, 0, "test")} < found
    assert {way for _, _, way in found} == {"test", "begin"}
    curiosity.known(near, 1)
    assert choices(curiosity) == {(1, 1, "test")}


def test_another_episode_is_begun_where_many_began_at_new_places() -> None:
    experience = Experience(BODY)
    experience.surprises[0] += (1, False)
    here, near, _ = states(3)
    curiosity = Curiosity(experience, BODY.actions, aims=False)
    curiosity.known(here, 0)  # a third
    curiosity.end(near)  # a half in two steps
    assert choices(curiosity) == {(0, 0, "test")}
    for _ in range(8):
        experience.surprises[BEGINNING] += (1, True)
    assert choices(curiosity) == {(1, 0, "begin"), (1, 1, "begin")}
    # Where only one action is known to end the episode, it is that one.
    other = Curiosity(experience, BODY.actions, aims=False)
    other.known(here, 0)
    other.end(near, 1)
    assert choices(other) == {(1, 1, "begin")}


def test_who_has_a_target_tests_nothing_and_ends_no_episode() -> None:
    here, near, far = states(3)
    curiosity = Curiosity(Experience(BODY), BODY.actions, aims=True)
    curiosity.known(here, 0)
    assert not choices(curiosity)
    curiosity.end(near)
    assert not choices(curiosity)
    other = Curiosity(Experience(BODY), BODY.actions, aims=True)
    other.end(near)
    other.unknown(far, 1)
    assert not other.is_settled(5)  # a plan to the target may be longer
    assert choices(other) == {(2, 1, "learn")}
