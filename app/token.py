"""The secret that lets people in from other machines, kept in a file that only its owner reads."""

from __future__ import annotations

import os
import re
import secrets
from pathlib import Path

from app.errors import AppError

BITS = 192
"""Of a new token."""
_GOOD = re.compile(r"[A-Za-z0-9_-]{32,256}")
"""192 bits or more as base64 for URLs."""


class BadToken(AppError):
    """A token file that cannot be used."""


def keep(path: Path) -> str:
    """The token in the file; a new one, readable by this user only, where there is no file yet.

    Raises:
        BadToken: the file cannot be read or made, others may read it, or what it holds is too short.
    """
    try:
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
                file.write(secrets.token_urlsafe(BITS // 8) + "\n")
        if path.stat().st_mode & 0o077:
            raise BadToken(f"other users of this machine may read {path}; run `chmod 600 {path}`, or remove it and a new one is made")
        token = path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise BadToken(f"the token file {path} cannot be used ({error}); name another one with --token") from error
    if not _GOOD.fullmatch(token):
        raise BadToken(f"{path} holds no token of at least 32 letters, digits, - and _; remove it and a new one is made")
    return token
