"""A link that hands a role to another device, and the same as a QR code for a phone's camera."""

from __future__ import annotations

import io
from urllib.parse import urlsplit

import segno
from fastapi import APIRouter, Request
from pydantic import BaseModel

from app.arbiter import Role
from app.gate import LOOPBACK

ONLY_HERE = "Only this computer can open it: the program listens on loopback. A phone reaches it through a tunnel."


class Invitation(BaseModel):
    """GET /api/invite/{role}."""

    link: str
    """The page, which then drives this role only."""
    qr: str
    """The link as an SVG."""
    reach: str
    """Why another device cannot open it, as a sentence; empty where one can."""


def router() -> APIRouter:
    """GET /api/invite/{role}."""
    api = APIRouter(tags=["robot"])

    @api.get("/api/invite/{role}")
    def invite(role: Role, request: Request) -> Invitation:
        """A link under the name by which this very request reached the program."""
        link = f"{request.url.scheme}://{request.headers['host']}/?role={role}"
        drawing = io.BytesIO()
        segno.make(link, error="m").save(drawing, kind="svg", xmldecl=False, scale=4, border=2, light="#fff")
        here = urlsplit(link).hostname in LOOPBACK
        return Invitation(link=link, qr=drawing.getvalue().decode(), reach=ONLY_HERE if here else "")

    return api
