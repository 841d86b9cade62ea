"""The real program for the tests of this folder, which may hurt it as they like."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "app"))

from program import Program


@pytest.fixture(scope="session")
def shared_program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """A running `teleop`."""
    program = Program(tmp_path_factory.mktemp("recordings"))
    yield program
    program.close()


@pytest.fixture
def program(shared_program: Program) -> Program:
    """The same with the robot standing at home and nobody driving."""
    shared_program.home()
    return shared_program
