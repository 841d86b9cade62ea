"""A different robot and floor for every environment: what simulation cannot know is made random."""

from __future__ import annotations

import numpy as np

from robots.batch import Fleet


def randomise(fleet: Fleet, rng: np.random.Generator) -> np.ndarray:
    """Draw friction, masses, centre of mass, loads in the hands and motor gains for every robot of the fleet, for good.

    Returns:
        What the critic may know of it [n, 6]: friction - 1, torso mass [kg / 5], torso com [m x 20], load difference.
    """
    model, n, batch = fleet.model, fleet.count, fleet.batch
    friction = rng.uniform(0.5, 1.25, n)
    batch.expand("geom_friction")[:, :, 0] = friction[:, None]

    mass, com, inertia = batch.expand("body_mass"), batch.expand("body_ipos"), batch.expand("body_inertia")
    scale = rng.uniform(0.9, 1.1, (n, model.nbody))
    mass *= scale
    inertia *= scale[:, :, None]
    torso = model.body("torso_link").id
    extra = rng.uniform(-1, 5, n)
    mass[:, torso] += extra
    shift = rng.uniform(-0.03, 0.03, (n, 3))
    com[:, torso] += shift
    load = rng.uniform(0, 1, (n, 2)) * (rng.random((n, 1)) < 0.5)
    for i, side in enumerate(("left", "right")):
        mass[:, model.body(f"{side}_wrist_yaw_link").id] += load[:, i]

    gain, bias = batch.expand("actuator_gainprm"), batch.expand("actuator_biasprm")
    kp, kd = rng.uniform(0.9, 1.1, (2, n, model.nu))
    gain[:, :, 0] *= kp
    bias[:, :, 1] *= kp
    bias[:, :, 2] *= kd
    batch.set_const()
    return np.column_stack([friction - 1, extra / 5, shift * 20, load[:, 0] - load[:, 1]]).astype(np.float32)
