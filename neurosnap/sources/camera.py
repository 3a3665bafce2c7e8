"""Takes the images that an environment renders.

Drawing changes nothing: what is observed is the same without.
"""

import io
import time

import gymnasium
import numpy as np

from neurosnap import wire
from neurosnap.errors import InvalidValueError, MissingExtraError
from neurosnap.sources.gymnasium_source import GymnasiumSource
from neurosnap.sources.protocol import Source
from neurosnap.system.distribution import must_have


class Camera:
    """Takes an image of an environment every so many ticks, the first at tick 1.

    Raises:
        InvalidValueError: Nothing can be drawn of such a source.
        MissingExtraError: Pillow is not installed.
    """

    def __init__(self, source: Source, every: int) -> None:
        if not isinstance(source, GymnasiumSource):
            rule = "must be 0 where the source is no Gymnasium environment"
            raise InvalidValueError("frames", rule, every)
        try:
            from PIL import Image
        except ImportError as error:
            rule = must_have("pillow", "frames")
            raise MissingExtraError(f"Pillow: {rule}") from error
        self._source = source
        self._every = every
        self._from_array = Image.fromarray

    def is_due(self, tick: int) -> bool:
        """Tell whether there is to be an image of a tick."""
        return (tick - 1) % self._every == 0

    def image(self, tick: int) -> wire.Image:
        """Return an image of the environment as it is now, after observing `tick`.

        Raises:
            InvalidValueError: What the environment draws is no image, or too large.
        """
        sec, nsec = divmod(time.time_ns(), 1_000_000_000)
        drawn = self._source.render()
        shape = getattr(drawn, "shape", type(drawn).__name__)
        if getattr(drawn, "dtype", None) != np.uint8 or shape[2:] != (3,) or 0 in shape:
            rule = "must be an array of bytes, (height, width, 3)"
            raise InvalidValueError("image", rule, shape)
        packed = io.BytesIO()
        self._from_array(drawn).save(packed, "PNG")
        if packed.tell() > wire.LARGEST_IMAGE:
            rule = f"must be of at most {wire.LARGEST_IMAGE:,} bytes as PNG"
            raise InvalidValueError("image", rule, packed.tell())
        data = packed.getvalue()
        return wire.Image(tick, wire.Timestamp(sec, nsec), "world", data, "png")


def try_camera(source: Source, every: int) -> None:
    """Draw a source before it is used, so that a run is refused before it starts.

    The source is reset. `every` is as of `Camera`; 0: nothing is to be drawn.

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
