"""A demonstration as frames at one rate, each with what was known when it ended."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Optional

import numpy as np

from haptic_local_model.dataset._demonstration import Demonstration
from haptic_local_model.dataset._episode_files import EpisodeFiles

_WORLD, _BODY = 0, 2  # haptic.WORLD, haptic.MOVABLE_BODY


@dataclasses.dataclass
class Field:
    """What a column of frames is: the shape of one frame's, its unit, and in words."""
    shape: tuple[int, ...]
    dtype: str
    unit: str
    meaning: str


@dataclasses.dataclass
class Frames:
    """columns: by name, (n, …). left_out: how many frames have more contacts than there are columns for. farthest: of each stream, how far
    from a frame's end the row is that it has, at most, s."""
    demonstration: Demonstration
    fps: float
    columns: dict[str, np.ndarray]
    left_out: int
    farthest: dict[str, float]

    @property
    def count(self) -> int:
        return len(self.columns["action"])


def describe(period: float, fps: float, contacts: int) -> dict[str, Field]:
    """The columns that every demonstration has; world axes. period: of the server's loop, s."""
    n = math.ceil(1 / (period * fps) - 1e-9)
    return {
        "observation.state": Field((14,), "float32", "m, quaternion w x y z, m/s, rad/s, 1",
                                   "pose and twist of the proxy's hand frame, and the opening of the device's gripper"),
        "observation.force": Field((6,), "float32", "N, N m", "mean wrench of contacts and loads on the hand in the frame"),
        "observation.force_peak": Field((6,), "float32", "N, N m", "the same in the tick of the frame whose force is largest"),
        "observation.force_window": Field((n, 6), "float32", "N, N m", "the same in each tick of the frame; NaN first where it has fewer"),
        "observation.impulse": Field((6,), "float64", "N s, N m s", "the same, summed over its ticks, each as long as it was there"),
        "contact.force": Field((contacts, 3), "float32", "N", "mean force on the tool of each contact in the frame, the largest first"),
        "contact.point": Field((contacts, 3), "float32", "m", "where it acts, weighted by force"),
        "contact.normal": Field((contacts, 3), "float32", "1", "towards the tool, weighted by force"),
        "contact.id": Field((contacts,), "int64", "", "number of the contact in haptic.json; -1: none"),
        "action": Field((8,), "float32", "m, quaternion w x y z, 1", "pose of the device's handle in the world, and its gripper's opening"),
    }


class ContactNumbers:
    """Small numbers for contacts, which are the same where identity and names are."""

    def __init__(self) -> None:
        self._numbers: dict[tuple[Any, ...], int] = {}

    def of(self, parts: np.ndarray, episode: Optional[EpisodeFiles]) -> np.ndarray:
        identities, first, which = np.unique(parts["identity"], return_index=True, return_inverse=True)
        numbers = np.zeros(len(identities), np.int64)
        for i, (identity, row) in enumerate(zip(identities.tolist(), parts[first])):
            key = (identity, _name(row["a_kind"], row["a"], episode), _name(row["b_kind"], row["b"], episode))
            numbers[i] = self._numbers.setdefault(key, len(self._numbers))
        return numbers[which]

    def described(self) -> list[dict[str, Any]]:
        return [{"id": number, "identity": identity, "a": a, "b": b} for (identity, a, b), number in self._numbers.items()]


def _name(kind: int, number: int, episode: Optional[EpisodeFiles]) -> str:
    if kind == _BODY:
        return str((episode.bodies if episode else {}).get(str(number), f"body {number}"))
    return "world" if kind == _WORLD else f"tool's link {number}"


def frames_of(demonstration: Demonstration, fps: float, contacts: int, numbers: ContactNumbers) -> Frames:
    d, timing = demonstration, demonstration.timing
    count = math.floor((timing.end - timing.begin) * fps + 1e-6) + 1
    of_tick = np.ceil((d.time - timing.begin) * fps - 1e-6).astype(np.int64)
    inside = (of_tick >= 0) & (of_tick < count)
    columns = {name: np.full((count, *field.shape), np.nan if field.dtype.startswith("float") else -1, field.dtype)
               for name, field in describe(d.period, fps, contacts).items()}
    lengths = np.bincount(of_tick[inside], d.dt[inside], count)  # s
    _put_forces(columns, d.signals["force"][inside], of_tick[inside], d.dt[inside], lengths)
    left_out = _put_contacts(columns, d, lengths, numbers)
    some = np.flatnonzero(lengths > 0)
    last = np.searchsorted(of_tick, some, side="right") - 1
    columns["observation.state"][some] = np.column_stack([d.signals[name] for name in ("proxy", "twist", "gripper")])[last]
    columns["action"][some] = np.column_stack([d.signals[name] for name in ("handle", "gripper")])[last]
    farthest = {}
    for name, stream in (d.episode.streams.items() if d.episode else ()):
        columns[f"observation.{name}"], farthest[name] = _nearest(
            stream.rows, timing.clock.to_server(stream.times), timing.begin + np.arange(count) / fps, fps)
    return Frames(d, fps, columns, left_out, farthest)


def _put_forces(columns: dict[str, np.ndarray], force: np.ndarray, frame: np.ndarray, dt: np.ndarray, lengths: np.ndarray) -> None:
    """force (n, 6) of ticks that belong to the frames `frame` and were there for dt, s, each."""
    count, window = columns["observation.force_window"].shape[:2]
    some = lengths > 0
    impulse = np.column_stack([np.bincount(frame, column * dt, count) for column in force.T])
    columns["observation.impulse"][some] = impulse[some]
    columns["observation.force"][some] = impulse[some] / lengths[some, None]
    end = np.searchsorted(frame, np.arange(count), side="right")
    place = window - (end[frame] - np.arange(len(frame)))  # The last tick of a frame is the last of its window.
    fits = place >= 0
    columns["observation.force_window"][frame[fits], place[fits]] = force[fits]
    largest = np.lexsort((np.linalg.norm(force[:, :3], axis=1), frame))
    columns["observation.force_peak"][some] = force[largest][end[some] - 1]


def _put_contacts(columns: dict[str, np.ndarray], d: Demonstration, lengths: np.ndarray, numbers: ContactNumbers) -> int:
    """Returns in how many frames there were more contacts than the columns have."""
    most = columns["contact.id"].shape[1]
    parts = d.contacts[(d.contacts["frame"] >= 0) & (d.contacts["frame"] < len(lengths))]
    parts = parts[np.lexsort((-parts["weight"], parts["frame"]))]
    place = np.arange(len(parts)) - np.searchsorted(parts["frame"], parts["frame"])
    left_out = len(np.unique(parts["frame"][place >= most]))
    parts, place = parts[place < most], place[place < most]
    at = (parts["frame"], place)
    columns["contact.force"][at] = parts["impulse"] / lengths[parts["frame"], None]
    columns["contact.point"][at] = parts["point"]
    columns["contact.normal"][at] = parts["normal"] / np.linalg.norm(parts["normal"], axis=1, keepdims=True)
    columns["contact.id"][at] = numbers.of(parts, d.episode)
    return left_out


def _nearest(rows: np.ndarray, times: np.ndarray, at: np.ndarray, fps: float) -> tuple[np.ndarray, float]:
    """The row nearest to each of these times, and how far the farthest is, s. Of numbers with fractions NaN where there is none within a
    frame."""
    after = np.clip(np.searchsorted(times, at), 1, max(1, len(times) - 1))
    later = np.minimum(after, len(times) - 1)
    nearest = np.where(at - times[after - 1] <= times[later] - at, after - 1, later)
    found, away = np.array(rows[nearest]), np.abs(times[nearest] - at)
    if found.dtype.kind == "f":
        found[away > 1 / fps] = np.nan
    return found, float(away.max())
