"""A file that appears whole, grows by whole records and tells other programs that it is in use."""

from __future__ import annotations

import contextlib
import fcntl
import os
from pathlib import Path


class SessionFile:
    """Collects what is written and puts it on disk at `flush`, so that an MCAP record is never split by our own doing.

    The file has a hidden name until `publish` and is locked (flock) until `close`; a killed program drops the lock.
    Every method but `write` and `tell` may raise OSError: no room, no permission, a broken disk.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._hidden = hidden_name(path)
        self._pending = bytearray()
        self._on_disk = 0
        self._fd = os.open(self._hidden, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        with contextlib.suppress(OSError):  # a file system without locks is no reason not to record
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def write(self, data: bytes) -> int:
        """Take bytes; they reach the disk with the next `flush`."""
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Bytes written so far, pending ones included."""
        return self._on_disk + len(self._pending)

    def flush(self) -> None:
        """Hand all pending bytes to the operating system: they survive the death of this program."""
        data = memoryview(bytes(self._pending))
        while data:
            written = os.write(self._fd, data)
            self._on_disk += written
            data = data[written:]
            del self._pending[:written]

    def sync(self) -> None:
        """Flush, and wait until the disk has the bytes and the name: they survive a power cut."""
        self.flush()
        os.fsync(self._fd)
        folder = os.open(self.path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)

    def publish(self) -> None:
        """Flush, and give the file its name, in place of any file that had it."""
        self.flush()
        os.replace(self._hidden, self.path)

    def close(self) -> None:
        """Let go of the file without writing what is pending; a file that was never published disappears."""
        with contextlib.suppress(OSError):
            os.close(self._fd)
        self._hidden.unlink(missing_ok=True)


def hidden_name(path: Path) -> Path:
    """Where the file of that path grows before it is published."""
    return path.with_name(f".{path.name}.part")


def in_use(path: Path) -> bool:
    """Whether a living program is writing the file."""
    fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        fcntl.flock(fd, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False  # no locks on this file system
    finally:
        os.close(fd)
    return False
