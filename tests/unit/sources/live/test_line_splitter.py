"""Lines out of pieces, against splitting the whole."""

from hypothesis import given
from hypothesis import strategies as st

from neurosnap.sources.live.stdin_source import Lines

LIMIT = 6


@given(
    st.lists(st.binary(max_size=12) | st.sampled_from([b"\n", b"abcdef"]), max_size=12),
)
def test_pieces_make_the_lines_that_the_whole_has(pieces: list[bytes]) -> None:
    lines = Lines(LIMIT)
    found = [line for piece in pieces for line in lines.feed(piece)]
    found += lines.finish()
    texts = b"".join(pieces).split(b"\n")
    if texts[-1] == b"":
        texts.pop()
    assert found == [
        (number, text if len(text) <= LIMIT else None)
        for number, text in enumerate(texts, 1)
    ]


def test_a_line_without_an_end_is_not_held() -> None:
    lines = Lines(LIMIT)
    for _ in range(1000):
        assert list(lines.feed(b"x" * 5)) == []
        assert len(lines._begun or b"") <= LIMIT
    assert list(lines.feed(b"\nok\n")) == [(1, None), (2, b"ok")]
