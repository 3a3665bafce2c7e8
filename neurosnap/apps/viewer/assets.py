"""Static files of the page; no other file is served."""

from functools import cache
from importlib.resources import files

from starlette.responses import Response

PAGE = "index.html"
NAMES = (
    PAGE,
    "style.css",
    "icon.svg",
    "vendor/uplot/uPlot.esm.js",
    "vendor/uplot/uPlot.min.css",
    *(
        f"{module}.js"
        for module in (
            "address",
            "alarms",
            "anomaly",
            "api",
            "background",
            "belief",
            "camera",
            "cells",
            "changes",
            "chart",
            "choice",
            "compare",
            "compare_curves",
            "consequences",
            "csv",
            "diagram",
            "dom",
            "edge",
            "edge_list",
            "facts",
            "files",
            "focus",
            "hatch",
            "groups",
            "growth",
            "health",
            "image",
            "keys",
            "late",
            "layers",
            "layout",
            "link",
            "links",
            "literals",
            "live",
            "looks",
            "main",
            "nodes",
            "orders",
            "outline",
            "painting",
            "palette",
            "plan",
            "picture",
            "player",
            "plots",
            "pointer",
            "presence",
            "pulses",
            "first_view",
            "frames",
            "glide",
            "range",
            "raster",
            "reach",
            "runs",
            "search",
            "strip",
            "summaries",
            "svg_context",
            "tabs",
            "terms",
            "theme",
            "tiles",
            "timeline",
            "voice",
            "wave",
            "wave_advice",
            "world",
        )
    ),
)
"""All there are, below ``static/``; a file that is not here is not there."""

_TYPES = {
    "css": "text/css",
    "html": "text/html",
    "js": "text/javascript",
    "svg": "image/svg+xml",
}


def asset(name: str) -> Response | None:
    """Return the file of a name, ``""`` for the page itself; None: there is none."""
    known = name or PAGE
    if known not in NAMES:
        return None
    kind = _TYPES[known.rpartition(".")[2]]
    return Response(_content(known), media_type=kind)


@cache
def _content(name: str) -> bytes:
    """Return what is in one of `NAMES`."""
    return (
        (files("neurosnap.apps.viewer") / "static")
        .joinpath(*name.split("/"))
        .read_bytes()
    )
