"""Mirror, divergence, coordinates and windows of the motion prior."""

import math
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import torch

from policies import checkpoint
from policies.errors import DamagedWeights, WrongWeights
from policies.motion.clip import Clip, ClipSet
from policies.prior.history import WINDOW, History
from policies.prior.model import Curves, Gaussian, PriorModel
from policies.prior.prior import Prior
from policies.prior.single import expected
from policies.prior.train import Terms, elbo
from policies.prior.windows import Variation, Windows
from robots.catalog import load

SPEC = load("h1").spec
GROUP = SPEC.group("waist", "arms")
HOME = SPEC.home[GROUP]
PLAIN = Variation(amplitude=(1, 1), speed=(1, 1), mixed=0, noise=0)


def motions(count: int, seed: int = 0) -> torch.Tensor:
    """Smooth random targets [count, 2 x WINDOW, 15], not symmetric in any way."""
    rng = np.random.default_rng(seed)
    time = np.arange(2 * WINDOW)[:, None] / 50
    phase, rate = rng.uniform(0, 6, (count, 1, 15)), rng.uniform(0.5, 6, (count, 1, 15))
    smooth = HOME + rng.uniform(0, 0.8, (count, 1, 15)) * np.sin(rate * time + phase)
    return torch.tensor(smooth + 0.02 * rng.standard_normal(smooth.shape), dtype=torch.float32)


def mirrored(motion: torch.Tensor) -> torch.Tensor:
    permutation, sign = SPEC.mirror
    return motion[..., (permutation[GROUP] - GROUP.start).tolist()] * torch.tensor(sign[GROUP], dtype=torch.float32)


def swapped(z: torch.Tensor) -> torch.Tensor:
    return z.roll(32, -1)


@pytest.fixture(scope="module")
def model() -> PriorModel:
    torch.manual_seed(3)
    made = PriorModel(SPEC)
    motion = motions(400)
    made.fit(motion[:, :WINDOW], motion[:, WINDOW:])
    for parameter in made.parameters():  # far from the gentle initialisation, so that the mirror is tested where it bends
        parameter.data += 0.1 * torch.randn_like(parameter)
    return made


@torch.no_grad()
def test_mirrored_motion_swaps_the_halves_of_z(model: PriorModel) -> None:
    motion = motions(16, 1)
    past, future = motion[:, :WINDOW], motion[:, WINDOW:]
    seen, twin = model.see(past), model.see(mirrored(past))
    encoder = model.encoder(seen, model.foresee(past, future))
    other = model.encoder(twin, model.foresee(mirrored(past), mirrored(future)))
    for one, two in ((model.prior(seen), model.prior(twin)), (encoder, other)):
        assert (one.mean[:, :32] - one.mean[:, 32:]).abs().mean() > 0.1
        torch.testing.assert_close(two.mean, swapped(one.mean), atol=1e-4, rtol=1e-4)
        torch.testing.assert_close(two.log_variance, swapped(one.log_variance), atol=1e-4, rtol=1e-4)


@torch.no_grad()
def test_the_decoder_of_the_mirror_is_the_mirror_of_the_decoder(model: PriorModel) -> None:
    past, z = motions(16, 2)[:, :WINDOW], torch.randn(16, 64)
    one = model.decoder(z, model.see(past), past)
    two = model.decoder(swapped(z), model.see(mirrored(past)), mirrored(past))
    assert (one - past[:, -1:]).abs().mean() > 0.05
    torch.testing.assert_close(two, mirrored(one), atol=1e-4, rtol=1e-4)


def test_the_fast_path_for_one_robot_is_the_network(model: PriorModel) -> None:
    prior = Prior(model, {})
    past = motions(5, 4)[:, :WINDOW].numpy()
    batch = prior.encode(past)
    assert batch.shape == (5, 64)
    np.testing.assert_allclose(np.stack([prior.encode(row) for row in past]), batch, atol=1e-4)
    assert prior.predict(past[0]).shape == (WINDOW, 15)
    np.testing.assert_allclose(prior.predict(past)[0], prior.predict(past[0]), atol=1e-4)


def test_a_prior_whose_card_or_tensors_are_not_its_networks_is_refused(model: PriorModel, tmp_path: Path) -> None:
    path, card = tmp_path / "p.safetensors", expected(SPEC) | {"shape": asdict(model.shape)}
    checkpoint.save(path, model.state_dict(), card)
    assert Prior.load(str(path), SPEC).card["kind"] == "prior"
    checkpoint.save(path, model.state_dict(), expected(SPEC))
    with pytest.raises(DamagedWeights, match="tells no sizes of networks: 'shape'"):
        Prior.load(str(path), SPEC)
    checkpoint.save(path, model.state_dict(), card | {"shape": asdict(model.shape) | {"past_curves": 9}})
    with pytest.raises(WrongWeights, match="not"):
        Prior.load(str(path), SPEC)


def test_divergence_by_hand() -> None:
    wide = Gaussian(torch.tensor([1.0, 0.0]), torch.tensor([math.log(4.0), 0.0]))
    unit = Gaussian(torch.zeros(2), torch.zeros(2))
    expected = [0.5 * (4 + 1 - 1 - math.log(4)), 0.0]
    torch.testing.assert_close(wide.divergence(unit), torch.tensor(expected))


def test_the_bound_counts_divergence_only_beyond_the_free_nats(model: PriorModel) -> None:
    motion = motions(64, 5)
    windows = motion[:, :WINDOW], motion[:, WINDOW:]

    def loss(beta: float, free: float) -> float:
        torch.manual_seed(0)
        return float(elbo(model, *windows, Terms(free_nats=free), beta)[0])

    torch.manual_seed(0)
    parts = elbo(model, *windows, Terms(), 1.0)[1]
    assert loss(0.0, 0.0) == pytest.approx(parts["rebuilt"] + parts["forecast"], rel=1e-5)
    assert loss(2.0, 0.0) - loss(0.0, 0.0) == pytest.approx(2 * parts["kl"], rel=1e-4)
    assert loss(1.0, 1e6) - loss(0.0, 0.0) == pytest.approx(64e6, rel=1e-4)


def test_curves_give_back_what_lies_in_their_span() -> None:
    time = torch.linspace(0, 1, WINDOW)[:, None]
    motion = torch.randn(200, 1, 4) * time + torch.randn(200, 1, 4) * time**2
    curves = Curves(2, 4)
    assert curves.fit(motion) < 1e-6
    torch.testing.assert_close(curves.inverse(curves(motion)), motion, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(curves(motion).pow(2).mean(0), torch.ones(2, 4), atol=0.01, rtol=0.01)


def clips(*lengths: int) -> ClipSet:
    """Clips whose every joint counts the frames, from 1000 times the clip's number on."""
    made = []
    for i, length in enumerate(lengths):
        q = np.repeat(1000.0 * i + np.arange(length)[:, None], 15, axis=1)
        made.append(Clip(str(i), 50.0, q, np.zeros((length, 3)), np.ones(length), "s", "train", "other"))
    return ClipSet.of(SPEC, made)


def test_windows_hold_the_first_pose_and_never_leave_their_clip() -> None:
    windows = Windows(clips(80, 40, 130), HOME)
    assert len(windows) == 30 + 80  # the second clip is too short; futures end with the clip
    past, future, row = windows.every(1, least_past=1)
    assert set(np.array(windows.names)[row]) == {"0", "2"}
    first = past[0, :, 0]
    torch.testing.assert_close(first, torch.zeros(WINDOW))
    torch.testing.assert_close(future[0, :, 0], torch.arange(1.0, WINDOW + 1))
    assert (past // 1000 == future // 1000).all()
    assert (past[:, -1, 0] + 1 == future[:, 0, 0]).all()
    full = windows.every(1)[0]
    assert len(full) == (80 - 2 * WINDOW + 1 if 2 * WINDOW <= 80 else 0) + 130 - 2 * WINDOW + 1
    assert (full.diff(dim=1) == 1).all()


def test_variations_scale_about_home_and_mix_arms() -> None:
    windows = Windows(clips(200, 200), np.zeros(15))
    past, _ = windows.sample(500, Variation(amplitude=(0.5, 0.5), speed=(1, 1), mixed=0, noise=0))
    step = past[:, -1, 0] - past[:, -2, 0]
    assert {0.5, 1.0} <= set(step.unique().tolist()) <= {0.0, 0.5, 1.0}  # 0 where the first pose is held
    past, future = windows.sample(500, Variation(amplitude=(1, 1), speed=(1, 1), mixed=1, noise=0))
    left, right = past[:, -1, 1], past[:, -1, -1]
    assert (left != right).float().mean() > 0.8
    torch.testing.assert_close(right.roll(-1), left)
    torch.testing.assert_close(future[:, 0, -1], right + 1)
    past, future = windows.sample(500, Variation(amplitude=(1, 1), speed=(2, 2), mixed=0, noise=0))
    assert set((future[:, 1, 0] - future[:, 0, 0]).round(decimals=3).unique().tolist()) <= {0.0, 1.0, 2.0}


def test_history_is_the_last_second_oldest_first() -> None:
    history = History(2, 15)
    history.reset(np.array([True, True]), np.full((2, 15), -1.0))
    for tick in range(120):
        seen = history.push(np.full((2, 15), float(tick)))
        if tick == 9:
            np.testing.assert_array_equal(seen[0, :, 0], [-1.0] * 40 + list(range(10)))
    np.testing.assert_array_equal(seen[1, :, 3], np.arange(70, 120))
    history.reset(np.array([False, True]), np.full((2, 15), 7.0))
    seen = history.push(np.full((2, 15), 8.0))
    np.testing.assert_array_equal(seen[1, :, 0], [7.0] * 49 + [8.0])
    np.testing.assert_array_equal(seen[0, :, 0], [*np.arange(71, 120), 8.0])
