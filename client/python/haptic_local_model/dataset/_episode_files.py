"""The episodes that touch.episode() has kept, as they are read."""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
from typing import Any, Iterable

import numpy as np

from haptic_local_model import HapticError
from haptic_local_model._episodes import OUTCOMES, UPDATE

_ENDED = (*OUTCOMES, "unmarked", "interrupted")


@dataclasses.dataclass
class Stream:
    """Rows, and the session's time of each, s."""
    rows: np.ndarray
    times: np.ndarray


@dataclasses.dataclass
class EpisodeFiles:
    """One episode. `about` is episode.json; `updates` are records of UPDATE, at least one."""
    path: pathlib.Path
    about: dict[str, Any]
    updates: np.ndarray
    streams: dict[str, Stream]

    @property
    def task(self) -> str:
        return str(self.about.get("task", ""))

    @property
    def outcome(self) -> str:
        return str(self.about["outcome"])


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
    try:
        about = json.loads((path / "episode.json").read_text(encoding="utf-8"))
        names, outcome = about["streams"], about["outcome"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise HapticError(f"{path / 'episode.json'} is no description of an episode: {error}") from None
    if about.get("format") != 1 or outcome not in _ENDED:
        raise HapticError(f"{path / 'episode.json'} must have format 1 and an outcome of {', '.join(_ENDED)}")
    updates = _rows(path / "updates.npy")
    if updates.dtype != UPDATE or len(updates) == 0:
        raise HapticError(f"{path / 'updates.npy'} must have at least one update: no session was there")
    streams = {}
    for name in names:
        stream = Stream(_rows(path / f"{name}.npy"), _rows(path / f"{name}.time.npy"))
        if len(stream.rows) != len(stream.times):
            raise HapticError(f"{path / name}.npy has {len(stream.rows)} rows, and {len(stream.times)} times")
        if np.any(np.diff(stream.times) < 0):
            raise HapticError(f"{path / name}.time.npy goes back: the clock of that program was no steady one")
        streams[name] = stream
    return EpisodeFiles(path, about, updates, streams)


def _rows(path: pathlib.Path) -> np.ndarray:
    try:
        return np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError) as error:
        raise HapticError(f"{path} cannot be read: {error}") from None
