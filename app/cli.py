"""The command `teleop`."""

from __future__ import annotations

import errno
import ipaddress
import signal
import socket
import sys
from collections.abc import Sequence
from pathlib import Path

import tyro
import uvicorn

from app import recordings
from app.config import Serve
from app.errors import AppError, CannotListen, NoTokenYet, PortTaken
from policies.errors import PolicyError
from robots.errors import RobotError

DESCRIPTION = """Drive a walking humanoid from a browser tab.

examples:
  teleop                               serve the page on http://127.0.0.1:8080
  teleop --port 9000 --policy my.safetensors
  teleop episodes                      list what was recorded
  teleop replay recordings/FILE.mcap   simulate it again and compare, bit for bit
  teleop recover recordings            mend what a crash left behind
"""
LARGEST_FRAME = 1024 * 1024
"""Bytes of one WebSocket message, on any route."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line. Returns the exit code; an error that a person can mend is one sentence."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as cleanly as Ctrl-C
    try:
        chosen = _parse(list(sys.argv[1:] if arguments is None else arguments))
        return serve(chosen) if isinstance(chosen, Serve) else chosen
    except (AppError, RobotError, PolicyError) as error:
        print(f"teleop: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 0


def serve(config: Serve) -> int:
    """Serve until Ctrl-C.

    Raises:
        AppError, RobotError, PolicyError: it cannot start; the message says why.
    """
    from app.session import Session  # the other commands do without a simulator and a web server

    with listen(config.host, config.port) as door:
        session = Session(config)
        try:
            for line in session.missing():
                print(line, file=sys.stderr)
            print(f"{config.robot} stands. Open http://{_in_url(config.host)}:{door.getsockname()[1]} - Ctrl-C ends.", flush=True)
            options = uvicorn.Config(
                session.app(),
                log_level="warning",
                ws_max_size=LARGEST_FRAME,
                ws_per_message_deflate=False,
                timeout_graceful_shutdown=2,
            )
            uvicorn.Server(options).run(sockets=[door])
        finally:
            session.close()
    return 0


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens there.

    Raises:
        NoTokenYet: other machines could reach it.
        PortTaken: another program has it.
        CannotListen: there is no such address here, or this user may not use it.
    """
    if not _is_loopback(host):
        raise NoTokenYet(host)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    door = socket.socket(family, socket.SOCK_STREAM)
    door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        door.bind((host, port))
        door.listen(128)
    except (OSError, OverflowError) as error:
        door.close()
        taken = isinstance(error, OSError) and error.errno == errno.EADDRINUSE
        raise PortTaken(host, port) if taken else CannotListen(host, port, str(error)) from error
    return door


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _in_url(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _parse(arguments: list[str]) -> Serve | int:
    """A configuration to serve, or the exit code of another command that ran."""
    commands = {"serve": Serve, "episodes": _episodes, "replay": _replay, "recover": _recover}
    first = arguments[0] if arguments else ""
    if first not in (*commands, "-h", "--help"):
        arguments = ["serve", *arguments]
    return tyro.extras.subcommand_cli_from_dict(commands, prog="teleop", description=DESCRIPTION, args=arguments)


def _episodes(directory: tyro.conf.Positional[Path] = Serve.recordings) -> int:
    """List the recorded episodes of a folder."""
    return recordings.episodes(directory)


def _replay(file: tyro.conf.Positional[Path], episode: int | None = None) -> int:
    """Simulate recorded episodes again and compare them with the recording, bit for bit.

    Args:
        file: a recording.
        episode: the number of one episode; all of them otherwise.
    """
    return recordings.replay(file, episode)


def _recover(path: tyro.conf.Positional[Path]) -> int:
    """Mend a recording that a crash or a full disk left behind.

    Args:
        path: a file, or a folder of them.
    """
    return recordings.recover(path)
