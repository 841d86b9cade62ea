"""GET /metrics: what Prometheus collects."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import get_args

from fastapi import APIRouter, Response
from prometheus_client import CollectorRegistry, PlatformCollector, ProcessCollector
from prometheus_client.exposition import CONTENT_TYPE_LATEST, generate_latest
from prometheus_client.metrics_core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from app.protocol import Health, State


def router(health: Callable[[], Health], simulation: Callable[[], int | None]) -> APIRouter:
    """GET /metrics.

    Args:
        health: the record of this moment.
        simulation: process id of the simulation.
    """
    registry = CollectorRegistry()
    registry.register(Robot(health))
    ProcessCollector(namespace="teleop_web", registry=registry)
    ProcessCollector(namespace="teleop_simulation", pid=lambda: simulation() or "self", registry=registry)
    PlatformCollector(registry=registry)
    api = APIRouter(tags=["robot"])

    @api.get("/metrics")
    def metrics() -> Response:
        """Text for Prometheus: the robot, its loop, and both processes."""
        return Response(generate_latest(registry), media_type=CONTENT_TYPE_LATEST)

    return api


class Robot(Collector):
    """The health record as metrics, read when somebody asks."""

    def __init__(self, health: Callable[[], Health]) -> None:
        self._health = health

    def collect(self) -> Iterable[Metric]:
        """Every metric with its newest value."""
        now = self._health()
        yield CounterMetricFamily("teleop_ticks", "Ticks of the loop.", now.ticks)
        yield CounterMetricFamily("teleop_missed_ticks", "Ticks skipped because the loop was late.", now.missed)
        yield CounterMetricFamily("teleop_refused", "Messages and commands that were refused.", now.rejected)
        yield GaugeMetricFamily("teleop_upright", "1 while the robot has not fallen.", now.upright)
        yield GaugeMetricFamily("teleop_real_time_factor", "Simulated over real time.", now.real_time_factor)
        yield GaugeMetricFamily("teleop_operator_sockets", "Open operator sockets.", now.clients)
        yield GaugeMetricFamily("teleop_driven", "1 while somebody drives.", now.driver is not None)
        yield GaugeMetricFamily("teleop_recording", "1 while an episode is recorded.", now.recording is not None)
        yield GaugeMetricFamily(
            "teleop_recording_alarm", "1 when a recording was cut off or the disk is slow.", now.recording_alarm is not None
        )
        yield _labelled("teleop_state", "1 for the state the robot is in.", "state", {name: name == now.state for name in get_args(State)})
        yield _labelled("teleop_scheduler", "1 for what the loop runs under.", "scheduler", {now.scheduler: True})
        for name, help, of in (
            ("teleop_lateness_seconds", "How late ticks start, over 10 s.", now.lateness_ms),
            ("teleop_ik_seconds", "Inverse kinematics of a tick, over 10 s.", now.ik_ms),
        ):
            yield _labelled(name, help, "quantile", {"0.5": of.p50 / 1e3, "0.99": of.p99 / 1e3})
        stages = {stage: milliseconds / 1e3 for stage, milliseconds in now.latency_ms if milliseconds is not None}
        yield _labelled("teleop_stage_seconds", "Medians of the stages between operator and picture, over 10 s.", "stage", stages)


def _labelled(name: str, help: str, label: str, values: dict[str, float]) -> Metric:
    family = GaugeMetricFamily(name, help, labels=[label])
    for value, number in values.items():
        family.add_metric([value], number)
    return family
