"""Pictures of the theory: a poc set's Hasse diagram and its dual, side by side.

All lengths are in inches: what is drawn is measured first and the page is made to fit,
so that no text runs into another or over the edge, however much there is.
"""
