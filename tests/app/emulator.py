"""The WebXR emulator IWER (MIT): a headset in any browser. Fetched once from the npm registry into the user's cache, for tests only."""

from __future__ import annotations

import base64
import hashlib
import io
import os
import shutil
import subprocess
import tarfile
import tempfile
import urllib.request
from pathlib import Path

import pytest

NAME = "iwer-2.5.0"
URL = f"https://registry.npmjs.org/iwer/-/{NAME}.tgz"
SHA512 = "grq7iMyWo4s2DYnATKLPPoAByhcNuwLjMHHOILrFU9q8EGHIEzHyUuq1mz+9Xqy6+xrYPn3Ho8Z9eymZCE+D6w=="
"""As the registry states it."""


def script() -> str:
    """Source of the emulator; defines the global IWER. Skips the test where it cannot be had."""
    base = os.environ.get("XDG_CACHE_HOME")
    kept = (Path(base) if base else Path.home() / ".cache") / "humanoid-teleop" / f"{NAME}.tgz"
    if not kept.exists():
        kept.parent.mkdir(parents=True, exist_ok=True)
        kept.write_bytes(_fetch())
    data = kept.read_bytes()
    if base64.b64encode(hashlib.sha512(data).digest()).decode() != SHA512:
        kept.unlink()
        pytest.fail(f"{kept} was damaged and is deleted; run the test again")
    with tarfile.open(fileobj=io.BytesIO(data)) as package:
        source = package.extractfile("package/build/iwer.min.js")
        assert source
        return source.read().decode()


def _fetch() -> bytes:
    """The package: by npm, which knows mirrors and proxies, or as the one file that it is."""
    try:
        if shutil.which("npm"):
            with tempfile.TemporaryDirectory() as folder:
                subprocess.run(["npm", "pack", "iwer@2.5.0", "--silent"], cwd=folder, check=True, capture_output=True, timeout=120)
                return (Path(folder) / f"{NAME}.tgz").read_bytes()
        with urllib.request.urlopen(URL, timeout=60) as answer:
            return answer.read()
    except (OSError, subprocess.SubprocessError) as error:
        pytest.skip(f"no WebXR emulator: {URL} cannot be fetched ({error}); with a network it is kept for later runs")
