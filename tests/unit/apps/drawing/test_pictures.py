"""Pictures: what is parallel, what keeps its distance, and that text is readable."""

import functools
import itertools
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from neurosnap.apps.drawing import dual_view, page
from neurosnap.apps.drawing.cube_layers import layers
from neurosnap.apps.drawing.dual_layout import Layout, lay_out
from neurosnap.apps.drawing.dual_panel import THIN
from neurosnap.apps.drawing.dual_view import View
from neurosnap.apps.drawing.find_model import find, listed
from neurosnap.apps.drawing.measures import in_words, measure
from neurosnap.apps.drawing.page import draw_model, figure_of
from neurosnap.apps.drawing.rank_layout import ranks, stand
from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.poc.order.pocset import PocSet

NAMES = list(listed())
OWN = [
    "a :",
    "a, b, c, d",
    "a, b, c : a = b*, c < a",
    "x, y : x <= x*",
    "a, b, c, d, e : a < b < c, d < c*, e < a*",
    "US$, $b$, a name that is too long to be shown in full : US$ < $b$",
]


_layouts: dict[tuple[object, ...], Layout] = {}


def layout_once(*given: Any) -> Layout:
    """Do as `lay_out`, but only once for the same dual: it is most of the work."""
    *arrays, level = given
    key = (level, *((array.shape, array.tobytes()) for array in arrays))
    if key not in _layouts:
        _layouts[key] = lay_out(*given)
    return _layouts[key]


@pytest.fixture(autouse=True)
def duals_are_laid_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dual_view, "lay_out", layout_once)


@functools.cache
def figure_once(text: str) -> Any:
    """Return the picture of a model, not on a canvas yet: it is the other half."""
    model = find(text)
    return figure_of(model, measure(model))


@functools.cache
def view_of(text: str) -> View:
    model = find(text)
    assert model.vertices is not None
    return View.of(model.poc, model.vertices, level=model.level, seen=model.witnessed)


# Layout -------------------------------------------------------------------------------


@pytest.mark.parametrize("text", NAMES + OWN)
def test_edges_across_one_sensor_are_parallel_and_vertices_apart(text: str) -> None:
    view = view_of(text)
    points = view.points
    for (i, j), k in zip(view.edges.tolist(), view.crossed.tolist(), strict=True):
        way = view.layout.directions[k]
        sign = 1 if view.corners[j, k] else -1
        np.testing.assert_allclose(points[j] - points[i], sign * way, atol=1e-9)
    one, two = np.triu_indices(len(points), 1)
    assert (np.linalg.norm(points[one] - points[two], axis=1) > 0.3).all()
    for a, b in view.edges.tolist():
        others = np.delete(points, [a, b], axis=0)
        side, away = points[b] - points[a], others - points[a]
        t = np.clip(away @ side / (side @ side), 0, 1)
        assert (np.linalg.norm(away - t[:, None] * side, axis=1) > 0.12).all()


@pytest.mark.parametrize("text", NAMES + OWN)
def test_sensors_have_different_colours_and_squares_are_no_slivers(text: str) -> None:
    view = view_of(text)
    assert len(set(view.colours)) == len(view.own)
    for p, q in view.sides.tolist():
        one, two = view.layout.directions[[p, q]]
        sine = abs(one[0] * two[1] - one[1] * two[0])
        assert sine / np.linalg.norm(one) / np.linalg.norm(two) > 0.3


@pytest.mark.parametrize(
    ("text", "families"), [("thresholds", 1), ("grid", 2), ("six-wide-arcs", 3)]
)
def test_a_path_is_straight_and_a_grid_a_grid(text: str, families: int) -> None:
    layout = view_of(text).layout
    assert layout.families.max() + 1 == families
    for family in range(families):
        own = layout.directions[layout.families == family]
        np.testing.assert_allclose(
            np.abs(own), np.abs(own[:1]).repeat(len(own), 0), atol=1e-9
        )


def test_a_picture_is_the_same_every_time(monkeypatch: pytest.MonkeyPatch) -> None:
    one = view_of("path-with-motion")
    monkeypatch.setattr(dual_view, "lay_out", lay_out)
    two = view_of.__wrapped__("path-with-motion")
    np.testing.assert_array_equal(one.points, two.points)


def test_layers_hold_every_vertex_once_and_no_cube() -> None:
    view = view_of("six-wide-arcs")
    found = layers(view)
    assert len(found) == 3
    assert (np.sum([chosen for _, chosen in found], axis=0) == 1).all()
    assert [int(chosen.sum()) for _, chosen in found] == [9, 9, 9]
    assert layers(view_of("grid")) == []


def test_vertices_are_named_after_what_does_not_follow() -> None:
    view = view_of("a, b, c : a < b, a < c*")
    names = {view.name(k): view.corners[k].tolist() for k in range(len(view.corners))}
    assert names["a"] == [True, True, False]
    assert names["∅"] == [False, False, False]
    assert names["b c"] == [False, True, True]


# Hasse diagrams -----------------------------------------------------------------------


def order(text: str) -> tuple[np.ndarray, np.ndarray]:
    poc = find(text).poc if text in NAMES else PocSet.parse(text)
    heads = np.unique(poc.graph.representative).tolist()
    number = {a: k for k, a in enumerate(heads)}
    pairs = [(number[a], number[b]) for a, b in poc.hasse()]
    mates = [number[a ^ 1] for a in heads]
    return np.array(pairs, np.int64).reshape(-1, 2), np.array(mates, np.int64)


@pytest.mark.parametrize("text", NAMES + OWN)
def test_what_is_below_stands_below_and_complements_opposite(text: str) -> None:
    covers, mates = order(text)
    rank = ranks(covers, len(mates))
    np.testing.assert_array_equal(rank[mates], -rank)
    for low, high in covers.tolist():
        assert rank[low] <= rank[high] - 1


@pytest.mark.parametrize("text", NAMES + OWN)
def test_boxes_of_a_rank_do_not_touch(text: str) -> None:
    covers, mates = order(text)
    widths = 0.3 + 0.1 * (np.minimum(np.arange(len(mates)), mates) % 7)
    stood = stand(covers, widths, mates)
    for a, b in itertools.combinations(range(len(mates)), 2):
        if stood.rank[a] == stood.rank[b]:
            gap = abs(stood.across[a] - stood.across[b])
            assert gap > (widths[a] + widths[b]) / 2 + 0.05
    for (low, high), line in zip(covers.tolist(), stood.lines, strict=True):
        ends = [[stood.across[a], stood.rank[a]] for a in (low, high)]
        np.testing.assert_allclose(line[[0, -1]], ends, atol=1e-9)


# Pages --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("text", NAMES + OWN)
def test_no_text_runs_into_another_or_over_the_edge(text: str) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    model = find(text)
    figure = figure_once(text)
    canvas: Any = FigureCanvasAgg(figure)
    bounds = figure.bbox
    boxes: list[tuple[str, Any]] = []
    for shown in figure.axes[0].texts:
        if shown.get_text():
            box = shown.get_window_extent(canvas.get_renderer())
            assert bounds.x0 <= box.x0 <= box.x1 <= bounds.x1, shown.get_text()
            assert bounds.y0 <= box.y0 <= box.y1 <= bounds.y1, shown.get_text()
            boxes.append((shown.get_text(), box.padded(-1)))
    for (one, here), (two, there) in itertools.combinations(boxes, 2):
        assert not here.overlaps(there), (one, two)
    texts = {text for text, _ in boxes}
    assert {model.title, "Order (Hasse diagram)", "Dual (model space)"} <= texts


@pytest.mark.slow
@pytest.mark.parametrize("text", NAMES)
def test_every_named_model_is_drawn_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    monkeypatch.setattr(page, "figure_of", lambda *_: figure_once(text))
    path = tmp_path / "picture.png"
    path.write_text("what was there before")
    model = find(text)
    draw_model(model, measure(model), path)
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    assert b"IEND" in data[-12:]
    assert len(data) > 20_000
    assert list(tmp_path.iterdir()) == [path]


def test_a_picture_that_fails_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def write_half(path: Path, data: bytes) -> int:
        with path.open("wb") as file:
            file.write(data[: len(data) // 2])
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr(Path, "write_bytes", write_half)
    path = tmp_path / "picture.png"
    path.write_text("what was there before")
    model = find("simple")
    with pytest.raises(OSError, match="No space"):
        draw_model(model, measure(model), path)
    assert path.read_text() == "what was there before"
    assert list(tmp_path.iterdir()) == [path]


def test_without_matplotlib_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    model = find("simple")
    with pytest.raises(NeurosnapError, match=r"^picture: .*neurosnap-uma\[plot\]"):
        draw_model(model, measure(model), tmp_path / "picture.png")
    assert not list(tmp_path.iterdir())


# Models -------------------------------------------------------------------------------


def test_the_compass_measures_what_the_paper_says() -> None:
    narrow, wide = measure(find("six-arcs")), measure(find("six-wide-arcs"))
    assert narrow.faces == (13, 18, 6)
    assert narrow.betti == (1, 0, 0)
    assert wide.faces == (27, 54, 36, 8)
    assert wide.betti == (1, 0, 0, 0)
    for numbers in (narrow, wide):
        assert numbers.punctured_faces == (12, 12)
        assert numbers.punctured_betti == (1, 1)
    assert "1 square ·" in in_words(measure(find("simple")))[0]


def test_marks_are_what_the_figures_mark() -> None:
    assert [mark.sign for mark in find("grid").marks] == ["u", "v", "w", "m"]
    assert [mark.kind for mark in find("six-arcs").marks] == ["puncture"]
    assert [mark.kind for mark in find("beacons").marks] == ["split"]
    bad = find("bad-dual")
    assert bad.target is not None
    steps = [bad.cubing.distance(bad.marks[i].vertex, bad.marks[j].vertex)
             for i, j in bad.joined]  # fmt: skip
    assert sorted(steps) == [1, 2]  # an edge goes to a diagonal


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("six-arc", r"^model: .*did you mean six-arcs"),
        ("nothing like it", "^model: must be a name of --list"),
        ("a, b : a < a*, a* < a", "^relations: must not make a literal"),
        ("a, b : a < b < a", "^relations: must have no cycle"),
        ("a, b : a < q", "q"),
        (",", "^sensor name"),
        (":", "^poc set: must have from 1 to 4,000 elements; keep .* --only, got 0"),
        (",".join(f"s{k}" for k in range(9)), "^dual: must have at most 256 vertices"),
        (",".join(f"s{k}" for k in range(2001)), r"^poc set: .* got 4002$"),
    ],
)
def test_what_cannot_be_drawn_is_refused(text: str, message: str) -> None:
    with pytest.raises(InvalidValueError, match=message):
        measure(find(text))


def test_what_nobody_could_read_is_refused_with_its_number(tmp_path: Path) -> None:
    chain = " < ".join(f"s{k}" for k in range(61))
    names = ", ".join(f"s{k}" for k in range(61))
    model = find(f"{names} : {chain}")
    numbers = measure(model)
    assert numbers.height == 60
    message = r"^model: must have at most 120 elements .*--only A,B.*--json, got 122$"
    for name in ("a.png", "a.svg"):
        with pytest.raises(InvalidValueError, match=message):
            draw_model(model, numbers, tmp_path / name)
    assert not list(tmp_path.iterdir())
    same = find(f"{names}, t : {chain}, t = s2".replace("s59 < s60", "s59 = s60"))
    assert (len(same.poc), same.elements) == (62, 120)  # equal literals are one
    page.check_size(same)
    few = find(f"{names} : {chain}", only=("s3", "s40"))
    draw_model(few, measure(few), tmp_path / "a.png")
    assert few.title.endswith("(2 of 61 sensors)")


def texts_of(text: str) -> list[str]:
    (axes,) = figure_once(text).axes
    return [shown.get_text() for shown in axes.texts]


@pytest.mark.slow
def test_the_key_says_what_a_dot_is_and_shows_what_is_thin() -> None:
    assert "a vertex: a state without contradiction" in texts_of("simple")
    assert "a vertex: a point shows it" in texts_of("thresholds")
    assert "not in the punctured dual" not in texts_of("thresholds")
    found = texts_of("six-arcs")
    assert "not in the punctured dual" in found
    (axes,) = figure_once("six-arcs").axes
    place = next(t for t in axes.texts if t.get_text() == "not in the punctured dual")
    x, y = place.get_position()
    swatch = [
        line
        for line in axes.lines
        if line.get_linewidth() == THIN
        and np.allclose(line.get_ydata(), y)
        and np.all(np.asarray(line.get_xdata()) < x)
    ]
    assert len(swatch) == 1


@pytest.mark.slow
def test_a_heading_does_not_enumerate_what_the_diagram_shows() -> None:
    assert "16 sensors, 32 literals that differ" in texts_of("path-with-all-contexts")
    assert "a, b, c : a\u00a0<\u00a0c*, b\u00a0<\u00a0c*" in texts_of("simple")


@pytest.mark.slow
@pytest.mark.parametrize("text", ["thresholds", "simple", "bad-dual"])
def test_a_small_model_leaves_little_paper_white(text: str) -> None:
    """Of the rows of the paper below the heading, most have something on them."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas: Any = FigureCanvasAgg(figure_once(text))
    canvas.draw()
    ink = np.asarray(canvas.buffer_rgba())[..., :3].min(axis=2) < 250
    boxes = [
        ink[y : y + 40, x : x + 40].any()
        for y in range(0, ink.shape[0], 40)
        for x in range(0, ink.shape[1], 40)
    ]
    assert np.mean(boxes) > 0.3


def test_more_is_listed_when_asked_for() -> None:
    assert measure(find("a,b,c,d,e,f,g,h,i : a<b<c<d<e", limit=9_999)).vertices == 96
    with pytest.raises(InvalidValueError, match=r"^limit: must be at least 1"):
        find("simple", limit=0)
