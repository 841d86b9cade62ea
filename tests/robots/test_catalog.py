"""Robots by name."""

import pytest

from robots import catalog
from robots.errors import UnknownRobot


def test_the_catalog_knows_the_h1_and_gives_its_spec():
    assert "h1" in catalog.known()
    assert catalog.load("h1").spec.name == "h1"


@pytest.mark.parametrize("name", ["g2", "", "h1.spec", "../h1", "state"])
def test_an_unknown_robot_is_refused_with_the_known_ones(name: str):
    with pytest.raises(UnknownRobot) as refusal:
        catalog.load(name)
    assert repr(name) in str(refusal.value)
    for known in catalog.known():
        assert known in str(refusal.value)
