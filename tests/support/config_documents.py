"""TOML documents whose keys' lines are known because they are written here."""

from typing import NamedTuple

from hypothesis import strategies as st

Keys = tuple[str | int, ...]

BARE = ["a", "b1", "c-d", "true", "7"]
QUOTED = {
    '"x y"': "x y",
    "'[z]'": "[z]",
    '"#"': "#",
    '"\\u0041\\""': 'A"',
    '"d.e"': "d.e",
    '""': "",
}
SCALARS = [
    "1", "-2.5", "true", "1979-05-27T07:32:00Z", "nan", '""', "''", '"]}#"',
    "'\\'", '"\\"["', "'\"\"\"'", '"\'\'\'"', '"""]"""', "'''}'''", '"""""a""\\"""""',
    "'''''b'''''",
]  # fmt: skip
LONG = [
    '"""\n[no]\nkey = 1 # """', '"""a\\"""\n]""\\\n  b"""""', "'''\n'' } [\n#'''''",
    '"""\n\n"""',
]  # fmt: skip
GAPS = ["", "\n", "# ] [a] = '\n", '\n  # """ {\n\n']


class Document(NamedTuple):
    text: str
    lines: dict[Keys, int]
    """The line of every key: the one on which it stands, or, behind a string of several
    lines within its array or inline table, the one on which the first such began."""


class Pen:
    """Writes a document, and down on which line each key is written."""

    def __init__(self, draw: st.DrawFn) -> None:
        self.draw = draw
        self.text = ""
        self.line = 1
        self.lines: dict[Keys, int] = {}

    def put(self, text: str) -> None:
        """Write something that holds no string of several lines."""
        self.text += text
        if "\n" in text:
            self.line = 1 + self.text.count("\n")

    def mark(self, keys: Keys) -> None:
        for length in range(1, len(keys) + 1):
            self.lines.setdefault(keys[:length], self.line)

    def one(self, of: list[str]) -> str:
        return self.draw(st.sampled_from(of))

    def keys(self, most: int) -> list[tuple[str, str]]:
        """Draw different keys: as they are written, and as they are meant."""
        every = [(key, key) for key in BARE] + list(QUOTED.items())
        drawn = st.lists(
            st.sampled_from(every), max_size=most, unique_by=lambda key: key[1]
        )
        return self.draw(drawn)

    def value(self, at: Keys, depth: int) -> None:
        kinds = ["scalar", "long", "list", "table"] if depth else ["scalar", "long"]
        match self.one(kinds):
            case "scalar":
                self.put(self.one(SCALARS))
            case "long":
                self.text += self.one(LONG)  # and the line stays
            case "list":
                self.put("[" + self.one(GAPS))
                for place in range(self.draw(st.integers(0, 3))):
                    self.mark((*at, place))
                    self.value((*at, place), depth - 1)
                    self.put(self.one(["", "\n"]) + "," + self.one([" ", *GAPS]))
                self.put("]")
            case _:
                self.put("{ ")
                for number, (written, key) in enumerate(self.keys(3)):
                    self.put(", " if number else "")
                    self.entry(written, (*at, key), depth - 1)
                self.put(" }")

    def entry(self, written: str, keys: Keys, depth: int) -> None:
        if self.draw(st.booleans()):
            written, keys = f"{written} . sub", (*keys, "sub")
        self.mark(keys)
        self.put(f"{written} = ")
        self.value(keys, depth)

    def entries(self, at: Keys) -> None:
        for written, key in self.keys(3):
            self.put(self.one(GAPS))
            self.entry(written, (*at, key), 2)
            self.put(self.one(["\n", " # '''\n"]))


@st.composite
def documents(draw: st.DrawFn) -> Document:
    """Draw a document with all that TOML has to make a line hard to find."""
    pen = Pen(draw)
    pen.entries(())
    for number, (written, key) in enumerate(pen.keys(4)):
        # The names of headers begin with one of their own: none is defined twice.
        top = f"table{number}"
        if draw(st.booleans()):
            pen.mark((top, key))
            pen.put(f"[{top}.{written}] # [\n")
            pen.entries((top, key))
            continue
        for place in range(draw(st.integers(1, 3))):
            pen.mark((top, key, place))
            pen.put(f"[[ {top} . {written} ]]\n")
            pen.entries((top, key, place))
    text = pen.text if draw(st.booleans()) else pen.text.removesuffix("\n")
    return Document(text, pen.lines)
