"""A certificate of one's own, so that a headset opens the page over https: made once by openssl, and kept."""

from __future__ import annotations

import hashlib
import ipaddress
import os
import shutil
import socket
import subprocess
from dataclasses import replace
from pathlib import Path

from app.config import Serve
from app.errors import BadCertificate

DAYS = 820
"""Validity; Apple's devices trust none that is valid for more than 825 days."""
SPARE = 86400
"""One that ends within this time is made anew [s]."""


def provided(config: Serve, address: str) -> Serve:
    """The configuration with a certificate, and the names in it, where it asks for a self-made one.

    Args:
        config: what the program is started with.
        address: under which this machine talks to others.

    Raises:
        BadCertificate: it asks for two different ones, openssl is missing, or the folder cannot be written.
    """
    if not config.self_signed:
        return config
    if config.certificate or config.key:
        raise BadCertificate("--self-signed makes one and --certificate names another")
    if not shutil.which("openssl"):
        raise BadCertificate("openssl is not installed, which makes it: apt-get install openssl")
    names = sorted({"localhost", "127.0.0.1", address, socket.gethostname(), f"{socket.gethostname()}.local", *config.names})
    folder = _folder()
    kept = folder / f"{hashlib.sha256(' '.join(names).encode()).hexdigest()[:12]}.pem"
    key = kept.with_suffix(".key")
    if not (key.exists() and _lasts(kept)):
        _make(names, kept, key)
    return replace(config, certificate=kept, key=key, names=tuple(names))


def _folder() -> Path:
    base = os.environ.get("XDG_DATA_HOME")
    return (Path(base) if base else Path.home() / ".local" / "share") / "humanoid-teleop"


def _lasts(certificate: Path) -> bool:
    """Whether it is there and valid for a while."""
    command = ["openssl", "x509", "-checkend", str(SPARE), "-noout", "-in", str(certificate)]
    return certificate.exists() and subprocess.run(command, capture_output=True, timeout=60).returncode == 0


def _make(names: list[str], certificate: Path, key: Path) -> None:
    stated = ",".join(f"{'IP' if _is_address(name) else 'DNS'}:{name}" for name in names)
    command = [
        "openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", str(DAYS),
        "-subj", "/CN=humanoid-teleop", "-addext", f"subjectAltName={stated}", "-addext", "extendedKeyUsage=serverAuth",
        "-keyout", str(key), "-out", str(certificate),
    ]  # fmt: skip
    try:
        certificate.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        subprocess.run(command, check=True, capture_output=True, text=True, timeout=60)
        key.chmod(0o600)
    except subprocess.CalledProcessError as error:
        raise BadCertificate(f"openssl says: {error.stderr.strip().splitlines()[-1]}") from error
    except OSError as error:
        raise BadCertificate(str(error)) from error


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
        return True
    except ValueError:
        return False
