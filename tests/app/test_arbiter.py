"""One driver at a time, whatever the clients do and in whatever order."""

from __future__ import annotations

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from app.arbiter import SILENCE, Lease

clients = st.sampled_from(["ada", "bo", "cy"])


class Clients(RuleBasedStateMachine):
    """Three clients who say, take, leave and fall silent; a model that remembers who may write."""

    def __init__(self) -> None:
        super().__init__()
        self.lease, self.now = Lease(), 0.0
        self.wrote: list[str] = []
        self.heard: dict[str, float] = {}

    @rule(seconds=st.floats(0.05, 3.0))
    def time_passes(self, seconds: float) -> None:
        self.now += seconds

    @rule(client=clients, wants=st.booleans())
    def speaks(self, client: str, wants: bool) -> None:
        before, number = self.lease.holder, self.lease.number
        free = before is None or self.now - self.heard[before] > SILENCE
        drives = self.lease.hear(client, self.now, wants=wants)
        assert drives == ((client == before and not free) or (free and wants))
        assert (self.lease.number > number) == (free and wants)
        if drives:
            self.heard[client] = self.now

    @rule(client=clients)
    def takes(self, client: str) -> None:
        before, number = self.lease.holder, self.lease.number
        assert self.lease.hear(client, self.now, takes=True), "an explicit take-over always works"
        assert before == client or self.lease.number == number + 1, "the robot is told of every hand-over"
        self.heard[client] = self.now

    @rule(client=clients)
    def leaves(self, client: str) -> None:
        drove = client == self.lease.holder
        assert self.lease.leave(client) == drove
        assert self.lease.holder != client

    @invariant()
    def never_two_writers_in_a_tick(self) -> None:
        """Everybody speaks in the same instant, wanting nothing: at most the holder may write."""
        holder = self.lease.holder
        writers = [client for client in ("ada", "bo", "cy") if self._would_write(client)]
        assert len(writers) <= 1
        assert not writers or writers == [holder]

    def _would_write(self, client: str) -> bool:
        trial = Lease()
        trial.__dict__.update(self.lease.__dict__)
        return trial.hear(client, self.now)


TestClients = Clients.TestCase
TestClients.settings = settings(max_examples=40, stateful_step_count=25, deadline=None)
