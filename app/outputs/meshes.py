"""The robot's shape for pages that draw it themselves: one binary answer, packed once."""

from __future__ import annotations

import gzip
import json

import numpy as np
from fastapi import APIRouter, Request, Response

from app.outputs.geometry import Look


def packed(looks: list[Look]) -> bytes:
    """The meshes of bodies, little-endian.

    A 32-bit length, then so many bytes of JSON, [{"body": index in GET /api/scene, "rgb": [r, g, b], "vertices": n, "faces": m},
    ...], padded to a multiple of 4; then for each of them n float32 triples [m, in the body's frame] and m uint32 triples.
    """
    heads = [{"body": look.body - 1, "rgb": look.rgb, "vertices": len(look.vertices), "faces": len(look.faces)} for look in looks]
    head = json.dumps(heads).encode()
    head += b" " * (-len(head) % 4)
    arrays = [part for look in looks for part in (look.vertices.astype("<f4").tobytes(), look.faces.astype("<u4").tobytes())]
    return b"".join([np.array(len(head), "<u4").tobytes(), head, *arrays])


def router(looks: list[Look]) -> APIRouter:
    """GET /api/scene/meshes."""
    api, plain = APIRouter(tags=["picture"]), packed(looks)
    small = gzip.compress(plain, 4)

    @api.get("/api/scene/meshes", response_class=Response, responses={200: {"content": {"application/octet-stream": {}}}})
    def meshes(request: Request) -> Response:
        """What the robot looks like, a mesh a body and colour; app/outputs/meshes.py has the layout."""
        packs = "gzip" in request.headers.get("accept-encoding", "")
        headers = {"Cache-Control": "no-cache"} | ({"Content-Encoding": "gzip"} if packs else {})
        return Response(small if packs else plain, media_type="application/octet-stream", headers=headers)

    return api
