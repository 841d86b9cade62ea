"""The network of one robot without torch is the network of many."""

import numpy as np
import torch

from policies.networks import Actor
from policies.observation import Mirror, action_mirror, layout
from policies.single import SingleActor
from robots.catalog import load

SPEC = load("h1").spec


@torch.no_grad()
def test_the_actor_of_one_robot_is_the_network():
    torch.manual_seed(2)
    mirrors = Mirror.stack(list(layout(SPEC).values())), action_mirror(SPEC)
    actor = Actor(*mirrors)
    actor.normaliser.update(torch.randn(274), torch.rand(274) + 2, 50)
    for parameter in actor.parameters():
        parameter.data += 0.05 * torch.randn_like(parameter)
    single = SingleActor({name: tensor.numpy() for name, tensor in actor.state_dict().items()}, *mirrors)
    seen = 3 * torch.randn(20, 274)
    wanted = actor(seen).numpy()
    assert np.abs(wanted).max() > 0.5
    np.testing.assert_allclose(np.stack([single(row) for row in seen.numpy()]), wanted, atol=2e-4)
