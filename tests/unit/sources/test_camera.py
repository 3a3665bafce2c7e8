"""Images of an environment: what it draws, and what is refused before a run starts."""

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

from neurosnap import wire
from neurosnap.errors import InvalidValueError, MissingExtraError
from neurosnap.sources.camera import Camera, try_camera
from neurosnap.sources.gymnasium_source import GymnasiumSource
from neurosnap.sources.open import open_source


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


LAKE = "neurosnap/FrozenLake-v0"
DRAWING = "tests.unit.sources.test_camera:Drawing-v0"


def drawn(name: str, **arguments: Any) -> GymnasiumSource:
    source = open_source(name, 3, arguments, None, True)
    assert isinstance(source, GymnasiumSource)
    source.first()
    return source


def pixels(image: wire.Image) -> NDArray[np.uint8]:
    opened = Image.open(io.BytesIO(image.data))
    assert opened.format is not None
    assert opened.format.lower() == image.format
    return np.asarray(opened)


def test_what_is_no_diagram_is_a_jpeg() -> None:
    source = drawn(DRAWING, height=400, width=400)
    image = Camera(source, 1).image(1)
    assert image.format == "jpeg"
    assert len(image.data) < 400 * 400 * 3
    found, was = pixels(image), source.render()
    assert found.shape == was.shape
    # It is noise, of which a JPEG keeps the brightness about.
    assert abs(float(found.mean()) - float(was.mean())) < 3
    source.close()


@pytest.mark.parametrize("every", [1, 3])
def test_the_first_tick_has_one_and_each_so_many(every: int) -> None:
    source = drawn(LAKE)
    camera = Camera(source, every)
    due = [tick for tick in range(1, 10) if camera.is_due(tick)]
    assert due == list(range(1, 10, every))
    source.close()


@pytest.mark.parametrize(
    ("height", "width", "kind", "rule"),
    [
        (3000, 3000, "noise", r"image: must be of at most 5,592,405 pixels, got"),
        (2, 2, "floats", r"image: must be an array of bytes, \(height, width, 3\)"),
        (2, 2, "grey", r"image: must be an array of bytes, .* got \(2, 2\)"),
        (0, 2, "noise", r"image: must be an array of bytes, .* got \(0, 2, 3\)"),
        (2, 2, "nothing", r"image: must be an array of bytes, .* got 'NoneType'"),
    ],
)
def test_what_is_no_image_is_refused_before_anything_starts(
    height: int, width: int, kind: str, rule: str
) -> None:
    arguments: dict[str, Any] = {"height": height, "width": width, "kind": kind}
    source = open_source(DRAWING, 3, arguments, None, True)
    with pytest.raises(InvalidValueError, match=rule):
        try_camera(source, 1)
    source.close()


MODE = "frames: must go with an environment that has the render mode rgb_array"


@pytest.mark.parametrize(
    ("name", "arguments", "rule"),
    [
        ("neurosnap/Path-v0", {}, f"{MODE}, got 'neurosnap/Path-v0'"),
        ("neurosnap/Cycle-v0", {}, f"{MODE}, got 'neurosnap/Cycle-v0'"),
        (DRAWING, {"mode": "ansi"}, MODE),
        (
            LAKE,
            {"render_mode": "human"},
            "arguments: must not have render_mode where frames are recorded,"
            " got 'human'",
        ),
        (
            DRAWING,
            {"kind": "missing"},
            "frames: must go with an environment that can draw itself (no pencil)",
        ),
    ],
)
def test_what_does_not_draw_is_refused(
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
    source.close()


def test_without_pillow_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    source = drawn(LAKE)
    monkeypatch.setitem(sys.modules, "PIL", None)
    with pytest.raises(MissingExtraError, match=r"neurosnap-uma\[frames\]"):
        Camera(source, 1)
    source.close()
