"""Records made-up rows at 50 Hz until it is killed: python record_until_killed.py FOLDER. Prints when tick 0 was, monotonic [s]."""

import sys
import time
from pathlib import Path

import numpy as np
from small_rows import METADATA, PACKED_MODEL, make_rows

from app.outputs.recorder import Recorder


class SteadyRing:
    """A simulation that never misses a tick."""

    def __init__(self) -> None:
        self.start = time.monotonic()

    @property
    def count(self) -> int:
        return int((time.monotonic() - self.start) * 50)

    def since(self, number: int) -> tuple[list[np.void], int]:
        return list(make_rows(range(number, self.count))), 0


if __name__ == "__main__":
    ring = SteadyRing()
    recorder = Recorder(Path(sys.argv[1]), lambda: (METADATA, PACKED_MODEL), ring)
    recorder.start("until killed")
    print(ring.start, flush=True)
    time.sleep(60)
