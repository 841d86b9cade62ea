"""Other sites, other names, people without the token: on every route that the program has, as its own router lists them."""

from __future__ import annotations

import http.client
import os
import shutil
import socket
import ssl
import subprocess
import threading
import urllib.error
import urllib.request
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
import requests
import schemathesis
import uvicorn
from fastapi import FastAPI
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from program import Program
from stand_ins import Hanging, eventually
from starlette.routing import BaseRoute, Mount, WebSocketRoute
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from app import session as sessions
from app.config import Serve
from app.gate import COOKIE, PAGES
from app.log import configure
from app.session import Session
from app.token import BadToken, keep

TOKEN = "T0ken-for-tests_" * 3
EVIL = "evil.example"


class Site:
    """The whole app of a session on a port."""

    def __init__(self, app: FastAPI) -> None:
        self.app = app
        self._server = uvicorn.Server(uvicorn.Config(app, log_config=None, timeout_graceful_shutdown=1))
        self._door = socket.create_server(("127.0.0.1", 0))
        self.port = self._door.getsockname()[1]
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [self._door]})
        self._thread.start()
        eventually(lambda: self._server.started)
        self.routes = sorted(set(_routes(app.routes)))
        """(method, path) of every route; the method of a socket is WS."""

    def status(self, method: str, path: str, **headers: str) -> int:
        """What a request is answered with; 101 for an open socket."""
        if method == "WS":
            return self._socket_status(path, headers)
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        answer.read()
        connection.close()
        return answer.status

    def _socket_status(self, path: str, headers: dict[str, str]) -> int:
        origin, host = headers.pop("Origin", None), headers.pop("Host", f"127.0.0.1:{self.port}")
        try:
            sock = socket.create_connection(("127.0.0.1", self.port))
            with connect(f"ws://{host}{path}", sock=sock, origin=origin, additional_headers=headers, compression=None):
                return 101
        except InvalidStatus as error:
            return error.response.status_code

    def close(self) -> None:
        self._server.should_exit = True
        self._thread.join()
        self._door.close()


def _routes(routes: list[BaseRoute], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Every (method, path) below, placeholders filled in."""
    for route in routes:
        if hasattr(route, "effective_candidates"):  # a router, as FastAPI includes it
            yield from _routes([getattr(r, "starlette_route", None) or r for r in route.effective_candidates()], prefix)
            continue
        path = prefix + getattr(route, "path", "").replace("{id}", "x").replace("{name}", "main.js").replace("{role}", "arms")
        if isinstance(route, Mount):
            yield "GET", f"{path}/swagger-ui.css"
        elif isinstance(route, WebSocketRoute) or not getattr(route, "methods", None):
            yield "WS", path
        else:
            yield from ((method, path) for method in route.methods or () if method != "HEAD")


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Session]:
    """The program in this process, with a robot that hangs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sessions, "Factory", lambda *_: Hanging())
        running = Session(Serve(recordings=tmp_path_factory.mktemp("recordings")))
    yield running
    running.close()


@pytest.fixture(scope="module")
def site(session: Session) -> Iterator[Site]:
    running = Site(session.app())
    yield running
    running.close()


@pytest.fixture(scope="module")
def locked(session: Session) -> Iterator[Site]:
    """The same with a token."""
    session._token = TOKEN
    running = Site(session.app())
    session._token = None
    yield running
    running.close()


def test_the_list_of_routes_is_whole(site: Site) -> None:
    known = {("WS", "/"), ("WS", "/api/operator"), ("WS", "/api/scene"), ("POST", "/api/stop"), ("GET", "/"), ("GET", "/web/main.js")}
    assert known <= set(site.routes)
    paths = set(site.app.openapi()["paths"])
    assert len({path for _, path in site.routes}) >= len(paths)
    assert site.status("WS", "/api/operator") == 101
    assert site.status("GET", "/api/health") == 200


@pytest.mark.row(18)
@pytest.mark.parametrize("origin", [f"http://{EVIL}", "null", "http://127.0.0.1:1", "https://127.0.0.1.evil.example"])
def test_another_site_is_refused_on_every_route(site: Site, origin: str, measured) -> None:
    for method, path in site.routes:
        assert site.status(method, path, Origin=origin) == 403, (method, path)
    measured(18, f"Origin {origin}: 403 on {len(site.routes)} of {len(site.routes)} routes")


@pytest.mark.row(19)
@pytest.mark.parametrize("host", [EVIL, "127.0.0.1.evil.example", "localhost.evil.example:80", "0.0.0.0"])
def test_another_name_is_refused_on_every_route(site: Site, host: str, measured) -> None:
    for method, path in site.routes:
        assert site.status(method, path, Host=host) == 403, (method, path)
    measured(19, f"Host {host}: 403 on {len(site.routes)} of {len(site.routes)} routes")


@pytest.mark.row(20)
def test_without_the_token_every_route_is_401(locked: Site, measured) -> None:
    wrong = [{}, *({"Cookie": text} for text in (f"{COOKIE}={TOKEN}x", f"other={TOKEN}", "=;x"))]
    wrong += [{"Authorization": text} for text in ("Bearer nothing", TOKEN, "Bearer")]
    for method, path in locked.routes:
        for headers in wrong:
            assert locked.status(method, path, **headers) == 401, (method, path, headers)
        assert locked.status(method, f"{path}?token={TOKEN}") == (200 if method == "GET" and path in PAGES else 401), (method, path)
    for headers in ({"Cookie": f'a=b; odd[0]="x; {COOKIE}={TOKEN}'}, {"Authorization": f"Bearer {TOKEN}"}):
        assert locked.status("GET", "/api/health", **headers) == 200
        assert locked.status("WS", "/api/operator", **headers) == 101
        assert locked.status("WS", "/api/operator", Origin=f"http://{EVIL}", **headers) == 403
    assert locked.status("GET", "/?token=wrong") == 401
    measured(20, f"without the token: 401 on {len(locked.routes)} of {len(locked.routes)} routes, with the token in their query too")


@pytest.mark.row(20)
@pytest.mark.parametrize("path", PAGES)
def test_the_token_comes_once_in_the_address_and_then_in_a_strict_cookie(locked: Site, path: str) -> None:
    with urllib.request.urlopen(f"http://127.0.0.1:{locked.port}{path}?token={TOKEN}&role=arms", timeout=20) as answer:
        text, headers = answer.read().decode(), answer.headers
    assert TOKEN not in text
    assert f"url={path}?role=arms" in text
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["Cache-Control"] == "no-store"
    cookie = headers["Set-Cookie"].lower()
    assert all(word in cookie for word in ("httponly", "samesite=strict", "path=/"))
    assert "domain" not in cookie


@pytest.mark.row(20)
def test_it_starts_beyond_loopback_with_a_token_only_and_never_tells_it(tmp_path: Path, measured) -> None:
    secret, pem = tmp_path / "secrets" / "token", _certificate(tmp_path)
    program = Program(tmp_path / "recordings", "--host", "0.0.0.0", "--token", os.fspath(secret), "--log", "json", *pem)
    try:
        token = secret.read_text().strip()
        assert len(token) == 32
        assert secret.stat().st_mode & 0o777 == 0o600
        assert program.url.startswith("https" if pem else "http")
        trusting = ssl._create_unverified_context() if pem else None
        with pytest.raises(urllib.error.HTTPError, match="401") as refused:
            urllib.request.urlopen(f"{program.url}/api/health?token={token}", timeout=20, context=trusting)
        refused.value.close()
        request = urllib.request.Request(f"{program.url}/api/health", headers={"Authorization": f"Bearer {token}"})
        with urllib.request.urlopen(request, timeout=20, context=trusting) as answer:
            assert answer.status == 200
        eventually(lambda: '"status": 401' in program.said)
        assert token not in program.greeting + program.said
        assert token not in Path(f"/proc/{program.pid}/cmdline").read_text()
    finally:
        program.close()
    measured(20, f"0.0.0.0 with a token of 192 bits{' over TLS' if pem else ''}: 401 without, 200 with; in no log and no command line")


def _certificate(folder: Path) -> list[str]:
    """Options for a certificate of our own; none where openssl is not installed."""
    if not shutil.which("openssl"):
        return []
    names = [os.fspath(folder / name) for name in ("cert.pem", "key.pem")]
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1", "-subj", "/CN=test"]
    subprocess.run([*command, "-out", names[0], "-keyout", names[1]], check=True, capture_output=True)
    return ["--certificate", names[0], "--key", names[1]]


@pytest.mark.row(20)
def test_a_token_file_that_others_read_or_that_is_short_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "token"
    assert keep(path) == keep(path)
    path.chmod(0o644)
    with pytest.raises(BadToken, match="chmod 600"):
        keep(path)
    path.write_text("short")
    path.chmod(0o600)
    with pytest.raises(BadToken, match="at least 32"):
        keep(path)
    with pytest.raises(BadToken, match="cannot be used"):
        keep(path / "below")


@pytest.mark.row(21)
def test_no_get_changes_anything(site: Site, session: Session, measured) -> None:
    commands, folder = session.simulation.exchange.commands, session.episodes.library.directory
    before = (commands.count, sorted(folder.rglob("*")), session.health().recording, session.operators.rejected)
    gets = [path for method, path in site.routes if method == "GET"]
    for path in gets:
        assert site.status("GET", path) < 500
        assert site.status("HEAD", path) < 500
    changing = sorted({path for method, path in site.routes if method in ("POST", "DELETE", "PUT", "PATCH")} - {"/api/episodes"})
    for path in changing:
        assert site.status("GET", path) in (404, 405)
    assert (commands.count, sorted(folder.rglob("*")), session.health().recording, session.operators.rejected) == before
    measured(21, f"{len(gets)} GET routes changed nothing; {len(changing)} routes that change something answer 405 to GET")


TRICKS = ["..", "../../etc/passwd", "..%2f..%2fetc%2fpasswd", "%2e%2e/", "....//", "/etc/passwd", "C:\\x", "~root", "a\\..\\b", "x%00"]
NAMES = st.one_of(st.sampled_from(TRICKS), st.text(st.characters(codec="utf-8"), min_size=1, max_size=80))
PLACES = ["/web/{}", "/api/episodes/{}/download", "/api/episodes/{}/frames", "/static-offline-docs/{}", "/{}"]


@pytest.mark.row(22)
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(name=NAMES, place=st.sampled_from(PLACES))
def test_no_name_reaches_a_file_outside(site: Site, name: str, place: str) -> None:
    path = place.format(name if "%" in name and name.isascii() else urllib.request.quote(name, safe="./"))
    assert site.status("GET", path) in (200, 307, 400, 404, 405, 422)
    connection = http.client.HTTPConnection("127.0.0.1", site.port, timeout=20)
    connection.request("GET", path)
    assert b"root:" not in connection.getresponse().read()
    connection.close()


@pytest.mark.row(22)
@pytest.mark.parametrize("examples", [100, pytest.param(1500, marks=pytest.mark.slow)])
def test_no_request_makes_the_server_fail(site: Site, examples: int, measured) -> None:
    schema, codes = schemathesis.openapi.from_url(f"http://127.0.0.1:{site.port}/openapi.json"), Counter()

    @settings(max_examples=examples, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(case=schema.as_strategy())
    def ask(case: schemathesis.Case) -> None:
        with requests.Session() as client:
            code = case.call(session=client).status_code
        codes[code] += 1
        assert code < 500

    ask()
    told = ", ".join(f"{code}: {times}" for code, times in sorted(codes.items()))
    measured(22, f"schemathesis, {sum(codes.values())} requests made from the OpenAPI: {told}; none above 499")


def test_logs_as_json_hold_events_and_no_query(locked: Site, capfd: pytest.CaptureFixture[str]) -> None:
    configure("json")
    try:
        assert locked.status("GET", f"/api/health?token={TOKEN}") == 401
    finally:
        configure("text")
    told = capfd.readouterr().err
    assert '"event": "refused"' in told
    assert '"path": "/api/health"' in told
    assert TOKEN not in told
