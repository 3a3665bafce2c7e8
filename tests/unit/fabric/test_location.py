"""A part says where it is in a form that fits a key, and strangers' are looked at."""

import os
import socket

import pytest
import zenoh

from neurosnap.fabric.protocol import Place


@pytest.mark.parametrize(
    ("name", "told"),
    [
        *((name, name) for name in ("oak", "oak.lan", "Oak-3_b", "a" * 64)),
        ("", "-"),
        ("a/b", "a-b"),
        ("**", "--"),
        ("a\x1b[2J", "a--2J"),
        ("ahorn-ä", "ahorn--"),
        ("a" * 65, "a" * 64),
    ],
)
def test_a_machine_is_called_by_its_name_and_no_name_breaks_a_key(
    name: str, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(socket, "gethostname", lambda: name)
    place = Place.here()
    assert place == (told, os.getpid())
    assert Place.read(place.text) == place
    assert str(zenoh.KeyExpr(f"place/{place.text}")) == f"place/{place.text}"


@pytest.mark.parametrize(
    "text",
    [
        *("", "oak", "oak/", "/7", "oak/x", "oak/-7", "oak/7/8", "oak/7\n", "oak /7"),
        *("o\x1bk/7", "o\u0661k/7", "oak/\u0661", "a" * 65 + "/7", "oak/" + "1" * 11),
    ],
)
def test_what_is_no_place_is_none(text: str) -> None:
    assert Place.read(text) is None
