"""What can be chosen about a training of the legs, and its stages."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from policies.ppo.algorithm import PPOConfig
from policies.ppo.env import Stage

STAGES = (
    Stage("A", 6e6, stand=0.12, vx=(0.2, 0.8), vy=0.1, yaw=0.3, push=0.3, arms=False),
    Stage("B", 12e6, stand=0.25, push=0.8, posture=0.15),
    Stage("C", 1e12, stand=0.3, push=1.3, posture=0.35),
)


@dataclass(frozen=True)
class WalkConfig:
    """Train a leg policy.

    Example: teleop-train walk --run runs/walk --steps 40e6
    With a motion prior: teleop-train walk --run runs/pmp --prior prior_h1 --motions runs/clips.npz runs/synthetic.npz --begin runs/walk
    On several processes: torchrun --standalone --nproc-per-node 2 -- .venv/bin/teleop-train walk --run runs/walk --threads 4
    The same command again resumes from the last checkpoint.
    """

    run: Path = Path("runs/walk")
    """Folder of checkpoints, curves and a copy of this configuration."""
    robot: str = "h1"
    """Name in the catalog."""
    motions: tuple[Path, ...] = ()
    """Clips of `teleop-train retarget` and `synthetic` whose training split moves the arms, jumping and running left out."""
    reaches: int = 512
    """Clips of random reaches beside them."""
    prior: str | None = None
    """Motion prior that makes the latent: shipped weights by name, or a .safetensors file. Without one the latent is 0."""
    curriculum: bool = True
    """Let each motion's amplitude grow from 0 as the robots survive it (paper III-C); without it every motion plays in full."""
    alpha: float = 0.0
    """Amplitude of every motion to begin with."""
    begin: Path | None = None
    """Run folder whose networks a new training begins with."""
    steps: float = 40e6
    """Control steps to train for, over all resumptions and processes."""
    count: int = 1024
    """Robots simulated side by side, in each process."""
    seed: int = 1
    """Of environments and networks."""
    threads: int = 0
    """Physics threads, in each process; 0 takes every core."""
    device: str = "auto"
    """Where the learner computes: cpu, cuda, or auto."""
    torch_threads: int = 2
    """Threads of a learner on the cpu."""
    save_minutes: float = 3.0
    """Time between checkpoints."""
    ppo: PPOConfig = field(default_factory=PPOConfig)
    """The learner."""
