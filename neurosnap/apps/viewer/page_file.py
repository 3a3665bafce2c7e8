"""A run's page as one file that opens anywhere, with all that it can show.

It holds the page's modules, and the answers to what they ask, packed; ``file.js``
unpacks them. Its policy allows what has these hashes, and no network.
"""

import re
import zlib
from base64 import b64encode
from collections.abc import Iterable, Iterator
from hashlib import sha256
from pathlib import Path

import msgspec

from neurosnap.apps.new_files import placed
from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.background_reading import RunHistory
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_difference import compared
from neurosnap.apps.viewer.time_series import MOST_COLUMNS
from neurosnap.errors import InvalidValueError

MOST_TICKS = 2000
MOST_BYTES = 10_000_000
_INSTEAD = "neurosnap view shows longer ones"
_AT_ONCE = 30
"""Ticks read at a time, at most."""
_SENSORS = 200
"""Sensors in a part of the raster, as the page asks for them."""
_STATIC = Path(__file__).parent / "static"
_IMPORT = re.compile(r'^import (?:\* as (\w+)|(\{[^}]*\})) from "(.+)";$', re.MULTILINE)
_EXPORT = re.compile(
    r"^export (?=(?:async )?(?:const|function|class) (\w+))", re.MULTILINE
)


def write_page(log: Path, out: Path, *, force: bool = False) -> None:
    """Write the page of a recording as one file. It is read some ticks at a time.

    Args:
        log: The recording.
        out: The file.
        force: Replace what is there.

    Raises:
        InvalidValueError: There are too many ticks, they take too much room, or a file
            is there already.
        RecordingError: The recording cannot be read.
    """
    view = RunView(log)
    ticks = view.last - view.first + 1
    if not 1 <= ticks <= MOST_TICKS:
        rule = f"must have 1 to {MOST_TICKS} ticks to be a page ({_INSTEAD})"
        raise InvalidValueError(str(log), rule, ticks)
    script = bundled("main.js", {})
    before, after = _page(script).split("</body>")
    reads = [file.path for file in view.recording.files]
    with placed(out, force=force, reads=reads) as draft, draft.open("wb") as file:
        for part in _packed(before, _answers(view, script), after):
            file.write(part)
            if file.tell() > MOST_BYTES:
                rule = f"must be at most {MOST_BYTES / 1e6:.0f} MB ({_INSTEAD})"
                raise InvalidValueError("out", rule, f"more, of {ticks} ticks")


def _packed(
    before: str, answers: Iterable[tuple[str, object]], after: str
) -> Iterator[bytes]:
    """Yield the file: the page, and in it a line for each answer, as gzip in base64."""
    packer, rest = zlib.compressobj(9, wbits=31), b""
    yield before.encode() + b'<script id="packed" type="text/plain">'
    for question, answer in answers:
        line = question.encode() + b"\t" + msgspec.json.encode(answer) + b"\n"
        rest += packer.compress(line)
        whole = len(rest) // 3 * 3
        yield b64encode(rest[:whole])
        rest = rest[whole:]
    yield b64encode(rest + packer.flush()) + b"</script>\n"
    loader = _text("file.js")
    yield f'<script type="module">{loader}</script>\n</body>{after}'.encode()


def _answers(view: RunView, script: str) -> Iterator[tuple[str, object]]:
    """Yield all that is packed, by what it answers."""
    first, last = view.first, view.last
    yield "script", script
    yield "run", view.run(live=False)
    yield "runs", api.Runs([api.Listed(name=view.path.name, live=False)])
    yield "presence", api.Presence(None)
    known: dict[str, api.Graph] = {}
    orders: dict[int, str] = {}
    before: api.Frame | None = None
    step = view.at_once(_AT_ONCE)
    for start in range(first, last + 1, step):
        for frame in view.frames(start, start + step - 1):
            yield from _of_tick(view, frame, before, known)
            before, orders[frame.tick] = frame, frame.graph
    history = RunHistory(RunView(view.path, view))
    while history.read_on():
        pass
    for tick, order in orders.items():
        if order:
            yield f"tested {tick}", history.tested(tick, known[order])
    yield "series", history.series(first, last, api.MOST_POINTS)
    yield "marks", history.marks(first, last, MOST_TICKS)
    yield "births", history.grown()
    yield "findings", history.findings()
    yield "depths", history.depths()
    for sensor in range(0, view.options.body.count, _SENSORS):
        part = history.raster(first, last, MOST_COLUMNS, sensor, _SENSORS)
        yield f"raster {sensor}", part


def _of_tick(
    view: RunView,
    frame: api.Frame,
    before: api.Frame | None,
    known: dict[str, api.Graph],
) -> Iterator[tuple[str, object]]:
    """Yield what there is of a tick; its order, unless that is `known`."""
    tick = frame.tick
    yield f"frame {tick}", frame
    image = view.image(tick)
    if image is not None and image.tick == tick:
        data = b64encode(image.data).decode()
        yield f"image {tick}", f"data:image/{image.format};base64,{data}"
    if not frame.graph:
        return  # the order cannot be known
    graph = view.graph(tick)
    if frame.graph not in known:
        known[frame.graph] = graph
        yield f"graph {frame.graph}", graph
    yield f"edges {tick}", [view.edge(e.source, e.target, tick) for e in graph.edges]
    if before is not None and before.graph:
        ends = view.learned(tick), frame, view.learned(before.tick), before
        yield f"difference {tick} {before.tick}", compared(*ends)


def bundled(name: str, done: dict[str, str]) -> str:
    """Return a module and all that it imports as one script.

    Args:
        name: The module, a path below `_STATIC`.
        done: Modules that are there already; gains this one and what it imports.
    """

    def imported(found: re.Match[str]) -> str:
        path = (_STATIC / name).parent / found[3]
        other = path.resolve().relative_to(_STATIC).as_posix()
        if other not in done:
            bundled(other, done)
        names = found[1] or found[2].replace(" as ", ": ")
        return f"const {names} = modules['{other}'];"

    text = _IMPORT.sub(imported, _text(name))
    names = ", ".join(_EXPORT.findall(text))
    body = f"{_EXPORT.sub('', text)}\nreturn {{ {names} }};"
    done[name] = f"modules['{name}'] = await (async () => {{\n{body}\n}})();\n"
    charts = _text("vendor/uplot/uPlot.iife.min.js")
    start = f"{charts}\nwindow.uPlot = uPlot;\nconst modules = {{}};\n"
    return start + "".join(done.values())


def _page(script: str) -> str:
    """Return the page with its style, and a policy for that and for the scripts."""
    style = _text("vendor/uplot/uPlot.min.css") + _text("style.css")
    allowed = [
        f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"
        for text in (_text("file.js"), script, style)
    ]
    policy = (
        f"default-src 'none'; script-src {allowed[0]} {allowed[1]}; style-src"
        f" {allowed[2]}; img-src data:; base-uri 'none'; form-action 'none'"
    )
    meta = f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
    page = re.sub(r"\n *<(?:link|script) .*", "", _text("index.html"))
    return page.replace("<title>", f"{meta}\n<style>{style}</style>\n<title>", 1)


def _text(name: str) -> str:
    return (_STATIC / name).read_text(encoding="utf-8")
