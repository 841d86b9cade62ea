"""Networks that cannot tell left from right: mirrored input gives mirrored output, exactly.

Inputs are split once into an even and an odd part (unchanged and negated by the mirror). A linear layer that commutes
with the mirror acts on each part alone, so it costs half of an ordinary one; the non-linearity is applied to the
left-right pairs (even + odd, even - odd). After the symmetry-enforcing networks of Abdolhosseini et al. (2019).
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import cast

import torch
from torch import Tensor, nn

from policies.observation import Mirror

_HALF = math.sqrt(0.5)


class Parity(nn.Module):
    """Orthonormal change of basis of a mirrored vector: [even part, odd part]."""

    def __init__(self, mirror: Mirror) -> None:
        super().__init__()
        rows, self.even = mirror.parity()
        self.odd = len(rows) - self.even
        self.register_buffer("basis", torch.tensor(rows, dtype=torch.float32), persistent=False)
        self.basis: Tensor

    def forward(self, x: Tensor) -> Tensor:
        """[..., size] in its own order -> [..., even + odd]."""
        return x @ self.basis.T

    def inverse(self, x: Tensor) -> Tensor:
        """[..., even + odd] -> [..., size] in its own order."""
        return x @ self.basis


class Normaliser(nn.Module):
    """Running mean and deviation of a vector in the even-odd basis; the odd part's mean is 0 by symmetry."""

    def __init__(self, even: int, odd: int) -> None:
        super().__init__()
        self._even = even
        self.register_buffer("mean", torch.zeros(even + odd))
        self.register_buffer("variance", torch.ones(even + odd))
        self.register_buffer("count", torch.tensor(1e-2))
        self.mean: Tensor
        self.variance: Tensor
        self.count: Tensor

    def update(self, fresh: Tensor, square: Tensor, count: int) -> None:
        """Fold the mean [size] and the mean square [size] of `count` vectors into the statistics."""
        fresh = self._symmetric(fresh)
        spread = square - fresh**2
        total = self.count + count
        share, shift = count / total, fresh - self.mean
        self.variance.copy_((1 - share) * self.variance + share * spread + share * (1 - share) * shift**2)
        self.mean.add_(share * shift)
        self.count.copy_(total)

    def adopt(self, x: Tensor, mask: Tensor) -> None:
        """Forget the statistics of the masked inputs [size] and take those of x [n, size]."""
        mean = self._symmetric(x.mean(0))
        self.mean[mask], self.variance[mask] = mean[mask], (x.square().mean(0) - mean**2)[mask]

    def magnify(self, mask: Tensor, factor: float) -> None:
        """See the masked inputs [size] `factor` times as large."""
        self.mean[mask] /= factor
        self.variance[mask] /= factor**2

    def _symmetric(self, mean: Tensor) -> Tensor:
        return torch.cat([mean[: self._even], torch.zeros_like(mean[self._even :])])

    def forward(self, x: Tensor) -> Tensor:
        return ((x - self.mean) / (self.variance.clamp(min=0).sqrt() + 0.01)).clamp(-8, 8)


class MirrorMLP(nn.Module):
    """ELU layers on an [even, odd] input; the output has an even part and, if asked for, an odd part."""

    def __init__(self, even: int, odd: int, hidden: tuple[int, ...], out_even: int, out_odd: int, out_gain: float) -> None:
        super().__init__()
        sizes = [(even, odd)] + [(h // 2, h // 2) for h in hidden] + [(out_even, out_odd)]
        self.evens = nn.ModuleList(nn.Linear(a[0], b[0]) for a, b in pairwise(sizes))
        self.odds = nn.ModuleList(nn.Linear(a[1], b[1], bias=False) for a, b in pairwise(sizes) if b[1])
        self._split = even
        for stack in (self.evens, self.odds):
            for i, layer in enumerate(stack):
                nn.init.orthogonal_(cast(nn.Linear, layer).weight, out_gain if i == len(hidden) else math.sqrt(2))
        for layer in self.evens:
            nn.init.zeros_(cast(nn.Linear, layer).bias)

    @torch.no_grad()
    def ignore(self, mask: Tensor) -> None:
        """Make the first layer blind to the masked inputs [size], until it learns otherwise."""
        cast(nn.Linear, self.evens[0]).weight[:, mask[: self._split]] = 0
        cast(nn.Linear, self.odds[0]).weight[:, mask[self._split :]] = 0

    def forward(self, x: Tensor) -> Tensor:
        even, odd = x[..., : self._split], x[..., self._split :]
        for i, layer in enumerate(self.evens[:-1]):
            even, odd = layer(even), self.odds[i](odd)
            left, right = nn.functional.elu(_HALF * (even + odd)), nn.functional.elu(_HALF * (even - odd))
            even, odd = _HALF * (left + right), _HALF * (left - right)
        even = self.evens[-1](even)
        if len(self.odds) == len(self.evens):
            return torch.cat([even, self.odds[-1](odd)], -1)
        return even


class Actor(nn.Module):
    """Observation [n, size] -> mean action [n, 12], mirror-equivariant, with a learnt symmetric deviation."""

    def __init__(self, observation: Mirror, action: Mirror, hidden: tuple[int, ...] = (256, 192, 128), deviation: float = 0.8) -> None:
        super().__init__()
        self.inputs, self.outputs = Parity(observation), Parity(action)
        self.normaliser = Normaliser(self.inputs.even, self.inputs.odd)
        self.body = MirrorMLP(self.inputs.even, self.inputs.odd, hidden, self.outputs.even, self.outputs.odd, out_gain=0.01)
        self.log_deviation = nn.Parameter(torch.full((len(action.sign) // 2,), math.log(deviation)))

    def features(self, observation: Tensor) -> Tensor:
        """The observation in the even-odd basis, normalised."""
        return self.normaliser(self.inputs(observation))

    def mean(self, features: Tensor) -> Tensor:
        """Mean action [n, 12] from features."""
        return self.outputs.inverse(self.body(features))

    def forward(self, observation: Tensor) -> Tensor:
        return self.mean(self.features(observation))

    def deviation(self) -> Tensor:
        """Standard deviation of the exploring policy [12]."""
        return self.log_deviation.exp().repeat(2)


class Critic(nn.Module):
    """Observation and privileged state [n, size] -> value [n], the same for mirrored states."""

    def __init__(self, observation: Mirror, hidden: tuple[int, ...] = (256, 192, 128)) -> None:
        super().__init__()
        self.inputs = Parity(observation)
        self.normaliser = Normaliser(self.inputs.even, self.inputs.odd)
        self.body = MirrorMLP(self.inputs.even, self.inputs.odd, hidden, 1, 0, out_gain=1.0)

    def features(self, state: Tensor) -> Tensor:
        """The state in the even-odd basis, normalised."""
        return self.normaliser(self.inputs(state))

    def value(self, features: Tensor) -> Tensor:
        """Value [n] from features."""
        return self.body(features).squeeze(-1)
