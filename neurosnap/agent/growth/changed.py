"""The notice to users that a sensor was grown, or retired."""

import msgspec


class Changed(msgspec.Struct, frozen=True):
    """A sensor that was grown, or is read no more, as people are told of it."""

    tick: int
    """The tick whose decision says so; it is so from the next observation on."""
    sensor: int
    """Its number."""
    name: str
    """Its formula."""
    retires: bool = False
    """Whether it is read no more; else it was grown."""
