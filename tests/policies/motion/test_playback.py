"""The paper's curriculum: alpha by hand, no jumps between plays, and what is played is the motion scaled about home."""

import numpy as np
import pytest

from policies.motion.clip import Clip, ClipSet
from policies.motion.playback import BLEND, FALL, RISE, Playback
from robots import catalog

SPEC = catalog.load("h1").spec
HOME = SPEC.home[SPEC.group("waist", "arms")]
DT = 1 / SPEC.policy_rate


def clips(*seconds: float) -> ClipSet:
    """Each joint swings by 0.3 rad about a pose 0.2 rad from home."""
    made = []
    for i, length in enumerate(seconds):
        time = np.arange(round(length / DT)) * DT
        q = HOME + 0.2 + 0.3 * np.sin(2 * time + i)[:, None] * np.ones(15)
        twist = np.tile([0.4, 0.1 * i, 0.0], (len(q), 1))
        made.append(Clip(f"clip {i}", 50.0, q, twist, np.ones(len(q)), "somebody", "train", "gesture"))
    return ClipSet.of(SPEC, made)


def played(playback: Playback, ticks: int) -> np.ndarray:
    return np.stack([playback.step() for _ in range(ticks)])


def test_alpha_rises_by_a_twentieth_a_play_and_falls_by_a_hundredth_a_fall():
    playback = Playback(SPEC, clips(4.0), 1, np.random.default_rng(0), alpha=0.5)
    played(playback, 200)
    assert playback.alpha == pytest.approx(0.5 + RISE)
    everyone = np.ones(1, bool)
    played(playback, 100)
    playback.reset(everyone, fell=everyone)
    assert playback.alpha == pytest.approx(0.5 + RISE - FALL)
    played(playback, 190)
    playback.reset(everyone, fell=everyone)
    assert playback.alpha == pytest.approx(0.5 + 2 * RISE - FALL), "a fall in the last tenth of a play survived it"
    played(playback, 100)
    playback.reset(everyone, fell=~everyone)
    assert playback.alpha == pytest.approx(0.5 + 2 * RISE - FALL), "an episode that merely ended says nothing about the play"


def test_alpha_stays_within_0_and_1_and_belongs_to_its_motion():
    playback = Playback(SPEC, clips(2.0, 8.0), 64, np.random.default_rng(1))
    for _ in range(8):
        played(playback, 50)
        playback.reset(np.ones(64, bool), np.ones(64, bool))
    assert playback.alpha.tolist() == [0, 0]
    played(playback, 700)
    assert playback.alpha[0] == 1
    assert playback.alpha.max() <= 1


def test_without_the_curriculum_alpha_stays():
    playback = Playback(SPEC, clips(2.0), 4, np.random.default_rng(1), alpha=1.0)
    playback.adaptive = False
    playback.reset(np.ones(4, bool), np.ones(4, bool))
    played(playback, 300)
    assert playback.alpha.tolist() == [1]


def test_at_amplitude_0_the_arms_stay_home_and_at_half_they_go_half_way():
    still = played(Playback(SPEC, clips(3.0), 5, np.random.default_rng(2)), 100)
    np.testing.assert_allclose(still, np.broadcast_to(HOME, still.shape))
    half, full = (Playback(SPEC, clips(3.0), 5, np.random.default_rng(2), alpha=a) for a in (0.5, 1.0))
    np.testing.assert_allclose(played(half, 140) - HOME, 0.5 * (played(full, 140) - HOME), atol=1e-12)


def test_after_the_blend_the_motion_is_the_clip():
    playback = Playback(SPEC, clips(6.0), 1, np.random.default_rng(3), alpha=1.0)
    motion = played(playback, 299)[:, 0]
    after = round(BLEND / DT)
    np.testing.assert_allclose(motion[after:], clips(6.0).clips[0].q[after + 1 :], atol=1e-12)


def test_targets_never_jump_when_a_play_begins():
    playback = Playback(SPEC, clips(1.5, 2.5, 20.0), 32, np.random.default_rng(4), alpha=1.0)
    speed = np.abs(np.diff(played(playback, 1500), axis=0)).max() / DT
    assert speed < 2 * 0.3 + 1.875 * 1.0 / BLEND + 0.5, "motion's own speed and the blend of at most 1 rad"


def test_what_comes_is_known_ahead_within_a_play():
    playback = Playback(SPEC, clips(12.0), 8, np.random.default_rng(5), alpha=1.0)
    ahead = playback.at(0.3)
    np.testing.assert_allclose(ahead, played(playback, 15)[-1])


def test_the_ground_speed_is_the_clips():
    playback = Playback(SPEC, clips(3.0, 3.0), 16, np.random.default_rng(6))
    assert set(playback.twist()[:, 1].tolist()) == {0.0, 0.1}


def test_half_of_the_plays_are_hurried_and_the_feet_go_where_the_arms_are():
    line = np.linspace(0, 1, 200)
    clip = Clip("line", 50.0, HOME + line[:, None], np.outer(line, [1, 0, 0]), np.ones(200), "somebody", "train", "gesture")
    playback = Playback(SPEC, ClipSet.of(SPEC, [clip]), 400, np.random.default_rng(7), alpha=1.0, fastest=1.5)
    motion = played(playback, 120)[-70:, :, 0] - HOME[0]  # after the blend, before the first play ends
    pace = np.diff(motion, axis=0) / (line[1] - line[0])
    np.testing.assert_allclose(pace, np.broadcast_to(pace[0], pace.shape), atol=1e-6)
    assert np.mean(pace[0] < 1 + 1e-6) == pytest.approx(0.5, abs=0.1)
    assert pace.min() > 1 - 1e-6
    assert 1.4 < pace.max() < 1.5
    np.testing.assert_allclose(playback.twist()[:, 0], motion[-1], atol=1.01 * (line[1] - line[0]))
