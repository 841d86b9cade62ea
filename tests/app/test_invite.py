"""A link for a phone, as text and as a QR code."""

from __future__ import annotations

import asyncio
import json
from typing import Any
from urllib.parse import urlsplit

import pytest
from fastapi import FastAPI

from app import invite


class Guests:
    """Ask without a socket."""

    def __init__(self) -> None:
        self.app = FastAPI()
        self.app.include_router(invite.router("0123456789abcdefghijklmnopqrstuv"))

    def get(self, address: str) -> tuple[int, Any]:
        parts, said = urlsplit(address), []
        scope = {"type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "method": "GET", "scheme": parts.scheme}
        scope |= {"path": parts.path, "query_string": b"", "headers": [(b"host", parts.netloc.encode())]}

        async def receive() -> dict:
            return {"type": "http.request", "body": b""}

        async def send(message: dict) -> None:
            said.append(message)

        asyncio.run(self.app(scope, receive, send))
        return said[0]["status"], json.loads(said[1]["body"])


@pytest.fixture
def guests() -> Guests:
    return Guests()


def test_a_link_names_the_role_and_holds_the_token_under_the_name_that_was_used(guests: Guests) -> None:
    _, invitation = guests.get("https://lab-pc.local:8443/api/invite/legs")
    assert invitation["link"] == "https://lab-pc.local:8443/?role=legs&token=0123456789abcdefghijklmnopqrstuv"
    assert invitation["qr"].startswith("data:image/svg+xml")
    assert invitation["reach"] == ""


def test_a_link_that_only_this_machine_can_open_says_so(guests: Guests) -> None:
    assert "loopback" in guests.get("http://127.0.0.1:8080/api/invite/arms")[1]["reach"]


def test_there_is_no_third_role(guests: Guests) -> None:
    assert guests.get("http://127.0.0.1:8080/api/invite/head")[0] == 422
