"""The page's server side over real sockets, with a toy robot: viser's page and relay, the scene, the live picture."""

from __future__ import annotations

import gzip
import json
import os
import re
import socket
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import msgspec.msgpack
import mujoco
import numpy as np
import pytest
import uvicorn
import viser
import zstandard
from fastapi import FastAPI
from stand_ins import eventually
from viser import _messages
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from app import relay, viewer
from app.gate import Gate
from app.outputs import live
from app.page import Page
from policies.envelope import POSTURE, TWIST
from robots import catalog

MODEL = """
<mujoco>
  <worldbody>
    <body name="pelvis"><freejoint/><geom type="box" size=".1 .1 .1"/>
      <body name="left" pos="0 .3 0"><joint axis="0 1 0"/><geom size=".1"/><site name="left_wrist"/></body>
      <body name="right" pos="0 -.3 0"><joint axis="0 1 0"/><geom size=".1"/><site name="right_wrist"/></body>
      <body name="head" pos="0 0 .5"><camera name="head" fovy="70" xyaxes="0 -1 0 0 0 1"/></body>
    </body>
  </worldbody>
  <keyframe><key name="home" qpos="0 0 1 1 0 0 0 0 0"/></keyframe>
</mujoco>
"""
NQ = 9
SNAPSHOT = np.dtype([("tick", "<u8"), ("stamp", "<i8"), ("qpos", "<f8", (NQ,))])
VISER = Subprotocol(f"viser-v{viser.__version__}")


class Site:
    """A served page whose robot takes the poses that a test gives it."""

    def __init__(self) -> None:
        self.stamp = 0
        spec = replace(catalog.load("h1").spec, wrists=("left_wrist", "right_wrist"))
        self.page = Page(spec, mujoco.MjModel.from_xml_string(MODEL), self.newest)
        self.viser = self.page._viser
        app = FastAPI()
        app.add_middleware(Gate, host="127.0.0.1")
        for router in self.page.routers:
            app.include_router(router)
        self._server = uvicorn.Server(uvicorn.Config(app, log_level="critical", ws_per_message_deflate=False, timeout_graceful_shutdown=1))
        self._door = socket.create_server(("127.0.0.1", 0))
        self.port = self._door.getsockname()[1]
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [self._door]})
        self._thread.start()
        eventually(lambda: self._server.started)

    def newest(self) -> np.void:
        snapshot = np.zeros((), SNAPSHOT)
        snapshot["tick"], snapshot["stamp"], snapshot["qpos"] = self.stamp, self.stamp, self.stamp
        return snapshot[()]

    def close(self) -> None:
        self._server.should_exit = True
        self._thread.join()
        self._door.close()
        self.page.close()

    def get(self, path: str, **headers: str) -> tuple[bytes, dict[str, str]]:
        request = urllib.request.Request(f"http://127.0.0.1:{self.port}{path}", headers=headers)
        with urllib.request.urlopen(request, timeout=10) as answer:
            return answer.read(), {name.lower(): value for name, value in answer.headers.items()}

    def socket(self, path: str, **options) -> ClientConnection:
        return connect(f"ws://127.0.0.1:{self.port}{path}", compression=None, max_size=None, **options)


@pytest.fixture(scope="module")
def site() -> Iterator[Site]:
    running = Site()
    yield running
    running.close()


def test_the_page_is_visers_own_with_our_scripts_before_its_body(site):
    plain, headers = site.get("/")
    head, body = plain.decode().split("</head>")
    assert 'src="/web/tap.js"' in head
    assert 'src="/web/main.js"' in head
    assert '<div id="root">' in body
    assert headers["x-frame-options"] == "DENY"
    packed, headers = site.get("/", **{"Accept-Encoding": "gzip"})
    assert headers["content-encoding"] == "gzip"
    assert gzip.decompress(packed) == plain


def test_every_file_that_the_page_asks_for_is_served_with_its_type(site):
    asked, seen = {"tap.js", "main.js", "page.css", "overlay.css", "headset.html"}, set()
    while asked:
        name = asked.pop()
        seen.add(name)
        text, headers = site.get(f"/web/{name}")
        assert headers["content-type"].startswith(relay.KINDS[f".{name.split('.')[1]}"])
        asked |= set(re.findall(r'(?:from "\./|"/web/)([\w.]+)"', text.decode())) - seen
    assert seen == set(relay.web_files())


@pytest.mark.parametrize("path", ["/web/none.js", "/web/..%2fpyproject.toml", "/web/%2e%2e/app/page.py", "/web/"])
def test_nothing_else_is_served(site, path):
    with pytest.raises(urllib.error.HTTPError, match="404"):
        site.get(path)


def test_a_client_without_a_head_is_refused_with_a_sentence():
    with pytest.raises(relay.BrokenPage, match=r"no </head>.*reinstall viser"):
        relay.with_overlay("<html><body></body></html>")


def test_another_viser_is_refused_with_a_sentence(monkeypatch):
    monkeypatch.setattr(viser, "__version__", "9.9.9")
    with pytest.raises(viewer.UnknownViewer, match=r"needs viser 1\.1\.1.*9\.9\.9 is installed"):
        viewer.start()


def test_the_relay_brings_the_scene(site):
    with site.socket("/", subprotocols=[VISER]) as page:
        assert page.subprotocol == VISER
        received = b""
        while b"ReplayDone" not in received and b"/robot/pelvis" not in received:
            received += _unpacked(page.recv(timeout=10))


def _unpacked(message: bytes | str) -> bytes:
    """viser's messages without their compression."""
    assert isinstance(message, bytes)
    packed = int.from_bytes(message[8:16], "little")
    return zstandard.ZstdDecompressor().decompress(message[16 : 16 + packed])


CAMERA = _messages.ViewerCameraMessage((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0, 0.1, 10.0, 10, 10, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def _bytes(message: _messages.Message) -> bytes:
    return msgspec.msgpack.encode(message.as_serializable_dict([]))


def test_nothing_that_a_page_sends_reaches_viser(site):
    heard = []
    hear = lambda client, message: heard.append(message)  # noqa: E731
    site.viser._websock_server.register_handler(_messages.ViewerCameraMessage, hear)
    try:
        with connect(f"ws://127.0.0.1:{site.viser.get_port()}", subprotocols=[VISER], max_size=None) as direct:
            direct.send(_bytes(CAMERA))
            eventually(lambda: len(heard) == 1)  # so would be heard what came through
        with site.socket("/", subprotocols=[VISER]) as page:
            page.recv(timeout=10)
            page.send(_bytes(CAMERA))
            page.send(b"\xff not msgpack")
            page.send("text")
            time.sleep(0.3)
            page.ping().wait(5)
        assert len(heard) == 1
    finally:
        site.viser._websock_server.unregister_handler(_messages.ViewerCameraMessage, hear)


def test_nobody_opens_a_tunnel(site):
    with connect(f"ws://127.0.0.1:{site.viser.get_port()}", subprotocols=[VISER], max_size=None) as direct:
        direct.send(_bytes(_messages.ShareUrlRequest()))
        direct.send(_bytes(CAMERA))
        eventually(lambda: len(site.viser.get_clients()) == 1)  # both are handled in order
    assert site.viser._share_tunnel is None
    assert not {_messages.ShareUrlRequest, _messages.ShareUrlDisconnect} & set(site.viser._websock_server._incoming_handlers)


def test_viser_itself_refuses_every_web_page(site):
    for origin in ("http://evil.example", f"http://127.0.0.1:{site.port}"):
        with pytest.raises(InvalidStatus, match="403"):
            connect(f"ws://127.0.0.1:{site.viser.get_port()}", subprotocols=[VISER], origin=origin)


@pytest.mark.parametrize("path", ["/", "/api/scene"])
def test_another_sites_page_gets_no_socket(site, path):
    with pytest.raises(InvalidStatus, match="403"):
        site.socket(path, origin="http://evil.example")


def test_a_page_that_takes_nothing_in_is_closed(site, monkeypatch):
    monkeypatch.setattr(relay, "BLOCKED", 0.3)
    monkeypatch.setattr(relay, "SLOWEST", 1e12)
    big = site.viser.scene.add_point_cloud("/big", np.zeros((1_000_000, 3), np.float32), np.zeros((1_000_000, 3), np.uint8))
    connections = site.viser._websock_server._live_connections
    eventually(lambda: not connections)
    with _stalled_page(site.port):
        eventually(lambda: len(connections) == 1)
        time.sleep(0.5)
        site.viser.scene.add_frame("/news")  # which the page cannot take in
        eventually(lambda: not connections, seconds=3)
    big.remove()
    with site.socket("/", subprotocols=[VISER]) as another:
        another.recv(timeout=10)


def _stalled_page(port: int) -> socket.socket:
    """A page that connects to viser's socket and never reads."""
    page = socket.create_connection(("127.0.0.1", port))
    page.sendall(
        f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: {VISER}\r\n\r\n".encode()
    )
    return page


def test_a_page_gets_one_pose_for_each_request_and_always_the_newest(site):
    with site.socket("/api/scene") as page:
        site.stamp += 1
        page.send("next")
        assert _pose(page) == [site.stamp] * NQ
        with pytest.raises(TimeoutError):
            page.recv(timeout=0.2)  # nothing comes unasked
        site.stamp += 100
        time.sleep(0.05)
        page.send("next")
        assert _pose(page) == [site.stamp] * NQ
        page.send("next")
        with pytest.raises(TimeoutError):
            page.recv(timeout=0.2)  # no newer one
        site.stamp += 1
        assert _pose(page) == [site.stamp] * NQ


def test_a_request_that_is_no_text_closes_the_socket(site):
    with site.socket("/api/scene") as page:
        page.send(b"next")
        with pytest.raises(ConnectionClosed, match="1003"):
            page.recv(timeout=5)


def test_a_page_that_leaves_while_no_news_comes_is_noticed(site, monkeypatch):
    monkeypatch.setattr(live, "CLIENTS", 1)
    with site.socket("/api/scene") as page:
        for _ in range(2):  # the second one waits
            page.send("next")
        page.recv(timeout=5)
    eventually(lambda: _is_shown(site))


def _is_shown(site: Site, path: str = "/api/scene") -> bool:
    """Whether a page is let in."""
    with site.socket(path, subprotocols=[VISER]) as page, suppress(ConnectionClosed):
        page.send("next")
        page.recv(timeout=5)
        return True
    return False


def _pose(page: ClientConnection) -> list[float]:
    message = page.recv(timeout=5)
    assert isinstance(message, bytes)
    tick, age = int(np.frombuffer(message, "<u4", 1)[0]), float(np.frombuffer(message, "<f4", 1, 4)[0])
    pose = np.frombuffer(message, "<f4", offset=8).tolist()
    assert (tick, age > 0) == (pose[0], True)
    return pose


@pytest.mark.parametrize("path", ["/api/scene", "/"])
def test_pages_beyond_the_limit_are_told_so(site, monkeypatch, path):
    for module in (live, relay):
        monkeypatch.setattr(module, "CLIENTS", 1)
    with site.socket(path, subprotocols=[VISER]) as first:
        first.send("next")
        first.recv(timeout=5)
        with site.socket(path, subprotocols=[VISER]) as second, pytest.raises(ConnectionClosed, match="1 pages are open already"):
            second.recv(timeout=5)

    eventually(lambda: _is_shown(site, path))


def test_the_description_names_every_body_and_the_eye(site):
    described = json.loads(site.get("/api/scene")[0])
    assert [body["name"] for body in described["bodies"]] == ["pelvis", "left", "right", "head"]
    assert [body["parent"] for body in described["bodies"]] == [-1, 0, 0, 0]
    assert described["bodies"][0]["node"] == "/robot/pelvis"
    assert described["bodies"][3]["node"] is None  # nothing of it is drawn
    np.testing.assert_allclose([described["eye"][name] for name in ("forward", "up")], [[1, 0, 0], [0, 0, 1]], atol=1e-12)
    assert described["nq"] == NQ
    assert described["trained"] == {name: [TWIST[0][i], TWIST[1][i]] for i, name in enumerate(("vx", "vy", "yaw_rate"))} | {
        name: [POSTURE[0][i], POSTURE[1][i]] for i, name in enumerate(("height", "roll", "pitch"))
    }


def test_the_installation_without_web_files_is_refused(monkeypatch, tmp_path):
    monkeypatch.setattr(relay, "__file__", os.fspath(tmp_path / "app" / "relay.py"))
    with pytest.raises(relay.BrokenPage, match="reinstall"):
        relay.web_files()
