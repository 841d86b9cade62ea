"""The web side over real sockets, with a hanging robot behind it."""

from __future__ import annotations

import json
import os
import signal
import socket
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from itertools import pairwise

import pytest
import uvicorn
from stand_ins import eventually
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from app.errors import SimulationFailed
from app.inputs.operator import Operators
from app.mode import Reason
from app.outputs.telemetry import Names, Telemetry
from app.server import create_app
from app.simulation import Simulation


class Site:
    """A running server."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation, self.broken = simulation, False
        self.operators = Operators(simulation.exchange.commands, simulation.applied)
        telemetry = Telemetry(Names("h1", ("none",), 50.0), simulation, self.operators)
        app = create_app(telemetry.health, self.operators, self.reset, "127.0.0.1")
        self._server = uvicorn.Server(uvicorn.Config(app, log_level="critical", timeout_graceful_shutdown=1))
        self._door = socket.create_server(("127.0.0.1", 0))
        self.port = self._door.getsockname()[1]
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [self._door]})
        self._thread.start()
        eventually(lambda: self._server.started)

    def reset(self, seed: int) -> None:
        if self.broken:
            raise SimulationFailed("the robot is broken")
        self.simulation.restart() if self.simulation.lost else self.operators.reset(seed)

    def close(self) -> None:
        self._server.should_exit = True
        self._thread.join()
        self._door.close()

    def operator(self, **headers: str) -> ClientConnection:
        return connect(f"ws://127.0.0.1:{self.port}/api/operator", additional_headers=headers, compression=None)

    def ask(self, path: str, method: str = "GET", **headers: str) -> str:
        request = urllib.request.Request(f"http://127.0.0.1:{self.port}{path}", method=method, headers=headers)
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.read().decode()

    def health(self) -> dict:
        return json.loads(self.ask("/api/health"))


@pytest.fixture(scope="module")
def running(shared_simulation: Simulation) -> Iterator[Site]:
    site = Site(shared_simulation)
    yield site
    site.close()


@pytest.fixture
def site(running: Site, simulation: Simulation) -> Site:
    running.ask("/api/reset", "POST")
    eventually(lambda: running.health()["state"] == "STOPPED")
    return running


class Driver:
    """Sends the same fields every 50 ms, as a page does; keeps the newest answer."""

    def __init__(self, site: Site, **fields) -> None:
        self.fields, self.answers, self._seq, self._going = fields, [], 0, True
        self._socket = site.operator()
        self._threads = [threading.Thread(target=work) for work in (self._speak, self._listen)]
        for thread in self._threads:
            thread.start()

    @property
    def newest(self) -> dict:
        return self.answers[-1] if self.answers else {"state": "", "driving": False, "seq": -1, "error": None}

    def _speak(self) -> None:
        while self._going:
            self._seq += 1
            hiccup = self.newest["state"] == "HOLD" and self.newest["reason"] == Reason.SILENT.sentence
            again = {"engage": False} if hiccup and self.newest["driving"] else {}  # this machine is busy: press again
            self._socket.send(json.dumps({"seq": self._seq, **self.fields, **again}))
            time.sleep(0.05)

    def _listen(self) -> None:
        try:
            for answer in self._socket:
                self.answers.append(json.loads(answer))
        except ConnectionClosed:
            pass

    def fall_silent(self) -> None:
        self._going = False
        self._threads[0].join()

    def close(self) -> None:
        self.fall_silent()
        self._socket.close()
        self._threads[1].join()


@pytest.fixture
def driver(site: Site) -> Iterator[Driver]:
    driving = Driver(site, engage=True, twist={"vx": 0.5})
    eventually(lambda: driving.newest["state"] == "ENGAGED")
    yield driving
    driving.close()


def test_health_has_every_field_that_scripts_rely_on(site: Site) -> None:
    health = site.health()
    assert health["robot"] == "h1"
    assert health["upright"] is True
    assert health["ticks"] > 0
    assert set(health["base"]) == {"x", "y", "z", "yaw", "roll", "pitch", "vx", "vy", "yaw_rate"}
    assert set(health["command"]) == {"vx", "vy", "yaw_rate", "height", "roll", "pitch", "hands", "neck", "waist"}
    assert health["driver"] is None
    for side in ("left", "right"):
        for kind in ("target", "reachable", "actual"):
            pose = health["wrists"][side][kind]
            assert (len(pose["position"]), len(pose["quaternion"])) == (3, 4)
    for name in ("lateness_ms", "ik_ms"):
        assert set(health[name]) == {"p50", "p99"}
    assert {"policy", "time", "real_time_factor", "missed", "scheduler", "reason"} <= set(health)


def test_a_script_engages_and_drives_and_is_answered_with_health(driver: Driver) -> None:
    eventually(lambda: driver.newest["command"]["vx"] == pytest.approx(0.5))
    assert driver.newest["driving"]
    assert driver.newest["driver"] == driver.newest["you"]
    assert driver.newest["clients"] == 1
    assert driver.newest["seq"] > 1


def test_answers_come_whether_or_not_anything_is_said(site: Site) -> None:
    with site.operator() as watcher:
        times = [json.loads(watcher.recv(timeout=10)) and time.monotonic() for _ in range(8)]
    gaps = sorted(b - a for a, b in pairwise(times))
    assert gaps[0] < 0.05, "at least 20 a second, where the machine is not busy"


def test_silence_holds_and_only_a_fresh_press_goes_on(driver: Driver, site: Site) -> None:
    driver.fall_silent()
    eventually(lambda: site.health()["state"] == "HOLD")
    eventually(lambda: site.health()["command"]["vx"] == 0)


def test_a_closed_socket_holds_and_frees_the_lease(driver: Driver, site: Site) -> None:
    driver.close()
    eventually(lambda: site.health()["state"] == "HOLD")
    assert site.health()["driver"] is None


@pytest.mark.row(11)
def test_anyone_stops(driver: Driver, site: Site) -> None:
    site.ask("/api/stop", "POST")
    eventually(lambda: driver.newest["state"] == "STOPPED")
    driver.fields = {"engage": False}
    time.sleep(0.2)
    driver.fields = {"engage": True}
    eventually(lambda: driver.newest["state"] == "ENGAGED")


@pytest.mark.row(11)
def test_a_second_operator_watches_until_it_takes_over_and_the_robot_holds_between(driver: Driver, site: Site) -> None:
    second = Driver(site, engage=True)
    try:
        eventually(lambda: second.newest["seq"] > 3)
        assert not second.newest["driving"]
        second.fields = {"take": True, "engage": True}
        eventually(lambda: second.newest["driving"])
        eventually(lambda: second.newest["state"] == "HOLD")
        second.fields = {"engage": False}
        eventually(lambda: second.newest["seq"] > 3)
        driver.fields = {}
        time.sleep(0.2)
        second.fields = {"engage": True}
        eventually(lambda: second.newest["state"] == "ENGAGED")
        assert not driver.newest["driving"]
    finally:
        second.close()


@pytest.mark.row(11)
def test_two_drive_a_role_each_and_a_third_watches(site: Site) -> None:
    arms, legs = (
        Driver(site, name="Ada", roles=["arms"], engage=True),
        Driver(site, name="Bo", roles=["legs"], engage=True, twist={"vx": 0.5}),
    )
    try:
        with site.operator() as watcher:
            eventually(lambda: {part["state"] for part in site.health()["roles"].values()} == {"ENGAGED"})
            health = json.loads(watcher.recv(timeout=10))
        assert {role: part["driver"] for role, part in health["roles"].items()} == {"arms": "Ada", "legs": "Bo"}
        assert [(member["name"], member["drives"]) for member in health["crew"][:2]] == [("Ada", ["arms"]), ("Bo", ["legs"])]
        assert (health["driver"], health["drives"], health["clients"]) == ("Ada and Bo", [], 3)
        legs.fall_silent()
        eventually(lambda: site.health()["command"]["vx"] == 0)
        eventually(lambda: arms.newest["state"] == "HOLD" and arms.newest["roles"]["arms"]["state"] == "ENGAGED")
    finally:
        arms.close()
        legs.close()


def test_who_asks_for_a_role_is_shown_to_its_driver_and_given_it(driver: Driver, site: Site) -> None:
    second = Driver(site, roles=["legs"], ask=True, engage=False)
    try:
        eventually(lambda: any(member["asks"] == ["legs"] for member in driver.newest["crew"]))
        (asks,) = (member for member in driver.newest["crew"] if member["asks"])
        driver.fields |= {"give": asks["id"]}
        eventually(lambda: second.newest["drives"] == ["legs"] and driver.newest["drives"] == ["arms"])
        eventually(lambda: second.newest["roles"]["legs"]["state"] == "HOLD")
    finally:
        second.close()


def test_while_the_robot_follows_somebody_only_they_reset_it(driver: Driver, site: Site) -> None:
    with pytest.raises(urllib.error.HTTPError, match="409") as refused:
        site.ask("/api/reset", "POST")
    assert "stop it first" in json.load(refused.value)["detail"]
    site.ask(f"/api/reset?client={driver.newest['id']}", "POST")
    eventually(lambda: driver.newest["state"] == "STOPPED")
    site.ask("/api/reset", "POST")


@pytest.mark.parametrize(
    "message",
    ['{"seq":1,"height":NaN}', '{"seq":1,"twist":{"vx":1e999}}', '{"seq":1,"enagge":true}', '{"seq":"1"}', '{"seq":1,"engage":"yes"}'],
)
def test_a_wrong_field_is_refused_counted_and_told(site: Site, message: str) -> None:
    before = site.health()["rejected"]
    with site.operator() as client:
        client.send(message)
        eventually(lambda: json.loads(client.recv(timeout=10))["error"])
    assert site.health()["rejected"] == before + 1


@pytest.mark.row(15)
@pytest.mark.parametrize(
    ("packets", "code"),
    [(["{"], 1007), (["[1]"], 1007), ([b"\x00\x01"], 1003), ([" " * 70_000], 1009), (['{"seq":1}'] * 400, 1008)],
    ids=["half a message", "no object", "binary", "oversized", "flood"],
)
def test_what_is_no_message_closes_the_socket(site: Site, packets: list, code: int) -> None:
    def talk(client: ClientConnection) -> None:
        for packet in packets:
            client.send(packet)
        while True:
            client.recv(timeout=10)

    with site.operator() as client, pytest.raises(ConnectionClosed) as closed:
        talk(client)
    assert closed.value.rcvd.code == code
    assert site.health()["state"] == "STOPPED"


def test_other_sites_and_other_names_reach_nothing(site: Site) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        site.operator(Origin="http://evil.example")
    for path in ("/api/health", "/docs", "/openapi.json"):
        with pytest.raises(urllib.error.HTTPError, match="403"):
            site.ask(path, Host="evil.example")
    with pytest.raises(urllib.error.HTTPError, match="403"):
        site.ask("/api/stop", "POST", Origin="http://evil.example")


@pytest.mark.row(21)
def test_nothing_changes_by_get(site: Site) -> None:
    for path in ("/api/stop", "/api/reset"):
        with pytest.raises(urllib.error.HTTPError, match="405"):
            site.ask(path)


def test_the_wire_is_described(site: Site) -> None:
    schemas = json.loads(site.ask("/openapi.json"))["components"]["schemas"]
    assert {"OperatorMessage", "Answer", "Health"} <= set(schemas)
    assert "swagger" in site.ask("/docs")


def test_a_reset_that_fails_says_why(site: Site) -> None:
    site.broken = True
    try:
        with pytest.raises(urllib.error.HTTPError, match="503") as answered:
            site.ask("/api/reset", "POST")
        assert json.load(answered.value) == {"detail": "the robot is broken"}
    finally:
        site.broken = False


def test_a_dead_simulation_is_shown_as_a_fault_and_reset_starts_it_again(site: Site) -> None:

    os.kill(site.simulation.pid or 0, signal.SIGKILL)
    eventually(lambda: site.health()["state"] == "FAULT", 1.5)
    assert "gone or hangs" in site.health()["reason"]
    site.ask("/api/reset", "POST")
    assert site.health()["state"] == "STOPPED"
