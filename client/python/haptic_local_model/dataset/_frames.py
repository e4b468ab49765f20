"""A demonstration as frames at one rate, each with what was known when it ended."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from haptic_local_model import HapticError
from haptic_local_model.dataset._demonstration import Demonstration


@dataclasses.dataclass
class Field:
    """What a column of frames is: the shape of one frame's, its unit, and in words."""
    shape: tuple[int, ...]
    dtype: str
    unit: str
    meaning: str


@dataclasses.dataclass
class Frames:
    """columns: by name, (n, …). left_out: how many frames have more contacts than there are columns for."""
    demonstration: Demonstration
    fps: float
    columns: dict[str, np.ndarray]
    left_out: int

    @property
    def count(self) -> int:
        return len(self.columns["action"])


def window_length(rate: float, fps: float) -> int:
    """Ticks that a frame has at most."""
    return math.ceil(rate / fps - 1e-9)


def describe(rate: float, fps: float, contacts: int) -> dict[str, Field]:
    """The columns that every demonstration has; world axes."""
    n = window_length(rate, fps)
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


class PairNumbers:
    """Small numbers for the identities of contacts."""

    def __init__(self) -> None:
        self.pairs: dict[int, dict[str, int]] = {}

    def of(self, parts: np.ndarray) -> np.ndarray:
        identities, first, which = np.unique(parts["identity"], return_index=True, return_inverse=True)
        numbers = np.zeros(len(identities), np.int64)
        for i, (identity, row) in enumerate(zip(identities.tolist(), first)):
            if identity not in self.pairs:
                self.pairs[identity] = {"id": len(self.pairs), "identity": identity,
                                        **{name: int(parts[name][row]) for name in ("a_kind", "a", "b_kind", "b")}}
            numbers[i] = self.pairs[identity]["id"]
        return numbers[which]


def frames_of(demonstration: Demonstration, rate: float, fps: float, contacts: int, pairs: PairNumbers) -> Frames:
    """Raises HapticError where a demonstration has no frame."""
    d = demonstration
    count = math.floor((d.timing.end - d.timing.begin) * fps + 1e-6) + 1
    of_tick = np.ceil((d.time - d.timing.begin) * fps - 1e-6).astype(np.int64)
    inside = (of_tick >= 0) & (of_tick < count)
    if not inside.any():
        raise HapticError("a demonstration has no tick")
    columns = {name: np.full((count, *field.shape), np.nan if field.dtype.startswith("float") else -1, field.dtype)
               for name, field in describe(rate, fps, contacts).items()}
    lengths = np.bincount(of_tick[inside], d.dt[inside], count)  # s
    _put_forces(columns, d.signals["force"][inside], of_tick[inside], d.dt[inside], lengths)
    left_out = _put_contacts(columns, d.contacts, lengths, pairs)
    last = np.clip(np.searchsorted(of_tick, np.arange(count), side="right") - 1, 0, None)
    known = of_tick[last] >= 0
    state = np.column_stack([d.signals["proxy"], d.signals["twist"], d.signals["gripper"]])
    columns["observation.state"][known] = state[last][known]
    columns["action"][known] = np.column_stack([d.signals["handle"], d.signals["gripper"]])[last][known]
    for name, stream in (d.episode.streams.items() if d.episode else ()):
        columns[f"observation.{name}"] = _nearest(stream.rows, stream.times + d.timing.clock, d.timing.begin + np.arange(count) / fps, fps)
    return Frames(d, fps, columns, left_out)


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


def _put_contacts(columns: dict[str, np.ndarray], parts: np.ndarray, lengths: np.ndarray, pairs: PairNumbers) -> int:
    """Returns in how many frames there were more contacts than the columns have."""
    most = columns["contact.id"].shape[1]
    parts = parts[(parts["frame"] >= 0) & (parts["frame"] < len(lengths))]
    parts = parts[np.lexsort((-parts["weight"], parts["frame"]))]
    place = np.arange(len(parts)) - np.searchsorted(parts["frame"], parts["frame"])
    left_out = len(np.unique(parts["frame"][place >= most]))
    parts, place = parts[place < most], place[place < most]
    at = (parts["frame"], place)
    columns["contact.force"][at] = parts["impulse"] / lengths[parts["frame"], None]
    columns["contact.point"][at] = parts["point"]
    columns["contact.normal"][at] = parts["normal"] / np.linalg.norm(parts["normal"], axis=1, keepdims=True)
    columns["contact.id"][at] = pairs.of(parts)
    return left_out


def _nearest(rows: np.ndarray, times: np.ndarray, at: np.ndarray, fps: float) -> np.ndarray:
    """The row nearest to each of these times. Of numbers with fractions NaN where there is none within a frame."""
    after = np.clip(np.searchsorted(times, at), 1, max(1, len(times) - 1))
    nearest = np.where(at - times[after - 1] <= times[np.minimum(after, len(times) - 1)] - at, after - 1,
                       np.minimum(after, len(times) - 1))
    found = np.array(rows[nearest])
    if found.dtype.kind == "f":
        found[np.abs(times[nearest] - at) > 1 / fps] = np.nan
    return found
