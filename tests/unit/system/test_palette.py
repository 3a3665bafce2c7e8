"""Colours can be told apart in print and by the colour-blind."""

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap.system.picture import MANY

Floats = NDArray[np.float64]

# Machado, Oliveira & Fernandes 2009, table 1, severity 1.0; of linear RGB.
SEEN_BY = {
    "everybody": np.eye(3),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
}
# sRGB to CIE XYZ, and the white of D65.
_XYZ = np.array(
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
)
_WHITE = _XYZ.sum(axis=1)


def lab(colour: str, seen_by: str = "everybody") -> Floats:
    """Return a colour in CIE L*a*b*, in which 2.3 is a difference just noticed."""
    c = np.array([*bytes.fromhex(colour[1:])]) / 255
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    xyz = _XYZ @ np.clip(SEEN_BY[seen_by] @ linear, 0, 1) / _WHITE
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def closest(colours: tuple[str, ...], seen_by: str) -> float:
    places = [lab(colour, seen_by) for colour in colours]
    pairs = itertools.combinations(places, 2)
    return min(float(np.linalg.norm(one - two)) for one, two in pairs)


@pytest.mark.parametrize("seen_by", SEEN_BY)
def test_colours_stay_apart_also_in_grey(seen_by: str) -> None:
    assert closest(MANY, seen_by) > 25
    assert np.diff(sorted(lab(colour)[0] for colour in MANY)).min() > 9
