"""The certificate of one's own."""

from __future__ import annotations

import shutil
import socket
import ssl
from pathlib import Path

import pytest
from starlette.datastructures import Headers

from app import certificate
from app.config import Serve
from app.errors import BadCertificate
from app.gate import Gate


async def nothing(*_: object) -> None:
    raise AssertionError("not called")


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl: apt-get install openssl")
def test_it_is_made_once_for_all_names_and_works() -> None:
    config = Serve(self_signed=True, names=("lab-pc.local",))
    first, second = (certificate.provided(config, "192.168.7.9") for _ in range(2))
    assert (first.certificate, first.key) == (second.certificate, second.key)
    assert first.certificate
    assert first.key
    assert first.key.stat().st_mode & 0o077 == 0
    context = ssl.create_default_context(cafile=first.certificate)
    (stated,) = context.get_ca_certs()
    assert {("DNS", "lab-pc.local"), ("DNS", "localhost"), ("IP Address", "192.168.7.9")} <= set(stated["subjectAltName"])  # pyright: ignore
    ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(first.certificate, first.key)
    assert certificate.provided(config, "10.0.0.1").certificate != first.certificate, "another address needs another one"


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl: apt-get install openssl")
def test_its_names_get_in() -> None:
    config = certificate.provided(Serve(self_signed=True, names=("Lab-PC.local",)), "192.168.7.9")
    gate = Gate(nothing, config.host, config.names)
    for name in ("lab-pc.local", socket.gethostname(), f"{socket.gethostname()}.local", "192.168.7.9"):
        assert gate.allows(Headers({"host": f"{name}:8080"}))


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl: apt-get install openssl")
def test_one_that_ends_soon_is_made_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    config, made = Serve(self_signed=True), []
    for spare in (certificate.SPARE, certificate.SPARE, (certificate.DAYS + 1) * 86400):
        monkeypatch.setattr(certificate, "SPARE", spare)
        path = certificate.provided(config, "192.168.7.9").certificate
        assert path
        made.append(path.read_bytes())
    assert made[0] == made[1] != made[2]


def test_without_the_flag_nothing_is_made(tmp_path: Path) -> None:
    assert certificate.provided(Serve(), "10.0.0.1") == Serve()
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_is_said_in_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BadCertificate, match="names another"):
        certificate.provided(Serve(self_signed=True, certificate=Path("x.pem")), "10.0.0.1")
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(BadCertificate, match="apt-get install openssl"):
        certificate.provided(Serve(self_signed=True), "10.0.0.1")
