"""The worlds of a checkout, under the name that they have in a wheel."""

import sys

import world

sys.modules[__name__] = world
