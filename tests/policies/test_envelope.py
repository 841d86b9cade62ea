"""How fast a command to the legs may change, by hand; and that the training asks for nothing else."""

import numpy as np

from policies.envelope import POSTURE, TWIST, next_posture, next_twist
from policies.ppo.config import STAGES


def test_velocities_grow_slowly_brake_fast_and_end_where_training_does():
    now, asked = np.array([[0.0, 0.2, 0.0], [0.5, 0.0, -0.9]]), np.array([[9.0, 0.0, 0.1], [-0.6, 0.0, -9.0]])
    np.testing.assert_allclose(next_twist(now, asked, 0.02), [[0.04, 0.12, 0.08], [0.46, 0.0, -0.98]])
    for _ in range(200):
        now = next_twist(now, asked, 0.02)
    np.testing.assert_allclose(now, [[TWIST[1, 0], 0, 0.1], [TWIST[0, 0], 0, TWIST[0, 2]]])


def test_posture_follows_at_its_own_rates_within_what_is_trained():
    now = np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(next_posture(now, np.array([0.5, 1.0, -1.0]), 0.1), [0.97, 0.06, -0.06])
    for _ in range(50):
        now = next_posture(now, np.array([0.5, 1.0, -1.0]), 0.1)
    np.testing.assert_allclose(now, [POSTURE[0, 0], POSTURE[1, 1], POSTURE[0, 2]])


def test_the_last_stage_of_the_training_keeps_every_command_of_the_envelope_and_none_beyond():
    corners = np.array([TWIST[0], TWIST[1]])
    np.testing.assert_array_equal(STAGES[-1].clip(corners), corners)
    np.testing.assert_array_equal(STAGES[-1].clip(2 * corners), corners)
