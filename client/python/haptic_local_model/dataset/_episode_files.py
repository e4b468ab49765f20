"""The episodes that touch.episode() has kept, as they are read."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import pathlib
from typing import Any, Iterable

import numpy as np

from haptic_local_model import HapticError
from haptic_local_model._episodes import OUTCOMES, RESERVED, UPDATE

_ENDED = (*OUTCOMES, "unmarked", "interrupted")


@dataclasses.dataclass
class Stream:
    """Rows, and the session's time of each, s."""
    rows: np.ndarray
    times: np.ndarray


@dataclasses.dataclass
class EpisodeFiles:
    """One episode. about: what touch.episode() was told of it. wall_clock: as it ended, s since 1970. updates: records of UPDATE, at least
    one, of one session. bodies: names by number."""
    path: pathlib.Path
    task: str
    outcome: str
    about: dict[str, Any]
    bodies: dict[str, str]
    wall_clock: float
    updates: np.ndarray
    streams: dict[str, Stream]


def find_episodes(places: Iterable[str | os.PathLike[str]]) -> tuple[list[EpisodeFiles], list[str]]:
    """Those in these folders, or that these are; and a line about each that cannot be used: it has no end, or a file is cut."""
    found, complaints = [], []
    for place in map(pathlib.Path, places):
        if not place.is_dir():
            raise HapticError(f"{os.fspath(place)!r} must be a recording, FILE.pcap, or a folder of episodes")
        is_episode = (place / "episode.json").exists()
        for path in [place] if is_episode else sorted(child for child in place.iterdir() if (child / "episode.json").exists()):
            try:
                found.append(read_episode(path))
            except HapticError as error:
                complaints.append(str(error))
    return found, complaints


def read_episode(path: pathlib.Path) -> EpisodeFiles:
    """Raises HapticError that names the file which cannot be used."""
    if path.suffix == ".part":
        raise HapticError(f"{path} has no end: its program was ended, or its disk was full")
    described = _description(path / "episode.json")
    updates = _rows(path / "updates.npy", UPDATE)
    if len(updates) == 0:
        raise HapticError(f"{path} has no update: there was no session")
    if (sessions := len(np.unique(updates["session"]))) != 1:
        raise HapticError(f"{path} has {sessions} sessions, as the server was away in between: it must have one")
    streams = {name: _stream(path, name) for name in described.pop("streams")}
    return EpisodeFiles(path, updates=updates, streams=streams, **described)


def _description(file: pathlib.Path) -> dict[str, Any]:
    kinds = {"task": str, "outcome": str, "about": dict, "bodies": dict, "wall_clock": float, "streams": list}
    try:
        described = json.loads(file.read_text(encoding="utf-8"))
        facts = {name: described[name] for name in kinds}
        wrong = [name for name, kind in kinds.items() if not isinstance(facts[name], kind)]
        is_right = described["format"] == 1 and not wrong and facts["outcome"] in _ENDED and 0 <= facts["wall_clock"] < 4e9
        names = facts["streams"] if is_right else []
        is_right = is_right and all(isinstance(name, str) and name.isidentifier() and name not in RESERVED for name in names)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise HapticError(f"{file} is no description of an episode: {error}") from None
    if not is_right:
        raise HapticError(f"{file} must have format 1 and an outcome of {', '.join(_ENDED)}, as touch.episode() writes it")
    return facts


def _stream(path: pathlib.Path, name: str) -> Stream:
    stream = Stream(_rows(path / f"{name}.npy"), _rows(path / f"{name}.time.npy", np.dtype("<f8")))
    if len(stream.rows) != len(stream.times) or len(stream.rows) == 0:
        raise HapticError(f"{path / name}.npy has {len(stream.rows)} rows, and {len(stream.times)} times")
    if not np.isfinite(stream.times).all() or np.any(np.diff(stream.times) < 0):
        raise HapticError(f"{path / name}.time.npy goes back: the clock of that program was no steady one")
    return stream


def _rows(path: pathlib.Path, dtype: np.dtype | None = None) -> np.ndarray:
    """dtype: that of a list, which it must have; otherwise any numbers."""
    try:
        rows = np.lib.format.open_memmap(path, mode="r")
        is_right = rows.ndim == 1 and rows.dtype == dtype if dtype is not None else rows.ndim > 0 and rows.dtype.kind in "buif"
    except Exception as error:  # Of files that are none of numpy it raises many kinds.
        raise HapticError(f"{path} cannot be read: {' '.join(str(error).split())}") from None
    if not is_right:
        raise HapticError(f"{path} must have rows of {dtype or 'numbers'}")
    return rows
