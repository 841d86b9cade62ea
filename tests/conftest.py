"""The failsafe contract as a table: which tests show which promise, and what they measured."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator

import pytest
from rich.console import Console
from rich.table import Table

PROMISES = {
    1: "operator gone (tab closed, network lost, stalled): HOLD after 200 ms, no velocity after 300 ms, upright",
    2: "web process killed or stopped: the robot holds; simulation killed or stopped: FAULT within 500 ms, log closed",
    3: "Engage released, page hidden or left: HOLD within a message and a tick",
    4: "NaN, infinities, no quaternion, out of bounds: refused, counted, the last good command goes on",
    5: "a target that jumps: wrists move at 1 m/s and 3 rad/s at most; beyond 0.25 m or 60 degrees the wrist is let go",
    6: "arms cannot follow: no exception, the nearest pose is shown, the page says why within 100 ms",
    7: "policy fails (NaN, late, wrong shape, exception): the last good action once, then FAULT and the default pose",
    8: "fall: FAULT within 200 ms, recorded; Reset stands the robot up",
    9: "physics diverges: back to the last good state, FAULT, recorded as a jump",
    10: "client that does not read: nothing piles up, closed after 5 s, the loop does not notice",
    11: "two operators: one writer a role in every tick; a take-over passes through HOLD; anyone stops",
    12: "disk full or slow: the robot goes on, the episode ends truncated, alarm within 1 s, no flushed row lost",
    13: "kill -9 while recording: 0.5 s lost at most, the file recovers",
    14: "recording under load: every row on disk",
    15: "malformed frames: closed with 1002, 1003 or 1007, no traceback",
    16: "oversized: 64 KiB a socket message (1009), 1 MiB a body (413)",
    17: "flood: 200 messages/s (1008) and 16 sockets (1013); Stop works within 100 ms meanwhile",
    18: "page of another site: refused on every route, sockets included",
    19: "name that somebody points at us (DNS rebinding): refused on every route",
    20: "beyond loopback only with a token of 192 bits; without it 401 on every route; never logged",
    21: "no GET changes anything",
    22: "names with paths in them reach no file; no request makes the server fail",
    23: "weights are safetensors, never code",
    24: "a model from a recording is first loaded in a process with memory and time limits; no other path loads one",
    25: "50 Hz with p99 lateness below 2 ms under SCHED_FIFO, 10 ms without",
}
"""Row of the contract -> what is promised."""

_outcomes: dict[int, list[bool]] = defaultdict(list)
_figures: dict[int, list[str]] = defaultdict(list)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--contract", action="store_true", help="print the table of the failsafe contract, and fail on a gap in it")


@pytest.fixture
def measured() -> Callable[[int, str], None]:
    """Call it with a row of the contract and a figure for its table."""
    return lambda row, text: _figures[row].append(text)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    report = yield
    marker = item.get_closest_marker("row")
    if marker and (report.when == "call" or report.failed):
        for row in marker.args:
            _outcomes[row].append(report.passed)
    return report


def pytest_sessionfinish(session: pytest.Session) -> None:
    if session.config.getoption("--contract") and session.exitstatus == 0 and not all(map(_kept, PROMISES)):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(config: pytest.Config) -> None:
    if not config.getoption("--contract"):
        return
    table = Table(title=f"{sum(map(_kept, PROMISES))} of {len(PROMISES)} rows kept", show_lines=True)
    for name, width in (("row", 3), ("promise", 50), ("measured", 70), ("", 10)):
        table.add_column(name, width=width)
    for row, promise in PROMISES.items():
        verdict = "kept" if _kept(row) else "BROKEN" if False in _outcomes[row] else "NOT SHOWN"
        tests = len(_outcomes[row])
        table.add_row(str(row), promise, "\n".join([*_figures[row], f"{tests} test{'s' * (tests != 1)}"]), verdict)
    Console(width=150).print(table)


def _kept(row: int) -> bool:
    return bool(_outcomes[row]) and all(_outcomes[row])
