"""Weights on disk: safetensors beside a JSON card that says what they are. Never pickle."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import safetensors

from policies.errors import DamagedWeights, UnknownPolicy, WrongWeights

if TYPE_CHECKING:
    import numpy as np
    from torch import Tensor

# safetensors.torch is imported where tensors are handled: the web process never loads torch

SHIPPED = Path(__file__).parent / "weights"


def known(kind: str, folder: Path = SHIPPED, robot: str | None = None) -> list[str]:
    """Names of the shipped weights of one kind ("walk", "prior"), of one robot or of all: those that `find` finds.

    Raises:
        DamagedWeights: the card of some weights cannot be read.
    """
    cards = {path.stem: card(path) for path in sorted(folder.glob("*.safetensors"))}
    return [name for name, told in cards.items() if told.get("kind") == kind and robot in (None, told.get("robot"))]


def find(name: str, kind: str) -> Path:
    """The file of a shipped name, or of a path to a .safetensors file.

    Raises:
        UnknownPolicy: neither exists; the message lists the known names.
    """
    for path in (SHIPPED / f"{name}.safetensors", Path(name)):
        if path.suffix == ".safetensors" and path.is_file():
            return path
    raise UnknownPolicy(name, known(kind))


def title(policy: str) -> str:
    """What to call weights in a table: their name, or that of the run folder in which a training left them."""
    path = Path(policy)
    return path.resolve().parent.name if path.name == "walk.safetensors" else path.stem


def save(path: Path, tensors: dict[str, Tensor], card: dict) -> None:
    """Write weights and card so that a crash leaves the old pair or the new one."""
    import safetensors.torch

    path.parent.mkdir(parents=True, exist_ok=True)
    for target, data in (
        (path, safetensors.torch.save({k: v.detach().cpu().contiguous() for k, v in tensors.items()})),
        (path.with_suffix(".json"), (json.dumps(card, indent=1) + "\n").encode()),
    ):
        aside = target.with_name(f".{target.name}.{os.getpid()}")
        aside.write_bytes(data)
        aside.replace(target)


def load(path: Path, expect: Mapping[str, object]) -> tuple[dict[str, Tensor], dict]:
    """Tensors and card.

    Args:
        expect: fields of the card that must hold these values, such as kind and robot.

    Raises:
        WrongWeights: a field of the card differs.
        DamagedWeights: the file or its card cannot be read.
    """
    import safetensors.torch

    return _load(path, expect, safetensors.torch.load_file)


def load_arrays(path: Path, expect: Mapping[str, object]) -> tuple[dict[str, np.ndarray], dict]:
    """The same as numpy arrays, without torch."""
    import safetensors.numpy

    return _load(path, expect, safetensors.numpy.load_file)


def check(path: Path, tensors: Mapping[str, Any], network: Mapping[str, Any]) -> None:
    """Whether tensors are those of a network, arrays or tensors by name.

    Raises:
        WrongWeights: one is missing, too many, or of another size.
    """
    found, wanted = ({name: tuple(tensor.shape) for name, tensor in each.items()} for each in (tensors, network))
    for name in wanted | found:
        if found.get(name) != wanted.get(name):
            raise WrongWeights(path, f"a network whose {name!r} is", found.get(name), wanted.get(name))


def card(path: Path) -> dict:
    """What the weights are.

    Raises:
        DamagedWeights: the card cannot be read.
    """
    try:
        told = json.loads(path.with_suffix(".json").read_text())
        if not isinstance(told, dict):
            raise ValueError("its card is no JSON object")
    except (OSError, ValueError, RecursionError) as error:
        raise DamagedWeights(path, str(error)) from error
    return told


def _load(path: Path, expect: Mapping[str, object], read: Callable[[Path], dict[str, Any]]) -> tuple[dict[str, Any], dict]:
    told = card(path)
    try:
        tensors = read(path)
    except (OSError, ValueError, safetensors.SafetensorError) as error:
        raise DamagedWeights(path, str(error)) from error
    for field, wanted in expect.items():
        if told.get(field) != wanted:
            raise WrongWeights(path, field, told.get(field), wanted)
    return tensors, told
