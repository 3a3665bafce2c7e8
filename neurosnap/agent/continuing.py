"""Environments whose episodes follow each other without an end."""

from typing import Any, SupportsFloat

import gymnasium
from gymnasium.wrappers import Autoreset


class Continuing(Autoreset):
    """An environment that goes on: the step after an episode's end begins the next.

    As in `gymnasium.wrappers.Autoreset`: that step resets, whatever the action is, with
    reward 0.0. But no end is ever reported. An action that is ignored is no action:
    what is observed then is no consequence of it, and whoever learns from actions has
    to know.

    Info says `begins`: whether the observation is a reset's, the caller's or its own,
    or of one the environment says so of; `episode`, counted from 0 since the last reset
    by the caller; and `cut`, whether the episode before was cut off by a limit, and did
    not come to its own end.

    Args:
        env: Whose episodes are to follow each other.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self._episode = 0
        self._cut = False  # the episode that is over

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Reset the environment and count its episodes from 0."""
        self._episode = 0
        observation, info = super().reset(seed=seed, options=options)
        told = {"episode": self._episode, "begins": True, "cut": False}
        return observation, {**info, **told}

    def step(
        self,
        action: Any,  # noqa: ANN401 - the environment knows
    ) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Step the environment, or reset it if its episode is over."""
        resets = self.autoreset
        self._episode += resets
        observation, reward, ends, cut, info = super().step(action)
        begins = bool(resets or info.get("begins", False))
        told = {"episode": self._episode, "begins": begins, "cut": resets and self._cut}
        self._cut = bool(cut) and not ends
        return observation, reward, False, False, {**info, **told}
