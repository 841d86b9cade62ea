"""The address that the program listens on, and how people reach it."""

from __future__ import annotations

import errno
import ipaddress
import socket
import ssl

from app.config import Serve
from app.errors import BadCertificate, CannotListen, NeedsToken, PortTaken
from app.traffic import BLOCKED

UNSENT = 64 * 1024
"""Bytes that the kernel keeps for a client that does not read: few, so that what it reads at last is not old."""


def listen(config: Serve) -> socket.socket:
    """A socket that listens where the configuration says.

    Raises:
        NeedsToken: other machines could reach it and nobody asks for a token.
        BadCertificate: the TLS files do not work.
        PortTaken: another program has the port.
        CannotListen: there is no such address here, or this user may not use it.
    """
    host, port = config.host, config.port
    if config.token is None and not _is_loopback(host):
        raise NeedsToken(host)
    _check_certificate(config)
    door = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM)
    door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    door.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, UNSENT)  # this and the next one pass to every connection
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # Linux: the kernel cuts off who takes in nothing, whatever is still on its way
        door.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, int(BLOCKED * 1e3))
    try:
        door.bind((host, port))
        door.listen(128)
    except (OSError, OverflowError) as error:
        door.close()
        taken = isinstance(error, OSError) and error.errno == errno.EADDRINUSE
        raise PortTaken(host, port) if taken else CannotListen(host, port, str(error)) from error
    return door


def url(config: Serve, door: socket.socket) -> str:
    """What people open, without the token."""
    host = own_address() if config.host in ("0.0.0.0", "::") else config.host
    scheme = "https" if config.certificate else "http"
    return f"{scheme}://{f'[{host}]' if ':' in host else host}:{door.getsockname()[1]}"


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def own_address() -> str:
    """The address under which this machine talks to others; connecting a datagram socket sends nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
            return probe.getsockname()[0]
        except OSError:
            return "127.0.0.1"


def _check_certificate(config: Serve) -> None:
    if config.certificate is None and config.key is None:
        return
    if config.certificate is None:
        raise BadCertificate("there is a key but no certificate")
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(config.certificate, config.key)
    except (OSError, ssl.SSLError) as error:
        raise BadCertificate(str(error)) from error
