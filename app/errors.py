"""Errors of this folder, each one sentence that names the way out."""

from __future__ import annotations


class AppError(Exception):
    """Something that the person who started the program can mend."""


class SimulationFailed(AppError):
    """The simulation process could not start."""


class PortTaken(AppError):
    """Another program listens on the address."""

    def __init__(self, host: str, port: int) -> None:
        super().__init__(f"port {port} on {host} is taken by another program; stop it or choose another one with --port")


class NeedsToken(AppError):
    """An address that other machines can reach, open to everybody."""

    def __init__(self, host: str) -> None:
        super().__init__(
            f"{host} can be reached from other machines; say who may drive with --token FILE, or use --host 127.0.0.1 and an SSH tunnel"
        )


class BadCertificate(AppError):
    """TLS files that do not work."""

    def __init__(self, why: str) -> None:
        super().__init__(f"the certificate cannot be used ({why}); give a PEM file with --certificate and its key with --key")


class CannotListen(AppError):
    """The address cannot be used."""

    def __init__(self, host: str, port: int, why: str) -> None:
        super().__init__(f"cannot listen on {host}:{port}: {why}; choose another one with --host and --port")


class OddSpeed(AppError):
    """A playback speed that makes no motion."""

    def __init__(self, speed: float, slowest: float, fastest: float) -> None:
        super().__init__(f"a motion cannot be played at speed {speed:g}; give one from {slowest:g} to {fastest:g} with --speed")


class UnknownSource(AppError):
    """A source of commands that does not exist."""

    def __init__(self, name: str, known: list[str]) -> None:
        super().__init__(f"there is no source {name!r}; known: {', '.join(known)}")


class UnusableSource(AppError):
    """A source of commands whose file does not work."""

    def __init__(self, name: str, why: str) -> None:
        super().__init__(f"the source {name} cannot be used: {why}")
