"""The CVAE of the motion prior: prior R, encoder E, decoder D (paper section III-A), mirror-equivariant by construction.

M0 is the last second of upper-body targets, M1 the next. R(z | M0) and E(z | M0, M1) are diagonal Gaussians over 64 numbers,
D predicts M1 from z and M0; each is a three-layer MLP. z has two halves that swap when the motion is mirrored, so that a mirror-
equivariant leg policy can read it. What the networks see of a motion is its last pose and the motion relative to it, in an
orthonormal basis of curves (the principal components of training data over time, the same for every joint), scaled to unit variance;
D's output is in such a basis too, added to the last pose. Both are linear; `Curves.fit` tells how little they leave out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn

from policies.networks import MirrorMLP, Parity
from policies.observation import LATENT, joint_mirror
from policies.prior.history import WINDOW
from robots.spec import RobotSpec

_HALF = math.sqrt(0.5)


@dataclass(frozen=True)
class Shape:
    """Sizes of the networks; kept in the card of the weights."""

    past_curves: int = 14
    """Basis curves for M0."""
    future_curves: int = 12
    """Basis curves for M1."""
    prior_hidden: tuple[int, int] = (256, 128)
    """Hidden layers of R; it runs every tick."""
    encoder_hidden: tuple[int, int] = (256, 128)
    """Hidden layers of E."""
    decoder_hidden: tuple[int, int] = (256, 256)
    """Hidden layers of D."""

    @staticmethod
    def read(stored: dict[str, Any]) -> Shape:
        """The sizes in a card, where tuples have become lists."""
        sizes: dict[str, Any] = {name: tuple(size) if isinstance(size, list) else size for name, size in stored.items()}
        return Shape(**sizes)


@dataclass(frozen=True)
class Gaussian:
    """Diagonal Gaussians over z."""

    mean: Tensor
    """[..., 64]"""
    log_variance: Tensor
    """[..., 64]"""

    def sample(self) -> Tensor:
        """One draw each, differentiable."""
        return self.mean + torch.randn_like(self.mean) * (0.5 * self.log_variance).exp()

    def divergence(self, other: Gaussian) -> Tensor:
        """KL(self || other) of every number [..., 64], nats."""
        ratio = (self.log_variance - other.log_variance).exp()
        shift = (self.mean - other.mean) ** 2 * (-other.log_variance).exp()
        return 0.5 * (ratio + shift - 1 - self.log_variance + other.log_variance)


class Curves(nn.Module):
    """Linear coordinates of a motion relative to a pose: [.., WINDOW, channels] <-> [.., curves, channels], of unit variance."""

    def __init__(self, curves: int, channels: int) -> None:
        super().__init__()
        self.register_buffer("basis", torch.eye(curves, WINDOW))
        self.register_buffer("scale", torch.ones(curves, channels))
        self.basis: Tensor
        """Orthonormal curves over time [curves, WINDOW]."""
        self.scale: Tensor
        """Standard deviation of each coordinate [curves, channels], rad."""

    def fit(self, motion: Tensor) -> float:
        """Basis and scale from motions relative to their pose [n, WINDOW, channels]; the share of the variance left out."""
        flat = motion.transpose(1, 2).reshape(-1, WINDOW).double()
        values, vectors = torch.linalg.eigh(flat.T @ flat)
        kept = len(self.basis)
        self.basis.copy_(vectors.flip(1)[:, :kept].T)
        self.scale.copy_((self.basis @ motion).pow(2).mean(0).sqrt() + 1e-4)
        return float(values.flip(0)[kept:].sum() / values.sum())

    def forward(self, motion: Tensor) -> Tensor:
        return (self.basis @ motion) / self.scale

    def inverse(self, coordinates: Tensor) -> Tensor:
        """The motion relative to its pose from its coordinates."""
        return self.basis.T @ (coordinates * self.scale)


class PriorModel(nn.Module):
    """R, E and D. Motions are joint targets [.., WINDOW, 15], rad."""

    def __init__(self, spec: RobotSpec, shape: Shape | None = None) -> None:
        super().__init__()
        self.shape = shape = shape or Shape()
        self.mirror = joint_mirror(spec, spec.group("waist", "arms"))
        self.parity = Parity(self.mirror)
        """Joints as sums (even, unchanged by the mirror) and differences (odd, negated) of left and right."""
        even, odd = self.parity.even, self.parity.odd
        self.register_buffer("pose_mean", torch.zeros(even + odd))
        self.register_buffer("pose_scale", torch.ones(even + odd))
        self.pose_mean: Tensor
        self.pose_scale: Tensor
        self.past, self.future = Curves(shape.past_curves, even + odd), Curves(shape.future_curves, even + odd)
        seen, both, half = 1 + shape.past_curves, 1 + shape.past_curves + shape.future_curves, LATENT // 2
        self.r = MirrorMLP(seen * even, seen * odd, shape.prior_hidden, LATENT, LATENT, out_gain=0.5)
        self.e = MirrorMLP(both * even, both * odd, shape.encoder_hidden, LATENT, LATENT, out_gain=0.5)
        out = shape.future_curves * even, shape.future_curves * odd
        self.d = MirrorMLP(half + seen * even, half + seen * odd, shape.decoder_hidden, *out, out_gain=0.1)

    def fit(self, history: Tensor, future: Tensor) -> tuple[float, float]:
        """Set the normalisation from training windows [n, WINDOW, 15] each; the share of variance that the curves of past and of
        future leave out. The mirror only negates odd channels, so that mirrored twins would change nothing but their mean, 0."""
        history, future = self.parity(history), self.parity(future)
        last = history[:, -1:]
        self.pose_mean.copy_(last.mean((0, 1)))
        self.pose_mean[self.parity.even :] = 0
        self.pose_scale.copy_((last - self.pose_mean).pow(2).mean((0, 1)).sqrt() + 1e-4)
        return self.past.fit(history - last), self.future.fit(future - last)

    def see(self, history: Tensor) -> Tensor:
        """What the networks know of M0: its last pose, then its curves [.., 1 + curves, 15 channels]."""
        last = history[..., -1:, :]
        # parity acts on channels and the basis on time: taken after the basis it has 15 rows to turn instead of 50
        rows = self.parity(torch.cat([last, self.past.basis @ (history - last)], -2))
        return torch.cat([(rows[..., :1, :] - self.pose_mean) / self.pose_scale, rows[..., 1:, :] / self.past.scale], -2)

    def prior(self, seen: Tensor) -> Gaussian:
        """R(z | M0)."""
        return _gaussian(self.r(self._flat(seen)))

    def foresee(self, history: Tensor, future: Tensor) -> Tensor:
        """Coordinates of M1 relative to the last pose [.., curves, 15 channels]."""
        return self.future(self.parity(future - history[..., -1:, :]))

    def encoder(self, seen: Tensor, coming: Tensor) -> Gaussian:
        """E(z | M0, M1), both in coordinates."""
        return _gaussian(self.e(self._flat(torch.cat([seen, coming], -2))))

    def forecast(self, z: Tensor, seen: Tensor) -> Tensor:
        """D in coordinates: the next second relative to the last pose [.., curves, 15 channels], from z and M0.

        `seen` may hide curves of M0 from it.
        """
        left, right = z[..., : LATENT // 2], z[..., LATENT // 2 :]
        split, curves = self.parity.even, self.shape.future_curves
        even, odd = seen[..., :split].flatten(-2), seen[..., split:].flatten(-2)
        out = self.d(torch.cat([_HALF * (left + right), even, _HALF * (left - right), odd], -1))
        even, odd = out[..., : curves * split].unflatten(-1, (curves, -1)), out[..., curves * split :].unflatten(-1, (curves, -1))
        return torch.cat([even, odd], -1)

    def decoder(self, z: Tensor, seen: Tensor, history: Tensor) -> Tensor:
        """D: the next second [.., WINDOW, 15] from z and M0, rad."""
        return history[..., -1:, :] + self.parity.inverse(self.future.inverse(self.forecast(z, seen)))

    def _flat(self, rows: Tensor) -> Tensor:
        """Channels of all rows, even ones first [.., rows x 15]."""
        split = self.parity.even
        return torch.cat([rows[..., :split].flatten(-2), rows[..., split:].flatten(-2)], -1)


def _gaussian(parity: Tensor) -> Gaussian:
    """From an [even, odd] output [.., 128], each part mean then log variance, to halves that swap in the mirror."""
    even, odd = parity[..., :LATENT], parity[..., LATENT:]
    left, right = _HALF * (even + odd), _HALF * (even - odd)
    half = LATENT // 2
    mean = torch.cat([left[..., :half], right[..., :half]], -1)
    log_variance = torch.cat([left[..., half:], right[..., half:]], -1)
    return Gaussian(mean, 6 * torch.tanh(log_variance / 6))
