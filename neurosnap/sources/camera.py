"""Images of an environment, as it draws itself.

Drawing changes nothing: what is observed is the same without.
"""

import io
import time
from collections.abc import Callable
from typing import Any, TypeAlias

import gymnasium
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import InvalidValueError, MissingExtraError
from neurosnap.sources.gymnasium_source import GymnasiumSource
from neurosnap.sources.protocol import Source
from neurosnap.system.distribution import must_have

_LARGE = 1 << 18
"""Bytes of a PNG beyond which a JPEG takes its place: it has a picture of the world and
no diagram in it."""
_QUALITY = 90
_SECOND = 1_000_000_000

_Pixels: TypeAlias = NDArray[np.uint8]
_Compress: TypeAlias = Callable[[_Pixels], tuple[bytes, wire.ImageFormat]]


class Camera:
    """Takes an image of an environment each so many ticks.

    Args:
        source: What was opened to be drawn.
        every: Ticks from one image to the next, the first at tick 1.

    Raises:
        InvalidValueError: Nothing can be drawn of such a source.
        MissingExtraError: Pillow is not installed.
    """

    def __init__(self, source: Source, every: int) -> None:
        if not isinstance(source, GymnasiumSource):
            rule = "must be 0 where the source is no Gymnasium environment"
            raise InvalidValueError("frames", rule, every)
        self._source = source
        self._every = every
        self._compress = _compressor()

    def is_due(self, tick: int) -> bool:
        """Tell whether there is to be an image of a tick."""
        return (tick - 1) % self._every == 0

    def image(self, tick: int) -> wire.Image:
        """Return an image of the environment as it is now.

        Args:
            tick: That of the last observation.

        Raises:
            InvalidValueError: What the environment draws is no image, or too large.
        """
        sec, nsec = divmod(time.time_ns(), _SECOND)
        data, kind = self._compress(_checked(self._source.render()))
        return wire.Image(tick, wire.Timestamp(sec, nsec), "world", data, kind)


def try_camera(source: Source, every: int) -> None:
    """Draw a source before it is used, so that a run is refused before it starts.

    Args:
        source: It is reset.
        every: As of `Camera`; 0: nothing is to be drawn.

    Raises:
        NeurosnapError: As `Camera`, and its `image`; or the environment cannot draw.
    """
    if not every:
        return
    camera = Camera(source, every)
    source.first()
    try:
        camera.image(1)
    except (ImportError, NotImplementedError, gymnasium.error.Error) as error:
        rule = f"must go with an environment that can draw itself ({error})"
        raise InvalidValueError("frames", rule, every) from error


def _compressor() -> _Compress:
    """Return what compresses an image.

    Raises:
        MissingExtraError: Pillow is not installed.
    """
    try:
        from PIL import Image
    except ImportError as error:
        rule = must_have("pillow", "frames")
        raise MissingExtraError(f"Pillow: {rule}") from error

    def compress(pixels: _Pixels) -> tuple[bytes, wire.ImageFormat]:
        image, packed = Image.fromarray(pixels), io.BytesIO()
        image.save(packed, "PNG")
        if packed.tell() <= _LARGE:
            return packed.getvalue(), "png"
        packed = io.BytesIO()
        image.save(packed, "JPEG", quality=_QUALITY)
        return packed.getvalue(), "jpeg"

    return compress


def _checked(drawn: Any) -> _Pixels:  # noqa: ANN401 - whatever was drawn
    if (
        not isinstance(drawn, np.ndarray)
        or drawn.dtype != np.uint8
        or drawn.ndim != 3
        or drawn.shape[2] != 3
        or not drawn.size
    ):
        rule = "must be an array of bytes, (height, width, 3)"
        shape = getattr(drawn, "shape", type(drawn).__name__)
        raise InvalidValueError("image", rule, shape)
    if drawn.size > wire.LARGEST_IMAGE:
        rule = f"must be of at most {wire.LARGEST_IMAGE // 3:,} pixels"
        raise InvalidValueError("image", rule, drawn.shape)
    return drawn
