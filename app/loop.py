"""The program: from the operator's newest command to the robot's next state, once a tick. Start reading here.

Around it: app.child runs it in a process of its own, app.guard decides how far the operator is trusted, policies.whole_body
turns the command into motor targets, robots.plant simulates, and app.server lets people in.
"""

from __future__ import annotations

from app.clock import Laps
from app.failsafe import Failsafe, TracedPolicy
from app.guard import Ask, Guard, ask_from
from app.physics import Physics
from app.publisher import Publisher, Tick
from app.shared import Exchange, Layout, Memory
from policies.command import Command
from policies.episode import row_dtype
from robots.plant import Plant


class Loop:
    """A robot, its policy and its failsafes. Nothing that an operator, the policy or the physics does raises here."""

    def __init__(self, plant: Plant, policy: TracedPolicy, memory: Memory) -> None:
        """The robot stands at home, STOPPED. Presses of buttons that `memory` holds already count as seen."""
        spec, self.state = plant.spec, plant.state()
        self.physics = Physics(plant, lambda reason: self.guard.fault(reason))
        home = Command(height=spec.nominal_height, wrists=self.physics.wrists(), neck=spec.home[spec.group("neck")])
        policy.reset(self.state)
        policy.act(self.state, home)  # the first call is slow, and its trace tells the sizes of a row
        self.policy, self.layout = policy, _layout(plant, policy)
        self.exchange = Exchange(memory, self.layout)
        self.guard = Guard(home, spec.nominal_height, 1 / spec.policy_rate, self.asked())
        self.failsafe = Failsafe(policy, spec, self.guard.fault)
        self.publisher = Publisher(self.exchange, self.physics, self.guard)
        self.laps = Laps()
        self._resets = self.asked().resets

    def tick(self, lateness: float = 0.0, missed: int = 0) -> None:
        """From hand to robot, once.

        Args:
            lateness: how long after its deadline this tick starts [s].
            missed: ticks skipped so far.
        """
        self.laps.restart(lateness)
        ask = self.asked()
        self.reset_if(ask)
        self.policy.choose(ask.policy)
        ruling = self.guard.step(self.laps.start, ask, self.state)
        target = self.laps.time("act", self.failsafe.act, self.state, ruling)
        self.state = self.laps.time("physics", self.physics.step, target)
        trace = self.policy.trace
        latency = self.laps.latency(ask.serial, ask.stamp, trace.ik_ms)
        self.laps.time("publish", self.publisher.publish, Tick(ask, ruling.command, target, self.state, trace, latency, missed))

    def asked(self) -> Ask:
        """The newest command."""
        return ask_from(self.exchange.commands.newest(), self.exchange.commands.count)

    def reset_if(self, ask: Ask) -> None:
        """Obey a press of Reset; whenever the state was set from outside, the policy forgets the past."""
        if ask.resets != self._resets:
            self._resets = ask.resets
            self.state = self.physics.reset(ask.seed)
            self.guard.reset(wrists=self.physics.wrists())
        if self.physics.was_set:
            self.failsafe.reset(self.state)


def _layout(plant: Plant, policy: TracedPolicy) -> Layout:
    trace, model = policy.trace, plant.model
    sizes = (trace.observation.size, trace.latent.size, trace.action.size)
    return Layout(model.nq, trace.reached.q.size, row_dtype(model.nu, plant.save().size, *sizes))
