"""The command `teleop`."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro
import uvicorn

from app import certificate, door, log, recordings
from app.config import Serve
from app.errors import AppError
from app.limiter import WRIST_SPEED
from app.token import keep
from app.traffic import LARGEST_MESSAGE
from policies.errors import PolicyError
from robots import catalog
from robots.errors import RobotError

if TYPE_CHECKING:
    from app.session import Session
    from policies.motion.clip import Clip

DESCRIPTION = """Drive a walking humanoid from a browser tab.

examples:
  teleop                               serve the page on http://127.0.0.1:8080
  teleop --port 9000 --policy my.safetensors
  teleop episodes                      list what was recorded
  teleop replay recordings/FILE.mcap   simulate it again and compare, bit for bit
  teleop recover recordings            mend what a crash left behind
  teleop doctor                        is this machine fit for it?
  teleop replay-motion 07_01           a motion of runs/clips.npz on the robot's arms; or a .bvh file
  teleop export recordings --format lerobot --cameras head chase
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line. Returns the exit code: 1 after an error, which is one sentence, and 130 when somebody broke it off."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as cleanly as Ctrl-C
    try:
        chosen = _parse(list(sys.argv[1:] if arguments is None else arguments))
        return serve(chosen) if isinstance(chosen, Serve) else chosen
    except (AppError, RobotError, PolicyError) as error:
        print(f"teleop: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


def serve(config: Serve, clip: Clip | None = None, speed: float = 1.0) -> int:
    """Serve until Ctrl-C. A clip, if there is one, drives the arms at that speed.

    Raises:
        AppError, RobotError, PolicyError: it cannot start; the message says why.
    """
    from app.session import Session  # the other commands do without a simulator and a web server

    log.configure(config.log)
    config = certificate.provided(config, door.own_address())
    token = config.token and keep(config.token)
    with door.listen(config) as listener:
        session = Session(config, token)
        try:
            for line in session.missing():
                print(line, file=sys.stderr)
            if clip:
                _play(session, clip, speed)
            print(f"{config.robot} stands. Open {_invitation(config, door.url(config, listener), token)} - Ctrl-C ends.", flush=True)
            options = uvicorn.Config(
                session.app(),
                log_level="warning",
                log_config=None,
                access_log=False,
                ws_max_size=LARGEST_MESSAGE,
                ws_per_message_deflate=False,
                timeout_graceful_shutdown=2,
                ssl_certfile=config.certificate,
                ssl_keyfile=config.key,
            )
            with suppress(KeyboardInterrupt):
                uvicorn.Server(options).run(sockets=[listener])
        finally:
            session.close()
    return 0


def _play(session: Session, clip: Clip, speed: float) -> None:
    fastest = session.play(clip, speed).fastest
    print(f"{clip.name} plays, {clip.seconds / speed:.1f} s, over and over.")
    if fastest > WRIST_SPEED:
        slower = f"--speed {speed * WRIST_SPEED / fastest:.2f} shows all of it"
        print(f"Its wrists move at {fastest:.1f} m/s, the robot's follow at {WRIST_SPEED:.1f} m/s at most; {slower}.")


def _invitation(config: Serve, address: str, token: str | None) -> str:
    """What to open. The token is shown to a person at a terminal only: what is written to a file or a journal stays there."""
    if token is None:
        return address
    return f"{address}/?token={token if sys.stdout.isatty() else f'TOKEN (it stands in {config.token})'}"


def _parse(arguments: list[str]) -> Serve | int:
    """A configuration to serve, or the exit code of another command that ran."""
    commands = {
        "serve": Serve,
        "episodes": _episodes,
        "replay": _replay,
        "recover": _recover,
        "export": _export,
        "replay-motion": _replay_motion,
        "doctor": _doctor,
    }
    first = arguments[0] if arguments else ""
    if first not in (*commands, "-h", "--help"):
        arguments = ["serve", *arguments]
    return tyro.extras.subcommand_cli_from_dict(commands, prog="teleop", description=DESCRIPTION, args=arguments)


def _episodes(directory: tyro.conf.Positional[Path] = Serve.recordings) -> int:
    """List the recorded episodes of a folder."""
    return recordings.episodes(directory)


def _replay(file: tyro.conf.Positional[Path], episode: int | None = None, policy: str | None = None) -> int:
    """Simulate recorded episodes again and compare them with the recording, bit for bit; or see how another policy does.

    Args:
        file: a recording.
        episode: the number of one episode; all of them otherwise.
        policy: leg weights that drive instead of the recorded motor targets: where they first differ, and the figures of both.
    """
    return recordings.replay(file, episode) if policy is None else recordings.rival(file, policy, episode)


def _recover(path: tyro.conf.Positional[Path]) -> int:
    """Mend a recording that a crash or a full disk left behind.

    Args:
        path: a file, or a folder of them.
    """
    return recordings.recover(path)


def _doctor(robot: str = Serve.robot, port: int = Serve.port, recordings: Path = Serve.recordings) -> int:
    """Look whether this machine is fit to drive a robot, and say what to do where it is not.

    Args:
        robot: which robot.
        port: on which to listen.
        recordings: folder of the recorded episodes.
    """
    from app import doctor  # the other commands do without a simulator

    return doctor.main(robot, port, recordings)


def _replay_motion(
    clip: tyro.conf.Positional[str],
    clips: Path = Path("runs/clips.npz"),
    speed: float = 1.0,
    serving: tyro.conf.OmitArgPrefixes[Serve] = Serve(),  # noqa: B008  a frozen default
) -> int:
    """Play a motion on the robot's waist and arms, over and over, in the page in which its legs are driven.

    Args:
        clip: a clip by name, NAME~mirror for its mirrored twin, or a motion file: .bvh, or .csv of a Unitree G1, plain or .gz.
        clips: the file of clips, made by `teleop-train retarget`.
        speed: of the playback; 1 is the person's own.
        serving: as `teleop serve`.
    """
    from policies.motion.find import find  # the other commands do without

    return serve(serving, find(clip, clips, catalog.load(serving.robot)), speed)


def _export(
    session: tyro.conf.Positional[tuple[Path, ...]],
    format: Literal["lerobot", "gr00t", "robomimic", "viser", "csv"],
    output: Path | None = None,
    episode: tuple[str, ...] = (),
    label: tuple[str, ...] = (),
    only: Literal["success", "failure"] | None = None,
    cameras: tuple[str, ...] = ("head",),
    size: str = "320x240",
    fps: int | None = None,
) -> int:
    """Write recorded episodes for training: read back row by row before they get their name.

    Args:
        session: recordings, or folders of them.
        format: lerobot (v3.0), gr00t (LeRobot v2.1 with modality.json), robomimic (HDF5), viser (a page an episode) or csv.
        output: the folder to make; named after the recording otherwise.
        episode: ids, or numbers within a file; all otherwise.
        label: task texts.
        only: episodes marked so.
        cameras: head, head_left, head_right, wrist_left, wrist_right, chase; or none. Drawn from the recording, which takes time.
        size: width x height of a picture.
        fps: rows a second, an even part of the recorded 50.
    """
    from app.exports import command  # the other commands do without MuJoCo's renderer and the formats

    success = None if only is None else only == "success"
    look = command.look(cameras, size)
    return command.export(list(session), format, output, command.Choice(episode, label, success), look, fps)
