"""A world that draws noise, or what is no image."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Discrete, MultiBinary
from numpy.typing import NDArray


class Drawing(gymnasium.Env[NDArray[np.int8], np.int64]):
    """Two sensors, which count; what it draws is another thing at each step.

    Args:
        render_mode: As in Gymnasium.
        height: Of what is drawn.
        width: Likewise.
        kind: What is drawn: ``noise``, ``floats``, ``grey``, ``nothing``, ``missing``.
        mode: The render mode that it takes instead; empty: none.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(
        self,
        render_mode: str | None = None,
        height: int = 8,
        width: int = 8,
        kind: str = "noise",
        mode: str = "",
    ) -> None:
        self.render_mode = mode or render_mode
        self.observation_space = MultiBinary(2)
        self.action_space = Discrete(2)
        self._shape = height, width, 3
        self._kind = kind
        self._step = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.int8], dict[str, Any]]:
        super().reset(seed=seed, options=options)
        self._step = 0
        return self._seen(), {}

    def step(
        self, action: np.int64
    ) -> tuple[NDArray[np.int8], float, bool, bool, dict[str, Any]]:
        self._step += 1
        return self._seen(), 0.0, False, False, {}

    def render(self) -> Any:
        drawn = np.random.default_rng(self._step).integers(256, size=self._shape)
        match self._kind:
            case "floats":
                return drawn / 256
            case "grey":
                return drawn[:, :, 0].astype(np.uint8)
            case "nothing":
                return None
            case "missing":
                raise gymnasium.error.DependencyNotInstalled("no pencil")
            case _:
                return drawn.astype(np.uint8)

    def _seen(self) -> NDArray[np.int8]:
        return np.array([self._step & 1, self._step >> 1 & 1], np.int8)


gymnasium.register(id="Drawing-v0", entry_point=f"{__name__}:Drawing")
