"""Which trained legs walk: the motion prior's, or its ablations, changed while the robot walks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

from fastapi import APIRouter, HTTPException
from pydantic import BaseModel, StringConstraints

from app.inputs.operator import Operators
from policies.errors import UnknownPolicy


class Legs(BaseModel):
    """What POST /api/policy takes."""

    name: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9._-]{1,64}$")]
    """One of `policies` in the health record."""


def router(choose: Callable[[str], None], operators: Operators) -> APIRouter:
    """POST /api/policy."""
    routes = APIRouter(prefix="/api", tags=["robot"])

    @routes.post("/policy", responses={404: {"description": "No such legs."}, 409: {"description": "Somebody else drives the legs."}})
    def change(legs: Legs, client: str | None = None) -> None:
        """Walk with other legs from the next tick on. While somebody drives the legs only they may (`client`: the id in its answers)."""
        driver = operators.drivers["legs"]
        if driver and driver.key != client:
            raise HTTPException(409, f"{driver.name} drives the legs")
        try:
            choose(legs.name)
        except UnknownPolicy as error:
            raise HTTPException(404, str(error)) from error

    return routes
