"""Makes the stand-ins of this folder importable, in spawned processes too; one simulation process for all tests."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from stand_ins import Hanging

from app.simulation import Simulation


@pytest.fixture(scope="session")
def shared_simulation() -> Iterator[Simulation]:
    """A hanging robot in a process of its own."""
    running = Simulation(Hanging())
    running.start()
    running.wait()
    yield running
    running.close()


@pytest.fixture
def simulation(shared_simulation: Simulation) -> Simulation:
    """The same, alive."""
    if shared_simulation.lost:
        shared_simulation.restart()
    return shared_simulation
