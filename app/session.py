"""One run of the program, put together: the only place that names what is plugged into what."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from fastapi import FastAPI

from app import episodes, invite, legs
from app.config import Serve
from app.errors import UnknownSource, UnusableSource
from app.factory import Factory
from app.inputs.circle import Circle
from app.inputs.feed import Feed
from app.inputs.motion import Motion
from app.inputs.operator import Operators
from app.inputs.replay import Replay
from app.inputs.source import Source
from app.inputs.webxr import Headsets
from app.mode import Reason
from app.outputs import forecast, metrics
from app.outputs.telemetry import Names, Telemetry
from app.page import Page
from app.protocol import Health
from app.server import create_app
from app.simulation import Simulation
from app.watch import Watch
from policies import checkpoint
from policies.episode import DamagedRecording, Metadata
from policies.errors import UnknownPolicy
from policies.motion.clip import Clip
from policies.recording.provenance import describe
from robots import catalog

SOURCES: dict[str, Callable[[str], Source]] = {
    "circle": Circle,
    "replay": Replay,
}
"""What `--sources NAME` or `NAME:ARGUMENT` may name. Pages, headsets and scripts come through the operator's socket."""


class Session:
    """Everything that lives while the program runs. `close` ends all of it."""

    def __init__(self, config: Serve, token: str | None = None) -> None:
        """Start the robot and wait until it stands.

        Args:
            config: what the program was started with.
            token: what people have to know to be let in.

        Raises:
            RobotError, PolicyError, UnknownSource: an unknown name.
            UnusableSource: a source cannot read its file.
            SimulationFailed: the robot could not be built; the message says why.
        """
        self._token, sources = token, [_source(wanted) for wanted in config.sources]
        self._robot, self._weights = catalog.load(config.robot), checkpoint.find(config.policy, "walk")
        others = tuple(name for name in checkpoint.known("walk", robot=config.robot) if name != self._weights.stem)
        self.policies = (self._weights.stem, *others)
        """Names of the leg weights that can walk; the robot begins with the first."""
        self.simulation = Simulation(Factory(config.robot, str(self._weights), others))
        self.simulation.start()
        try:
            self._model = self._robot.model("play")  # while the other process builds its own
            self._page = Page(self._robot.spec, self._model, self.simulation.snapshot)
            self._headsets = Headsets(self._robot.spec, self._model, self.simulation.applied)
            self.simulation.wait()
        except BaseException:
            self.simulation.close()
            raise
        self._host, self._names, exchange = config.host, config.names, self.simulation.exchange
        self.operators = Operators(exchange.commands, self.simulation.applied)
        description = ThreadPoolExecutor(1).submit(self._describe)  # ready before the first episode
        self.episodes = episodes.Episodes(config.recordings, description.result, exchange.rows, lambda: self.operators.seed)
        priors = [checkpoint.card(checkpoint.find(name, "walk"))["prior"] for name in (str(self._weights), *others)]
        self._forecaster = forecast.Forecaster(self._robot, self.policies, priors, exchange.snapshots)
        names = Names(config.robot, self.policies, self._robot.spec.policy_rate)
        self._telemetry = Telemetry(names, self.simulation, self.operators)
        self._feeds = [Feed(source, self.operators, self.simulation.applied) for source in sources]
        self._watch = Watch(self.health, lambda: self.simulation.lost, self.episodes.recorder)

    def app(self) -> FastAPI:
        """The site."""
        told = metrics.router(self.health, lambda: self.simulation.pid)
        routers = [*self._page.routers, episodes.router(self.episodes), invite.router(self._token), told]
        routers += legs.router(self.choose, self.operators), forecast.router(self._forecaster.now)
        return create_app(self.health, self.operators, self.reset, self._host, routers, self._names, self._token, self._headsets.join)

    def play(self, clip: Clip, speed: float) -> Motion:
        """Let a motion drive the arms from here on.

        Raises:
            OddSpeed: nothing can be played at this speed.
        """
        motion = Motion(self._robot, clip, self.simulation.snapshot, speed)
        self._feeds.append(Feed(motion, self.operators, self.simulation.applied))
        return motion

    def missing(self) -> list[str]:
        """What the robot could look better with; a sentence each."""
        return self._robot.missing()

    def health(self) -> Health:
        """The record of this moment."""
        recorder = self.episodes.recorder.status()
        return self._telemetry.health(recorder.open.id if recorder.open else None, recorder.alarm)

    def choose(self, policy: str) -> None:
        """Walk with other leg weights from the next tick on.

        Raises:
            UnknownPolicy: these cannot.
        """
        if policy not in self.policies:
            raise UnknownPolicy(policy, self.policies)
        self.operators.choose(self.policies.index(policy))

    def reset(self, seed: int = 0) -> None:
        """Put the robot back home, or near it by a seed; start the simulation again if it is lost (blocks until it stands)."""
        if self.simulation.lost:
            self.simulation.restart()
        self.operators.reset(seed)

    def close(self) -> None:
        """End the open episode, then the simulation."""
        self._watch.close()
        for feed in self._feeds:
            feed.close()
        self.episodes.close()
        self.simulation.close()
        self._page.close()

    def _describe(self) -> tuple[Metadata, bytes]:
        reasons = [reason.sentence for reason in Reason]
        rows = self.simulation.exchange.rows.dtype
        return describe(self._robot.spec, self._model, rows, self.policies, self._weights, reasons)


def _source(wanted: str) -> Source:
    """The source that a `NAME` or `NAME:ARGUMENT` means.

    Raises:
        UnknownSource: there is none.
        UnusableSource: it cannot read its file.
    """
    name, _, argument = wanted.partition(":")
    if name not in SOURCES:
        raise UnknownSource(name, known=list(SOURCES))
    try:
        return SOURCES[name](argument)
    except (DamagedRecording, OSError) as error:
        raise UnusableSource(wanted, str(error)) from error
