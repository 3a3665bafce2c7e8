"""Makes the worlds of a checkout importable under their installed name."""

import sys

import world

sys.modules[__name__] = world
