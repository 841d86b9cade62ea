"""Proximal policy optimisation (Schulman et al. 2017) with an asymmetric critic. Readable in one sitting."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import torch
import torch.distributed as dist
from torch import Tensor

from policies.networks import Actor, Critic, Normaliser


@dataclass(frozen=True)
class PPOConfig:
    """Numbers of the learner."""

    horizon: int = 24
    """Ticks each robot plays between two updates."""
    epochs: int = 4
    """Passes over the collected data."""
    minibatches: int = 4
    """Parts the data is split into."""
    gamma: float = 0.99
    """Discount a tick."""
    lam: float = 0.95
    """Trace decay of the advantage estimate."""
    clip: float = 0.2
    """Largest change of the action's probability that pays."""
    entropy: float = 0.003
    """Weight of the exploration bonus."""
    lr: float = 5e-4
    """Learning rate to begin with."""
    lr_range: tuple[float, float] = (5e-5, 1e-3)
    """Where the adaptation keeps it."""
    kl: float = 0.01
    """KL divergence an update aims at; the learning rate follows."""
    max_grad: float = 1.0
    """Gradient norm."""
    deviation: float = 1.0
    """Largest standard deviation of the exploration. Towards the end of a training a small one (0.2) brings what is learnt closer to
    what is shipped: the mean action, without noise."""
    compile: bool = False
    """Fuse the losses with torch.compile: updates take half the time, the first one a minute longer; needs a C++ compiler."""


@dataclass
class Rollout:
    """What `horizon` ticks of `count` robots brought; observations as the networks' features."""

    observations: list[Tensor] = field(default_factory=list)
    states: list[Tensor] = field(default_factory=list)
    actions: list[Tensor] = field(default_factory=list)
    log_probs: list[Tensor] = field(default_factory=list)
    values: list[Tensor] = field(default_factory=list)
    rewards: list[Tensor] = field(default_factory=list)
    ended: list[Tensor] = field(default_factory=list)


def advantages(rewards: Tensor, values: Tensor, ended: Tensor, last: Tensor, gamma: float, lam: float) -> Tensor:
    """Generalised advantage estimate (Schulman et al. 2016).

    Args:
        rewards, values, ended: [horizon, count]; ended is 1 where the episode stopped after that tick.
        last: value of the state after the horizon [count].

    Returns:
        Advantages [horizon, count].
    """
    out, trace = torch.zeros_like(rewards), torch.zeros_like(last)
    for t in reversed(range(len(rewards))):
        after = last if t == len(rewards) - 1 else values[t + 1]
        alive = 1 - ended[t]
        trace = rewards[t] + gamma * alive * after - values[t] + gamma * lam * alive * trace
        out[t] = trace
    return out


def log_prob(action: Tensor, mean: Tensor, deviation: Tensor) -> Tensor:
    """Log density of a diagonal Gaussian [n]."""
    return (-0.5 * ((action - mean) / deviation) ** 2 - deviation.log() - 0.918938533).sum(-1)


def average(tensors: Iterable[Tensor]) -> None:
    """Replace each by its mean over all processes of the training; nothing to do in a single one."""
    if dist.is_initialized():
        tensors = list(tensors)
        flat = torch.cat([x.flatten() for x in tensors])
        dist.all_reduce(flat)
        flat /= dist.get_world_size()
        for x, part in zip(tensors, flat.split([x.numel() for x in tensors]), strict=True):
            x.copy_(part.view_as(x))


def settle(normaliser: Normaliser, x: Tensor) -> None:
    """Fold what all processes saw [n, size] into the statistics of a network's inputs."""
    mean, square = x.mean(0), x.square().mean(0)
    average([mean, square])
    normaliser.update(mean, square, len(x) * (dist.get_world_size() if dist.is_initialized() else 1))


class PPO:
    """Holds the networks and the optimiser; `act` plays, `update` learns."""

    def __init__(self, actor: Actor, critic: Critic, config: PPOConfig) -> None:
        self.actor, self.critic, self.config = actor, critic, config
        self.lr = config.lr
        self.optimiser = torch.optim.Adam([*actor.parameters(), *critic.parameters()], lr=config.lr)
        self.rollout = Rollout()
        self._losses = torch.compile(self._plain_losses) if config.compile else self._plain_losses

    @torch.no_grad()
    def act(self, observation: Tensor, state: Tensor) -> Tensor:
        """Exploring actions [n, 12]; remembers what an update needs."""
        if len(self.rollout.actions) % 4 == 0:  # a quarter of the data settles the statistics as well
            for network, seen in ((self.actor, observation), (self.critic, state)):
                settle(network.normaliser, network.inputs(seen))
        x, y = self.actor.features(observation), self.critic.features(state)
        mean, deviation = self.actor.mean(x), self.actor.deviation()
        action = mean + deviation * torch.randn_like(mean)
        r = self.rollout
        r.observations.append(x)
        r.states.append(y)
        r.actions.append(action)
        r.log_probs.append(log_prob(action, mean, deviation))
        r.values.append(self.critic.value(y))
        return action

    def outcome(self, reward: Tensor, ended: Tensor, timed_out: Tensor) -> None:
        """Result of the last action. A time-out is no failure: its future is worth the state's own value."""
        r = self.rollout
        r.rewards.append(reward + self.config.gamma * r.values[-1] * timed_out)
        r.ended.append(ended)

    @torch.no_grad()
    def _returns(self, state: Tensor) -> tuple[Tensor, Tensor]:
        r, c = self.rollout, self.config
        values = torch.stack(r.values)
        last = self.critic.value(self.critic.features(state))
        gains = advantages(torch.stack(r.rewards), values, torch.stack(r.ended), last, c.gamma, c.lam)
        return gains.flatten(), (gains + values).flatten()

    def update(self, state: Tensor) -> dict[str, float]:
        """Learn from the rollout that ends in `state`; returns losses, KL and the learning rate."""
        c, r = self.config, self.rollout
        gains, targets = self._returns(state)
        gains = (gains - gains.mean()) / (gains.std() + 1e-8)
        data = [torch.cat(x) for x in (r.observations, r.states, r.actions, r.log_probs)]
        old_mean, old_deviation = self._policy(data[0])
        for group in self.optimiser.param_groups:
            group["lr"] = self.lr
        sums = {"policy_loss": 0.0, "value_loss": 0.0}
        for _ in range(c.epochs):
            for part in torch.randperm(len(gains)).chunk(c.minibatches):
                losses = self._losses(*(x[part] for x in (*data, gains, targets)))
                self.optimiser.zero_grad()
                (losses["policy_loss"] + losses["value_loss"] - c.entropy * self.actor.log_deviation.mean() * 12).backward()
                self._step()
                for name in sums:
                    sums[name] += losses[name].item() / (c.epochs * c.minibatches)
        kl = self._adapt(data[0], old_mean, old_deviation)
        self.rollout = Rollout()
        return sums | {"kl": kl, "lr": self.lr, "deviation": self.actor.deviation().mean().item()}

    @torch.no_grad()
    def _policy(self, observations: Tensor) -> tuple[Tensor, Tensor]:
        return self.actor.mean(observations), self.actor.deviation()

    def _plain_losses(self, x: Tensor, y: Tensor, action: Tensor, old: Tensor, gain: Tensor, target: Tensor) -> dict[str, Tensor]:
        ratio = (log_prob(action, self.actor.mean(x), self.actor.deviation()) - old).exp()
        clipped = ratio.clamp(1 - self.config.clip, 1 + self.config.clip)
        return {
            "policy_loss": -torch.min(ratio * gain, clipped * gain).mean(),
            "value_loss": (self.critic.value(y) - target).square().mean(),
        }

    def _step(self) -> None:
        parameters = [p for group in self.optimiser.param_groups for p in group["params"]]
        average([p.grad for p in parameters])
        torch.nn.utils.clip_grad_norm_(parameters, self.config.max_grad)
        self.optimiser.step()
        with torch.no_grad():
            self.actor.log_deviation.clamp_(-2.5, math.log(self.config.deviation))

    def _adapt(self, observations: Tensor, old_mean: Tensor, old_deviation: Tensor) -> float:
        """Move the learning rate so that a whole update changes the policy by about the wanted KL divergence."""
        mean, deviation = self._policy(observations)
        shift = (old_deviation**2 + (old_mean - mean) ** 2) / (2 * deviation**2)
        kl = ((deviation / old_deviation).log() + shift - 0.5).sum(-1).mean()
        average([kl])
        low, high = self.config.lr_range
        if kl > 2 * self.config.kl:
            self.lr = max(low, self.lr / 1.5)
        elif kl < self.config.kl / 2:
            self.lr = min(high, self.lr * 1.5)
        return kl.item()
