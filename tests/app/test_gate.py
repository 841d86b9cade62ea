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


def test_the_address_that_was_reached_and_names_that_were_told_get_in() -> None:
    told = Gate(nothing, host="0.0.0.0", names=["Lab-PC.local"])
    assert told.allows(Headers({"host": "198.51.100.4:8080", "origin": "https://198.51.100.4:8080"}), "198.51.100.4")
    assert told.allows(Headers({"host": "lab-pc.local:8080"}), "198.51.100.4")
    assert not told.allows(Headers({"host": "198.51.100.5:8080"}), "198.51.100.4")
    assert not told.allows(Headers({"host": ""}), "")


@pytest.mark.parametrize("text", ["Bearer secret", "bearer secret"])
def test_the_token_as_a_header_or_a_cookie(text: str) -> None:
    locked = Gate(nothing, host="192.0.2.7", token="secret")
    assert locked.knows(Headers({"authorization": text}))
    assert locked.knows(Headers({"cookie": 'a[1]="; teleop_token=secret; b=c'}))
    assert not locked.knows(Headers({"authorization": "Basic secret"}))
    assert not locked.knows(Headers({"cookie": "teleop_token="}))
    assert not locked.knows(Headers({"authorization": "Bearer", "cookie": "teleop_token=secret"}))
