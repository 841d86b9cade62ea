"""The web side: health, the operator's socket, stop and reset; the page and the episodes come in as routers."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from typing import Annotated

from fastapi import APIRouter, FastAPI, HTTPException, Query, Request, WebSocket
from fastapi.responses import JSONResponse
from fastapi_offline import FastAPIOffline
from pydantic import ValidationError

from app import clock
from app.arbiter import Role
from app.errors import AppError
from app.gate import Gate
from app.inputs.operator import Client, Operators
from app.inputs.webxr import BadPacket, Headset
from app.newest import Newest
from app.protocol import HEADSET, VERSION, Answer, HeadsetPacket, Health, Member, OperatorMessage, headset_packet
from app.race import first_to_end
from app.traffic import BLOCKED, CLIENTS, FULL, LARGEST_BODY, LARGEST_MESSAGE, NOT_JSON, NOT_TEXT, TOO_BIG, TOO_MANY, Allowance, TooMany

_log = logging.getLogger(__name__)

ANSWER_PERIOD = 0.04
"""Seconds between two answers to a client."""


def create_app(
    health: Callable[[], Health],
    operators: Operators,
    reset: Callable[[int], None],
    host: str,
    routers: Sequence[APIRouter] = (),
    names: Sequence[str] = (),
    token: str | None = None,
    headset: Callable[[], Headset] | None = None,
) -> FastAPI:
    """The whole site.

    Args:
        health: the record of this moment.
        operators: who drives.
        reset: puts the robot back home, varied by a seed other than 0; starts the simulation again if it is lost; may block.
        host: the configured host name.
        routers: page, episodes.
        names: further names of this machine.
        token: what people have to know to be let in.
        headset: makes the conversion of one client's headset packets; without it they are refused.
    """
    about = {"title": "humanoid-teleop", "description": "Drive a walking humanoid.", "version": str(VERSION)}
    app = FastAPIOffline(**about, max_body_size=LARGEST_BODY)
    app.add_middleware(Gate, host=host, names=names, token=token)
    app.add_exception_handler(AppError, _say)
    app.webhooks.add_api_route("operator", _operator_socket, methods=["POST"], summary="WS /api/operator")
    app.include_router(_control(health, operators, reset, headset), prefix="/api")
    for router in routers:
        app.include_router(router)
    return app


def _control(
    health: Callable[[], Health], operators: Operators, reset: Callable[[int], None], headset: Callable[[], Headset] | None
) -> APIRouter:
    router = APIRouter(tags=["robot"])

    @router.get("/health")
    def read_health() -> Health:
        """The state of the robot and of the loop that drives it."""
        return health()

    @router.post("/stop")
    async def stop() -> None:
        """Stop walking and stand; anyone may. Only a fresh press of Engage goes on."""
        operators.stop()

    @router.post("/reset", responses={409: {"description": "Somebody else drives."}})
    def reset_robot(client: str | None = None, seed: Annotated[int, Query(ge=0, lt=2**32)] = 0) -> None:
        """Put the robot back home, standing and STOPPED; clears a fault. A seed other than 0 draws a start near home from it.

        It moves the robot at once, so while the robot follows somebody only a driver may (`client`: the id in its answers).
        Anybody else stops it first, which anyone may, or takes over: what a driver holds in hand never jumps for a stranger.
        """
        following = {part.driver for part in vars(health().roles).values() if part.driver and part.state == "ENGAGED"}
        if following and client not in {driver.key for driver in operators.drivers.values() if driver}:
            raise HTTPException(409, f"the robot follows {' and '.join(following)}; stop it first (POST /api/stop), then reset")
        reset(seed)

    @router.get("/headset")
    def read_headset() -> HeadsetPacket:
        """The layout of a headset's packets: binary messages on WS /api/operator, at 60 Hz, of which the newest counts."""
        return headset_packet()

    @router.websocket("/operator")
    async def operator(socket: WebSocket) -> None:
        """OperatorMessage in, Answer out; see app.protocol."""
        await socket.accept()
        if len(operators.clients) >= CLIENTS:
            await socket.close(FULL, f"{CLIENTS} clients are connected already")
            return
        client, packets = operators.join(), Newest[bytes]()
        _log.info("operator connected", extra={"operator": client.key})
        try:
            await first_to_end(
                _read(socket, client, operators, packets),
                _follow(packets, client, operators, headset),
                _answer(socket, client, operators, health),
            )
        finally:
            operators.leave(client)
            _log.info("operator left", extra={"operator": client.key, "messages": client.seq})

    return router


async def _say(request: Request, error: Exception) -> JSONResponse:
    """An error that a person can mend, as a sentence."""
    return JSONResponse({"detail": str(error)}, status_code=503)


def _operator_socket(message: OperatorMessage) -> Answer:  # OpenAPI knows no sockets: /docs shows this one as a webhook
    """JSON text over a WebSocket: messages at 20 Hz or faster, answers at 20 Hz whether or not anything was said."""
    raise NotImplementedError


class _Refused(Exception):
    """What a client sent is no message: its socket is closed."""

    def __init__(self, code: int, why: str) -> None:
        super().__init__(why)
        self.code = code


async def _read(socket: WebSocket, client: Client, operators: Operators, packets: Newest[bytes]) -> None:
    """Hear every message until the socket closes, or has to be closed; headset packets are put aside."""
    allowance = Allowance()
    while (packet := await socket.receive())["type"] != "websocket.disconnect":
        try:
            allowance.take()
            if data := packet.get("bytes"):
                packets.put(_packet(data))
            else:
                operators.hear(client, _parse(packet.get("text")))
        except ValidationError as error:
            first = error.errors()[0]
            operators.refuse(client, f"{'.'.join(map(str, first['loc']))}: {first['msg']}")
        except (_Refused, TooMany) as refused:
            _log.info("socket closed", extra={"operator": client.key, "why": str(refused)})
            await socket.close(refused.code if isinstance(refused, _Refused) else TOO_MANY, str(refused))
            return


def _packet(data: bytes) -> bytes:
    """The packet, if it may be one.

    Raises:
        _Refused: it is none.
    """
    if len(data) != HEADSET.itemsize:
        raise _Refused(NOT_TEXT, "messages are JSON text, or packets of a headset (GET /api/headset)")
    return data


async def _follow(packets: Newest[bytes], client: Client, operators: Operators, headset: Callable[[], Headset] | None) -> None:
    """Hear the newest packet of the client's headset."""
    data = await packets.take()
    converts = headset and headset()
    while True:
        try:
            if converts is None:
                raise BadPacket("no headset can drive this robot")
            message = converts.message(data)
            if message:
                operators.hear(client, message.model_copy(update={"ask": client.asks}))
        except BadPacket as error:
            operators.refuse(client, str(error))
        data = await packets.take()


def _parse(text: str | None) -> OperatorMessage:
    """The message in a packet.

    Raises:
        ValidationError: a field is wrong.
        _Refused: it is no JSON object at all.
    """
    if text is None:
        raise _Refused(NOT_TEXT, "messages are JSON text")
    if len(text.encode()) > LARGEST_MESSAGE:
        raise _Refused(TOO_BIG, f"messages have at most {LARGEST_MESSAGE} bytes")
    try:
        return OperatorMessage.model_validate_json(text, strict=True)
    except ValidationError as error:
        if error.errors()[0]["type"] in ("json_invalid", "model_type"):
            raise _Refused(NOT_JSON, "messages are JSON objects") from error
        raise


async def _answer(socket: WebSocket, client: Client, operators: Operators, health: Callable[[], Health]) -> None:
    """Tell the newest state; who does not read misses what was in between."""
    while True:
        error, client.error = client.error, None
        crew = _crew(operators)
        drives = next(member.drives for member in crew if member.id == client.key)
        waited = round((clock.now() - client.heard) * 1e3, 2)
        own = {"seq": client.seq, "waited": waited, "id": client.key, "you": client.name, "error": error}
        answer = Answer(**dict(health()), **own, driving=bool(drives), drives=drives, crew=crew)
        await asyncio.wait_for(socket.send_text(answer.model_dump_json()), BLOCKED)
        await asyncio.sleep(ANSWER_PERIOD)


def _crew(operators: Operators) -> list[Member]:
    """Everybody who is connected."""
    drivers, crew = operators.drivers, []
    for client in operators.clients:
        drives: list[Role] = [role for role, driver in drivers.items() if driver is client]
        asks: list[Role] = [role for role in client.roles if client.asks and drivers[role] not in (client, None)]
        crew.append(Member(id=client.key, name=client.name, drives=drives, asks=asks))
    return crew
