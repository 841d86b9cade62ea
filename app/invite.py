"""A link that hands a role to another device, and the same as a QR code for a phone's camera."""

from __future__ import annotations

from urllib.parse import urlencode, urlsplit

import segno
from fastapi import APIRouter, Request, Response
from pydantic import BaseModel

from app.arbiter import Role
from app.gate import LOOPBACK

ONLY_HERE = "Only this computer can open it: it is a loopback address. Start teleop with --host 0.0.0.0 --token FILE to let a phone in."


class Invitation(BaseModel):
    """GET /api/invite/{role}."""

    link: str
    """The page, which then drives this role only."""
    qr: str
    """The link as the data URL of an SVG."""
    reach: str
    """Why another device cannot open it, as a sentence; empty where one can."""


def router(token: str | None = None) -> APIRouter:
    """GET /api/invite/{role}. The link holds the token, where there is one: whoever was let in may let others in."""
    api = APIRouter(tags=["robot"])

    @api.get("/api/invite/{role}")
    def invite(role: Role, request: Request, response: Response) -> Invitation:
        """A link under the name by which this very request reached the program."""
        query = urlencode({"role": role} | ({"token": token} if token else {}))
        link = f"{request.url.scheme}://{request.headers['host']}/?{query}"
        drawing = segno.make(link, error="m").svg_data_uri(scale=4, border=2, light="#fff")
        response.headers["Cache-Control"] = "no-store"
        here = urlsplit(link).hostname in LOOPBACK
        return Invitation(link=link, qr=drawing, reach=ONLY_HERE if here else "")

    return api
