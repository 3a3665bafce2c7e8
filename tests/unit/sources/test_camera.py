"""Images of an environment, and settings refused before a run starts."""

import io
import re
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Discrete, MultiBinary
from numpy.typing import NDArray
from PIL import Image

from neurosnap.errors import InvalidValueError, MissingExtraError
from neurosnap.sources.camera import Camera, try_camera
from neurosnap.sources.gymnasium_source import GymnasiumSource
from neurosnap.sources.open import open_source

NOISE = np.random.default_rng(0).integers(256, size=(400, 400, 3), dtype=np.uint8)
DRAWN: dict[str, Any] = {
    "noise": NOISE,
    "large": np.resize(NOISE, (2400, 2400, 3)),
    "floats": NOISE[:2, :2] / 256,
    "grey": NOISE[:2, :2, 0],
    "empty": NOISE[:0, :2],
    "nothing": None,
}


class Drawing(gymnasium.Env[NDArray[np.int8], np.int64]):
    """Draws one of `DRAWN`; its render mode is `mode`, if that is given."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(
        self, render_mode: str | None = None, kind: str = "noise", mode: str = ""
    ) -> None:
        self.render_mode = mode or render_mode
        self.observation_space = MultiBinary(2)
        self.action_space = Discrete(2)
        self._kind = kind

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.int8], dict[str, Any]]:
        super().reset(seed=seed, options=options)
        return np.zeros(2, np.int8), {}

    def render(self) -> Any:
        if self._kind == "missing":
            raise gymnasium.error.DependencyNotInstalled("no pencil")
        return DRAWN[self._kind]


gymnasium.register(id="Drawing-v0", entry_point=f"{__name__}:Drawing")


LAKE = "neurosnap/FrozenLake-v0"
DRAWING = "tests.unit.sources.test_camera:Drawing-v0"


def drawn(name: str, **arguments: Any) -> GymnasiumSource:
    source = open_source(name, 3, arguments, None, True)
    assert isinstance(source, GymnasiumSource)
    source.first()
    return source


def test_an_image_is_what_is_drawn() -> None:
    image = Camera(drawn(DRAWING), 1).image(1)
    opened = Image.open(io.BytesIO(image.data))
    assert (opened.format, image.format) == ("PNG", "png")
    np.testing.assert_array_equal(np.asarray(opened), NOISE)


@pytest.mark.parametrize("every", [1, 3])
def test_the_first_tick_has_one_and_each_so_many(every: int) -> None:
    camera = Camera(drawn(DRAWING), every)
    due = [tick for tick in range(1, 10) if camera.is_due(tick)]
    assert due == list(range(1, 10, every))


MODE = "frames: must go with an environment that has the render mode rgb_array"
BYTES = "image: must be an array of bytes, (height, width, 3), got"


@pytest.mark.parametrize(
    ("name", "arguments", "rule"),
    [
        (DRAWING, {"kind": "large"}, "image: must be of at most 16,777,216 bytes"),
        (DRAWING, {"kind": "floats"}, f"{BYTES} (2, 2, 3)"),
        (DRAWING, {"kind": "grey"}, f"{BYTES} (2, 2)"),
        (DRAWING, {"kind": "empty"}, f"{BYTES} (0, 2, 3)"),
        (DRAWING, {"kind": "nothing"}, f"{BYTES} 'NoneType'"),
        ("neurosnap/Path-v0", {}, f"{MODE}, got 'neurosnap/Path-v0'"),
        (DRAWING, {"mode": "ansi"}, MODE),
        (LAKE, {"render_mode": "human"}, "arguments: must not have render_mode where"),
        (DRAWING, {"kind": "missing"}, "frames: must go with an environment that can"),
    ],
)
def test_what_does_not_draw_an_image_is_refused_before_anything_starts(
    name: str, arguments: dict[str, Any], rule: str
) -> None:
    with pytest.raises(InvalidValueError, match=f"^{re.escape(rule)}"):
        try_camera(open_source(name, 3, arguments, None, True), 1)


def test_a_file_of_readings_draws_nothing(tmp_path: Path) -> None:
    table = tmp_path / "readings.csv"
    table.write_text("a,b\n1,0\n")
    source = open_source(str(table), 3, {}, None, True)
    rule = "frames: must be 0 where the source is no Gymnasium environment, got 5"
    with pytest.raises(InvalidValueError, match=rule):
        try_camera(source, 5)
    try_camera(source, 0)


def test_without_pillow_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    source = drawn(DRAWING)
    monkeypatch.setitem(sys.modules, "PIL", None)
    with pytest.raises(MissingExtraError, match=r"neurosnap-uma\[frames\]"):
        Camera(source, 1)
