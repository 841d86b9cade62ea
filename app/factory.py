"""Builds the robot and its policy, in the simulation process only: the web process never loads torch."""

from __future__ import annotations

from dataclasses import dataclass

from app.failsafe import TracedPolicy
from robots import catalog
from robots.plant import Plant


@dataclass(frozen=True)
class Factory:
    """Names of what to build; travels to the simulation process."""

    robot: str
    policy: str
    others: tuple[str, ...] = ()
    """Leg weights that can be changed to while the robot walks."""

    def __call__(self) -> tuple[Plant, TracedPolicy]:
        """The robot at home and its policy.

        Raises:
            RobotError, PolicyError: a name is unknown, or weights do not fit.
        """
        robot = catalog.load(self.robot)  # before torch, so that a wrong name is told at once
        import torch

        from policies.whole_body import WholeBody

        torch.set_num_threads(1)  # the networks are small, and other threads would not be scheduled like this one
        return Plant(robot), WholeBody(robot, self.policy, self.others)
