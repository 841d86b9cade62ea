"""`teleop-train mean`: several trainings become one policy by the mean of their weights (Wortsman et al. 2022, Model soups)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from policies import checkpoint
from policies.commit import commit
from policies.errors import PolicyError
from policies.networks import Actor
from policies.observation import Mirror, action_mirror, layout, where
from robots import catalog


@dataclass(frozen=True)
class MeanConfig:
    """Average the weights of leg trainings that began with the same networks and see the same motion prior.

    Example: teleop-train mean --weights runs/pmp/walk.safetensors runs/more/walk.safetensors --shares 3 2 --out runs/mean/walk.safetensors
    """

    weights: tuple[str, ...]
    """Two or more: .safetensors files, or shipped weights by name."""
    shares: tuple[float, ...] = ()
    """How much of each counts; without them all count alike."""
    sideways: float = 1.0
    """Sideways commands are read as so many times as large: for legs that go sideways slower than they are told."""
    out: Path = Path("runs/mean/walk.safetensors")
    """File to write, with its card beside it."""


class NoMean(PolicyError):
    """Numbers that make no mean."""

    def __init__(self, config: MeanConfig) -> None:
        super().__init__(
            f"{len(config.weights)} weights with shares {list(config.shares)} and sideways {config.sideways} make no mean: "
            "give two --weights or more, one of --shares above 0 for each or none at all, and --sideways above 0"
        )


def mean(config: MeanConfig) -> Path:
    """Write the mean and its card; returns the path.

    Raises:
        NoMean: fewer than two weights, not one positive share for each, or no positive factor.
        UnknownPolicy, WrongWeights, DamagedWeights: see `policies.checkpoint`; WrongWeights also where robot, observation or prior differ.
    """
    given = config.shares or (1.0,) * len(config.weights)
    if len(given) != len(config.weights) or len(given) < 2 or min(given) <= 0 or config.sideways <= 0:
        raise NoMean(config)
    shares = [share / sum(given) for share in given]
    paths = [checkpoint.find(name, "walk") for name in config.weights]
    first = checkpoint.card(paths[0])
    same = {"kind": "walk"} | {field: first.get(field) for field in ("robot", "observation", "action", "prior")}
    tensors, cards = zip(*(checkpoint.load(path, same) for path in paths), strict=True)
    spec = catalog.load(first["robot"]).spec
    actor = Actor(Mirror.stack(list(layout(spec).values())), action_mirror(spec))
    for path, each in zip(paths, tensors, strict=True):
        checkpoint.check(path, each, actor.state_dict())
    actor.load_state_dict({name: sum(s * each[name] for s, each in zip(shares, tensors, strict=True)) for name in tensors[0]})
    sideways = where(spec, "twist").start + 1
    actor.normaliser.magnify(actor.inputs.basis[:, sideways] != 0, config.sideways)
    mean_of = [
        {"weights": checkpoint.title(name), "share": round(share, 4)} | {k: v for k, v in card.items() if k not in (*same, "name")}
        for name, share, card in zip(config.weights, shares, cards, strict=True)
    ]
    card = same | {"name": config.out.stem, "mean_of": mean_of, "sideways": config.sideways, "commit": commit()}
    checkpoint.save(config.out, actor.state_dict(), card)
    return config.out
