"""A server's recording as numbers: every tick's signals, and the contacts that pushed the tool in it."""

from __future__ import annotations

import concurrent.futures
import json
import os
import pathlib
import subprocess
import tempfile
from typing import IO, Iterator, NamedTuple, Sequence

import numpy as np

from haptic_local_model import HapticError
from haptic_local_model._programs import program

_DIFFERS = 3  # the exit code of haptic_replay
#: Options of haptic_replay that are not the server's.
_NOT_OF_A_SERVER = ("help", "help-all", "version", "print-config", "offline", "receipt", "simulate", "server", "speed", "session", "ticks",
                    "signals", "late")


class Block(NamedTuple):
    """Consecutive ticks. `contacts` are sorted by them: each tick says in "contacts" how many are its own. lengths (n,), s: how long each
    tick's force was there; missed periods before it have its own. period: of the loop, s."""
    ticks: np.ndarray
    contacts: np.ndarray
    lengths: np.ndarray
    period: float


def blocks(recording: str | os.PathLike[str], options: Sequence[str] = (), changes: Sequence[str] | None = None) -> Iterator[Block]:
    """All of a recording, played again by haptic_replay with those options of the server. changes: None: they must be the recorded
    ones; or what is otherwise. Raises HapticError where it cannot be played, or not bit for bit."""
    file = os.fspath(recording)
    if not pathlib.Path(file).is_file():
        raise HapticError(f"recording {file!r} must be a file that haptic_server --record has written")
    for option in options:
        if option.partition("=")[0].removeprefix("--") in _NOT_OF_A_SERVER:
            raise HapticError(f"{option} must be an option of haptic_server")
    with tempfile.TemporaryFile() as errors:
        command = [program("haptic_replay"), file, "--offline", "--signals", "-", *options, *(changes or ())]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors) as process:
            assert process.stdout
            try:
                yield from _ahead(_read(process.stdout))
            except BaseException:
                process.kill()
                raise
        errors.seek(0)
        said = errors.read().decode(errors="replace")
    if process.returncode == _DIFFERS and changes is not None:
        return
    if process.returncode == _DIFFERS:
        raise HapticError(f"{file} does not come back as it was: " + (
            "it was recorded with other options: give the server's, as --config FILE or one by one, after --"
            if "recorded with other options" in said else "it is damaged, or lacks datagrams"))
    if process.returncode != 0:
        raise HapticError(f"{file}: {_last_line(said)}")


def _last_line(said: str) -> str:
    lines = [line for line in said.splitlines() if line.strip()]
    return lines[-1].removeprefix("haptic_replay: ") if lines else "haptic_replay said nothing"


def _ahead(made: Iterator[Block]) -> Iterator[Block]:
    """The same, with the next one read while one is in use."""
    with concurrent.futures.ThreadPoolExecutor(1) as reader:
        following = reader.submit(next, made, None)
        while (block := following.result()) is not None:
            following = reader.submit(next, made, None)
            yield block


def _read(stream: IO[bytes]) -> Iterator[Block]:
    line = stream.readline()
    if not line.endswith(b"\n"):
        return  # The program has ended, and says why.
    try:
        described = json.loads(line)
        kinds = [np.dtype([tuple(field) for field in described[name]]) for name in ("ticks", "contacts")]
        period = float(described["period_s"])
    except (ValueError, KeyError, TypeError):
        raise HapticError(f"{program('haptic_replay')} must be of the same version as this package") from None
    before = (0, 0)  # the latest tick's session and step
    while len(counts := stream.read(8)) == 8:
        parts = []
        for kind, count in zip(kinds, np.frombuffer(counts, "<u4")):
            data = stream.read(kind.itemsize * int(count))
            if len(data) < kind.itemsize * int(count):
                return
            parts.append(np.frombuffer(data, kind))
        ticks, contacts = parts
        steps = np.diff(np.append(before[1], ticks["step"]))
        goes_on = (np.diff(np.append(before[0], ticks["session"])) == 0) & (steps > 0)
        before = (ticks["session"][-1], ticks["step"][-1])
        yield Block(ticks, contacts, period * np.where(goes_on, steps, 1), period)
