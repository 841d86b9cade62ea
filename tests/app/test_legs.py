"""Changing the legs: who may, what is known, and that the simulation hears of it."""

from types import SimpleNamespace

import numpy as np
import pytest
from fastapi import HTTPException
from pydantic import ValidationError

from app.inputs.operator import Operators
from app.legs import Legs, router
from app.protocol import OperatorMessage
from policies.command import Command
from policies.errors import UnknownPolicy

NAMES = ("walk_h1", "walk_h1_no_prior")


class Site:
    def __init__(self) -> None:
        self.pushed: list[np.ndarray] = []
        self.operators = Operators(SimpleNamespace(push=self.pushed.append), Command)  # pyright: ignore[reportArgumentType]
        self._change = router(self._choose, self.operators).routes[0].endpoint  # pyright: ignore[reportAttributeAccessIssue]

    def change(self, name: str, client: str | None = None) -> None:
        self._change(Legs(name=name), client)

    def _choose(self, name: str) -> None:
        if name not in NAMES:
            raise UnknownPolicy(name, NAMES)
        self.operators.choose(NAMES.index(name))


@pytest.fixture
def site() -> Site:
    return Site()


def test_the_simulation_is_told(site):
    site.change("walk_h1_no_prior")
    assert site.pushed[-1]["policy"] == 1
    site.operators.stop()
    assert site.pushed[-1]["policy"] == 1, "the choice stays"


def test_unknown_legs_are_refused_and_the_known_ones_listed(site):
    with pytest.raises(HTTPException, match="walk_h1, walk_h1_no_prior") as refused:
        site.change("run_h1")
    assert refused.value.status_code == 404
    with pytest.raises(ValidationError):
        site.change("../x")
    assert not site.pushed


def test_only_who_drives_the_legs_changes_them(site):
    driver, watcher = site.operators.join(), site.operators.join()
    site.operators.hear(driver, OperatorMessage(seq=1, engage=True))
    for stranger in (None, watcher.key):
        with pytest.raises(HTTPException, match="operator 1 drives the legs") as refused:
            site.change("walk_h1_no_prior", stranger)
        assert refused.value.status_code == 409
    site.change("walk_h1_no_prior", driver.key)
    assert site.pushed[-1]["policy"] == 1
