"""Finds the model to draw: by name, from a recording, or from an expression."""

import difflib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from neurosnap import wire
from neurosnap.apps.drawing.model import LIMIT, Mark, Model
from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.cubing import Cubing
from neurosnap.poc.dual.examples import EXAMPLES, Example
from neurosnap.poc.dual.morphism import PocMorphism
from neurosnap.poc.dual.realization import Realization
from neurosnap.poc.order.pocset import PocSet
from neurosnap.protocol.observations import readings
from neurosnap.recording.read.births import births_of
from neurosnap.recording.read.learned_at import snapshot_at
from neurosnap.recording.read.recording import Recording
from neurosnap.sensorium import unpack

MOST = 4_000
"""The most elements that are measured: it takes seconds."""

_NAMED = {make.__name__.replace("_", "-"): make for make in EXAMPLES.values()}
_CALLED = {**EXAMPLES, **_NAMED}


def listed() -> dict[str, str]:
    """Return the named models and what they are."""
    return {name: make().title for name, make in _NAMED.items()}


def find(
    text: str,
    tick: int | None = None,
    limit: int = LIMIT,
    only: Sequence[str] = (),
) -> Model:
    """Return the model that is asked for.

    Args:
        text: The name of one, a recording's path, or an expression as
            `PocSet.parse` reads it.
        tick: Of a recording: as it was after this tick.
        limit: The most vertices that are listed.
        only: The sensors to keep, with the order among them; none: all.

    Raises:
        InvalidValueError: There is no such model, the expression is wrong, or there
            is too much to measure.
        UnknownSensorError: One of `only` is not among the sensors.
        RecordingError: The recording is damaged or somebody else's.
    """
    if limit < 1:
        raise InvalidValueError("limit", "must be at least 1", limit)
    if text in _CALLED:
        found = _of_example(text, _CALLED[text]())
    elif text.endswith(".mcap") or _is_file(text):
        found = of_recording(Path(text), tick)
        tick = None
    elif any(sign in text for sign in ",:<=≤"):
        found = Model("model", f"The poc set on {text.strip()}", PocSet.parse(text))
    else:
        raise InvalidValueError("model", _unknown(text), text)
    if tick is not None:
        raise InvalidValueError("tick", "must be of a recording (.mcap)", text)
    if only:
        found = _among(found, only)
    elements = found.elements
    if not 0 < elements <= MOST:
        rule = f"must have from 1 to {MOST:,} elements; keep some sensors with --only"
        raise InvalidValueError("poc set", rule, elements)
    return replace(found, limit=limit)


def of_recording(path: Path, tick: int | None = None) -> Model:
    """Return what a recorded run had learned after a tick, and its state there.

    What was observed by then takes the place of a realisation, where every reading was
    known. A sensor that was not grown yet, or has retired, is left out.
    """
    recording = Recording.open(path)
    tick, snapshot = snapshot_at(recording, tick)
    poc = PocSet.from_graph(snapshot.poc_graph(), snapshot.sensorium)
    count, state, seen = len(poc), None, []
    births = births_of(recording)
    read = births.read_at(tick)
    for recorded in recording.messages(("observe", "state")):
        match recorded.message:
            case wire.Observation() as observation if observation.tick <= tick:
                bits, known = readings(observation, count)
                if known is None or known[read].all():
                    seen.append(bits[read])
            case wire.State(tick=now, literals=literals) if now == tick:
                pairs = unpack(literals, 2 * count).reshape(count, 2)
                state = pairs[read].ravel()
            case _:
                pass
    if len(read) < count:
        poc = poc.restricted(births.names[sensor] for sensor in read)
    fields = None
    if seen:
        fields = Realization(np.unique(np.array(seen), axis=0).T, poc.sensorium)
    return Model(
        name=path.stem,
        title=f"{path.name}: what was learned by tick {tick}",
        poc=poc,
        fields=fields,
        witness="an observation",
        state=state,
        lenient=True,
        recording=recording,
    )


def _among(model: Model, names: Sequence[str]) -> Model:
    """Return a model of some of its sensors; what is marked in it is left out."""
    poc = model.poc.restricted(names)
    every = list(model.poc.sensorium)
    rows = [every.index(name) for name in poc.sensorium]
    fields, state = model.fields, model.state
    if fields is not None:
        fields = Realization(fields.fields[rows], poc.sensorium)
    if state is not None:
        state = state.reshape(-1, 2)[rows].ravel()
    return replace(
        model,
        title=f"{model.title} ({len(rows)} of {len(every)} sensors)",
        poc=poc,
        fields=fields,
        state=state,
        marks=(),
        parts=(),
        target=None,
        joined=(),
    )


def _is_file(text: str) -> bool:
    """Return whether there is a file of that name."""
    try:
        return Path(text).is_file()
    except OSError:  # a long expression is no name a file could have
        return False


def _unknown(text: str) -> str:
    """Return the rule that no model's name breaks."""
    close = difflib.get_close_matches(text, _CALLED, n=2, cutoff=0.5)
    hint = f" (did you mean {' or '.join(close)}?)" if close else ""
    return (
        'must be a name of --list, a recording or an expression like "a, b : a < b*"'
        + hint
    )


def _of_example(name: str, example: Example) -> Model:
    """Return a named example with what its figure shows."""
    model = Model(name, example.title, example.poc, example.fields)
    marks = example.marks()
    if len(marks) == 4:
        signs = zip(("u", "v", "w", "m"), marks, strict=True)
        kinds = {"m": "median"}
        found = [Mark(kinds.get(sign, "corner"), u, sign) for sign, u in signs]
        return replace(model, marks=tuple(found))
    if marks and example.fields is not None:
        shown = bool(example.fields.witnesses(marks[0]).any())
        return replace(model, marks=(Mark("split" if shown else "puncture", marks[0]),))
    if example.morphism is not None:
        return _with_target(model, example.morphism)
    actions = tuple(a for a in example.poc.sensorium if a in ("fwd", "back", "wait"))
    if actions:
        plain = {*actions, *(a for a in example.poc.sensorium if a.startswith("("))}
        places = tuple(a for a in example.poc.sensorium if a not in plain)
        return replace(model, parts=(("position", places), ("action", actions)))
    return model


def _with_target(model: Model, morphism: PocMorphism) -> Model:
    """Return a model whose dual shows where the dual of a morphism leads."""
    there = list(Cubing(morphism.target).vertices())
    signs = [str(k + 1) for k in range(len(there))]
    near = [
        (j, i)
        for i, u in enumerate(there)
        for j, v in enumerate(there[:i])
        if Cubing(morphism.target).distance(u, v) == 1
    ]
    target = Model(
        name=f"{model.name}'s target",
        title="Where the morphism leads",
        poc=morphism.target,
        marks=tuple(Mark("image", u, s) for u, s in zip(there, signs, strict=True)),
        joined=tuple(near),
    )
    images = [morphism.dual(u) for u in there]
    marks = tuple(Mark("image", u, s) for u, s in zip(images, signs, strict=True))
    return replace(model, marks=marks, joined=tuple(near), target=target)
