"""Which Host and Origin headers get in."""

from __future__ import annotations

import pytest
from starlette.datastructures import Headers

from app.gate import Gate


async def nothing(*_: object) -> None:
    raise AssertionError("not called")


GATE = Gate(nothing, host="192.0.2.7")


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("127.0.0.1:8080", None),
        ("localhost:8080", "http://localhost:8080"),
        ("LOCALHOST", "http://LOCALHOST"),
        ("[::1]:8080", "http://[::1]:8080"),
        ("192.0.2.7:8080", "http://192.0.2.7:8080"),
    ],
)
def test_our_own_pages_and_scripts_get_in(host: str, origin: str | None) -> None:
    assert GATE.allows(Headers({"host": host} | ({"origin": origin} if origin else {})))


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("evil.example:8080", None),
        ("127.0.0.1.evil.example", None),
        ("evil.example@127.0.0.1.evil.example", None),
        ("", None),
        ("[::1", None),
        ("127.0.0.1:8080", "http://evil.example"),
        ("127.0.0.1:8080", "http://127.0.0.1:9999"),
        ("127.0.0.1:8080", "http://localhost:8080"),
        ("127.0.0.1:8080", "null"),
        ("127.0.0.1:8080", "http://127.0.0.1:8080.evil.example"),
    ],
)
def test_other_sites_and_rebound_names_do_not(host: str, origin: str | None) -> None:
    assert not GATE.allows(Headers({"host": host} | ({"origin": origin} if origin else {})))


def test_repeated_headers_do_not() -> None:
    assert not GATE.allows(Headers(raw=[(b"host", b"127.0.0.1"), (b"host", b"evil.example")]))
    assert not GATE.allows(Headers(raw=[(b"host", b"a"), (b"origin", b"http://a"), (b"origin", b"http://b")]))
    assert not GATE.allows(Headers(raw=[]))
