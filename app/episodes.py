"""Episodes for the page and for scripts: record, list, show again, download, delete."""

from __future__ import annotations

import itertools
import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
from fastapi import APIRouter, HTTPException, Response, status
from fastapi import Path as PathParameter
from fastapi.responses import StreamingResponse
from pydantic import Field

from app.outputs.recorder import Recorder
from app.outputs.tape import DiskFailed, RowRing, WrongMoment
from app.protocol import Wire
from policies.episode import DamagedRecording, Ending, EpisodeInfo, Metadata
from policies.recording.library import Library
from policies.recording.model import CannotReplay, load_model
from policies.recording.quality import Judge
from policies.recording.reader import Recording
from policies.recording.rewrite import RecordingInUse
from robots import catalog
from robots.errors import RobotError

FRAME_RATE = 25.0
"""Frames a second of what the page shows again."""

Id = Annotated[str, PathParameter(pattern=r"^[A-Za-z0-9._-]{1,64}$")]
Label = Annotated[str, Field(max_length=200)]


class UnknownEpisode(Exception):
    """An episode id that the recordings do not hold."""

    def __init__(self, id: str) -> None:
        super().__init__(f"there is no episode {id!r}; GET /api/episodes lists the known ones")


class StartOrder(Wire):
    """Body of POST /api/episodes."""

    label: Label = ""
    """What is to be done, in words."""


class StopOrder(Wire):
    """Body of POST /api/episodes/{id}/stop."""

    label: Label | None = None
    """Replaces the label given at the start."""
    success: bool | None = None


class LabelOrder(Wire):
    """Body of POST /api/episodes/{id}/label."""

    label: Label | None = None
    """None: as it is."""
    success: bool | None
    """None: not marked."""


class Started(Wire):
    """The episode that is being recorded from now on."""

    id: str


class EpisodeRecord(Wire):
    """One episode."""

    id: str
    start: float
    """Unix time [s]."""
    seconds: float
    rows: int
    """Ticks recorded."""
    label: str
    success: bool | None
    seed: int
    """Of the newest reset before it; 0: home."""
    gaps: int
    """Places where ticks are missing."""
    missing: int
    """Ticks missing there."""
    ended: Ending
    """open: being recorded. truncated: a crash or a full disk ended it."""
    file: str

    @staticmethod
    def of(info: EpisodeInfo) -> EpisodeRecord:
        values = {name: getattr(info, name) for name in EpisodeRecord.model_fields}
        return EpisodeRecord.model_validate(values | {"file": info.file.name})


class Happened(Wire):
    """An event of an episode."""

    seconds: float
    """Since its start."""
    kind: str
    """engaged, hold, stopped, fault, fell, reset or gap."""
    text: str


class Figures(Wire):
    """policies.recording.quality.Quality; null is a figure that the episode does not give."""

    seconds: float
    engaged: float
    """Seconds with the operator engaged."""
    falls: int
    holds: int
    """Times that an engaged operator was lost or let go."""
    wrist_error: float | None
    """Mean distance of the wrists from where they were told to be [m]."""
    wrist_turn: float | None
    """Mean angle between them [rad]."""
    velocity_error: float | None
    """m/s"""
    yaw_rate_error: float | None
    """rad/s"""
    jerk: float | None
    """Of the wrists, root mean square [m/s^3]."""
    at_limit: float | None
    """Share of the time with an arm joint at its limit."""


class Summary(Wire):
    """How an episode went."""

    quality: Figures
    events: tuple[Happened, ...]


class CannotJudge(Exception):
    """An episode whose model cannot be used here."""


class Episodes:
    """All episodes of a folder, the one being recorded included. Safe to use from several threads."""

    def __init__(
        self, directory: Path, describe: Callable[[], tuple[Metadata, bytes | None]], rows: RowRing, seed: Callable[[], int] = lambda: 0
    ) -> None:
        """Start the recorder, and mend in the background what a crash left behind. Arguments as for `Recorder`; `seed` tells that
        of the newest reset."""
        self.library = Library(directory)
        self.recorder, self._seed = Recorder(directory, describe, rows), seed
        self._summaries: dict[str, Summary] = {}
        self._judging = threading.Lock()
        threading.Thread(target=self.library.tidy, name="tidy recordings", daemon=True).start()

    def start(self, label: str = "") -> str:
        """Record from now on; returns the episode's id.

        Raises:
            WrongMoment, DiskFailed
        """
        return self.recorder.start(label, self._seed())

    def infos(self) -> list[EpisodeInfo]:
        """Every episode, newest first."""
        session, done = self.recorder.session()
        current = self.recorder.status().open
        found = [*self.library.infos(without=session), *done, *([current] if current else [])]
        return sorted(found, key=lambda info: info.start, reverse=True)

    def find(self, id: str) -> EpisodeInfo:
        """The episode of that id.

        Raises:
            UnknownEpisode: there is none.
        """
        for info in self.infos():
            if info.id == id:
                return info
        raise UnknownEpisode(id)

    def download(self, id: str) -> Iterator[bytes]:
        """A complete MCAP file of one episode, piece by piece; the first piece is ready when this returns.

        Raises:
            UnknownEpisode, DamagedRecording, OSError
        """
        pieces = self.library.stream(self.find(id))
        return itertools.chain([next(pieces)], pieces)

    def frames(self, id: str) -> np.ndarray:
        """qpos of an episode, FRAME_RATE a second [n, nq] float32.

        Raises:
            UnknownEpisode, DamagedRecording, OSError
        """
        return self.library.frames(self.find(id), FRAME_RATE)

    def summary(self, id: str) -> Summary:
        """Figures and events of a finished episode; remembered, because they take a second a minute of it.

        Raises:
            WrongMoment: it is being recorded.
            UnknownEpisode, CannotJudge, DamagedRecording, OSError
        """
        info = self.find(id)
        if info.ended == "open":
            raise WrongMoment(f"episode {id} is being recorded; stop it first")
        with self._judging:
            if id not in self._summaries:
                self._summaries[id] = _judge(info)
            return self._summaries[id]

    def label(self, id: str, order: LabelOrder) -> EpisodeInfo:
        """Change what a finished episode is called and whether it went well.

        Raises:
            WrongMoment: it is being recorded.
            UnknownEpisode, DiskFailed, DamagedRecording, RecordingInUse, OSError
        """
        info = self.find(id)
        if info.ended == "open":
            raise WrongMoment(f"episode {id} is being recorded; say it when it stops")
        label = info.label if order.label is None else order.label
        if info.file == self.recorder.session()[0]:
            return self.recorder.label(id, label, order.success)
        self.library.label(info, label, order.success)
        return self.find(id)

    def discard(self, id: str) -> None:
        """Forget an episode, the one being recorded included.

        Raises:
            UnknownEpisode, DiskFailed, DamagedRecording, RecordingInUse, OSError
        """
        info = self.find(id)
        if info.file == self.recorder.session()[0]:
            self.recorder.discard(id)
        else:
            self.library.delete(info)

    def delete(self, id: str) -> None:
        """Forget a finished episode and give its space back, at the latest when the program starts again.

        Raises:
            WrongMoment: it is being recorded.
            UnknownEpisode, DiskFailed, DamagedRecording, RecordingInUse, OSError
        """
        info = self.find(id)
        if info.ended == "open":
            raise WrongMoment(f"episode {id} is being recorded; stop or discard it")
        in_session = info.file == self.recorder.session()[0]
        self.discard(id)
        if in_session and self.recorder.status().open is None:
            self.recorder.release()
            self.library.delete(info)

    def close(self) -> None:
        """End an open episode and complete its file."""
        self.recorder.close()


def router(episodes: Episodes) -> APIRouter:
    """The REST interface. Handlers run in worker threads, because they wait for the disk."""
    api = APIRouter(prefix="/api/episodes", tags=["episodes"])

    @api.get("")
    def list_episodes() -> list[EpisodeRecord]:
        """Every episode, newest first."""
        return [EpisodeRecord.of(info) for info in episodes.infos()]

    @api.post("", status_code=status.HTTP_201_CREATED)
    def start(order: StartOrder | None = None) -> Started:
        """Record from now on."""
        with _as_http():
            return Started(id=episodes.start(order.label if order else ""))

    @api.post("/{id}/stop")
    def stop(id: Id, order: StopOrder | None = None) -> EpisodeRecord:
        """End the episode that is being recorded; when this answers, the disk has it."""
        order = order or StopOrder()
        with _as_http():
            return EpisodeRecord.of(episodes.recorder.stop(id, order.label, order.success))

    @api.post("/{id}/label")
    def label(id: Id, order: LabelOrder) -> EpisodeRecord:
        """Change the task text and the mark of a finished episode."""
        with _as_http():
            return EpisodeRecord.of(episodes.label(id, order))

    @api.post("/{id}/discard", status_code=status.HTTP_204_NO_CONTENT)
    def discard(id: Id) -> None:
        """Forget an episode, the one being recorded included."""
        with _as_http():
            episodes.discard(id)

    @api.delete("/{id}", status_code=status.HTTP_204_NO_CONTENT)
    def delete(id: Id) -> None:
        """Forget a finished episode and give its space back."""
        with _as_http():
            episodes.delete(id)

    @api.get("/{id}/download")
    def download(id: Id) -> StreamingResponse:
        """The episode as an MCAP file of its own."""
        with _as_http():
            name = {"Content-Disposition": f'attachment; filename="{id}.mcap"'}
            return StreamingResponse(episodes.download(id), media_type="application/octet-stream", headers=name)

    @api.get("/{id}/summary")
    def summary(id: Id) -> Summary:
        """How well a finished episode went, and what happened in it."""
        with _as_http():
            return episodes.summary(id)

    @api.get("/{id}/frames")
    def frames(id: Id) -> Response:
        """qpos at 25 Hz as little-endian float32, row after row; the header X-Columns tells the numbers a row."""
        with _as_http():
            found = episodes.frames(id)
        headers = {"X-Columns": str(found.shape[1]), "X-Rate": str(FRAME_RATE)}
        return Response(found.astype("<f4").tobytes(), media_type="application/octet-stream", headers=headers)

    return api


def _judge(info: EpisodeInfo) -> Summary:
    try:
        with Recording(info.file) as recording:
            rows, metadata = recording.episode(info).rows, recording.metadata
            judge = Judge(load_model(recording), catalog.load(metadata.robot).spec, metadata)
    except (CannotReplay, RobotError) as error:
        raise CannotJudge(str(error)) from error
    figures = {name: value if math.isfinite(value) else None for name, value in asdict(judge.quality(rows)).items()}
    events = tuple(Happened(**asdict(event)) for event in judge.events(rows))
    return Summary(quality=Figures.model_validate(figures), events=events)


@contextmanager
def _as_http() -> Iterator[None]:
    """Turn what went wrong into a status and a sentence."""
    try:
        yield
    except UnknownEpisode as error:
        raise HTTPException(status.HTTP_404_NOT_FOUND, str(error)) from error
    except (WrongMoment, RecordingInUse, CannotJudge) as error:
        raise HTTPException(status.HTTP_409_CONFLICT, str(error)) from error
    except DamagedRecording as error:
        raise HTTPException(status.HTTP_500_INTERNAL_SERVER_ERROR, str(error)) from error
    except (DiskFailed, OSError) as error:
        raise HTTPException(status.HTTP_507_INSUFFICIENT_STORAGE, str(error)) from error
