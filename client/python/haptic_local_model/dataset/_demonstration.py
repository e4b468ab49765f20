"""What happened in an episode, on the server's clock: its ticks, and the contacts' part in each frame."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Iterable, Iterator, Mapping, Optional

import numpy as np

from haptic_local_model import HapticError
from haptic_local_model.dataset._episode_files import EpisodeFiles
from haptic_local_model.dataset._signals import Block

_FORCE = [f"_{kind}_{axis}_{unit}" for kind, unit in (("force", "N"), ("torque", "N_m")) for axis in "xyz"]
_POSE = ["_x_m", "_y_m", "_z_m", "_qw", "_qx", "_qy", "_qz"]
_TWIST = [f"_{kind}{axis}_{unit}" for kind, unit in (("v", "m_per_s"), ("w", "rad_per_s")) for axis in "xyz"]
#: Signals of the ticks, by the names that they have here: their columns.
SIGNALS = {"force": ["env" + end for end in _FORCE], "command": ["command" + end for end in _FORCE],
           "hand_force": ["hand" + end for end in _FORCE], "handle": ["device" + end for end in _POSE],
           "proxy": ["proxy" + end for end in _POSE], "twist": ["proxy" + end for end in _TWIST], "gripper": ["gripper"]}
_CONTACT = {name: [f"{name}_{axis}{unit}" for axis in "xyz"] for name, unit in (("force", "_N"), ("point", "_m"), ("normal", ""))}
_LARGEST_GAP = 0.2  # s: between the last tick of a recording and the end of an episode in it
_LARGEST_JUMP = 0.02  # s: of the clock of a program against that of the server
_STEPS_UNTIL_KNOWN, _UPDATES = 1000, 15  # of the loop; of the simulator, over which a jump is looked for
_KEPT_BEFORE = 2  # blocks: an update comes at most so much after what it is about

CONTACT_PART = np.dtype([("frame", "<i8"), ("identity", "<u8"), ("a_kind", "u1"), ("b_kind", "u1"), ("a", "<u4"), ("b", "<u4"),
                         ("impulse", "<f8", 3), ("weight", "<f8"), ("point", "<f8", 3), ("normal", "<f8", 3)])


@dataclasses.dataclass
class Timing:
    """When an episode was, on the server's clock, s; its time less the session's, s; and how far single updates are from that, s."""
    begin: float
    end: float
    clock: float = 0.0
    clock_error: float = 0.0


@dataclasses.dataclass
class Demonstration:
    """One episode. Frame i ends at timing.begin + i / fps and lasts 1 / fps.

    time (n,), s, step (n,) and dt (n,), s: of the ticks, from one frame before its beginning to its end. signals: (n, m) of each in
    SIGNALS. contacts: records of CONTACT_PART, a row for each contact and frame: impulse, N s; weight, N s, the sum of its size, by
    which point, m, and normal are weighted."""
    episode: Optional[EpisodeFiles]
    session: int
    timing: Timing
    time: np.ndarray
    step: np.ndarray
    dt: np.ndarray
    signals: dict[str, np.ndarray]
    contacts: np.ndarray


class _Cut:
    """An episode that is looked for in the blocks of a recording. timing: as it is known from another replay."""

    def __init__(self, episode: EpisodeFiles, fps: float, timing: Optional[Timing]):
        updates = episode.updates
        if len(sessions := np.unique(updates["session"])) != 1:
            raise HapticError(f"{episode.path} has {len(sessions)} sessions, as the server was away in between: it must have one")
        self.episode, self.fps, self.session, self.timing = episode, fps, int(sessions[0]), timing
        self.sampled = dict(zip(updates["sequence"].tolist(), updates["sampled"].tolist()))
        self.parts: list[tuple[np.ndarray, np.ndarray]] = []
        self.is_over = False
        self._ways: list[tuple[float, float, float]] = []  # of updates: when, from sample to adoption with the clocks' difference, age
        self._is_known = timing is not None

    def feed(self, block: Block, before: Iterable[Block]) -> None:
        ticks = block.ticks
        ours = ticks["session_id"] == self.session
        for tick in np.flatnonzero(ours & (ticks["adopted"] > 0)):
            if (sampled := self.sampled.get(int(ticks["adopted"][tick]))) is not None:
                time, age = float(ticks["time_s"][tick]), float(ticks["age_s"][tick])
                self._ways.append((float(ticks["step"][tick]), time - sampled, age))
                if self.timing is None:
                    times = list(self.sampled.values())
                    self.timing = Timing(time - age - sampled + times[0], time - age - sampled + times[-1])
        if self.timing is None:
            return
        if not self.parts:
            for earlier in before:
                self._take(earlier, self.timing)
        self._take(block, self.timing)
        self.is_over = bool((ours & (ticks["time_s"] > self.timing.end + 1 / self.fps)).any())

    def _take(self, block: Block, timing: Timing) -> None:
        ticks = block.ticks
        kept = ((ticks["session_id"] == self.session) & (ticks["time_s"] > timing.begin - 1 / self.fps)
                & (ticks["time_s"] <= timing.end + 0.5 / self.fps))
        self.parts.append((ticks[kept], _contact_parts(block, kept, timing.begin, self.fps)))

    def result(self) -> Demonstration:
        assert self.timing
        ticks = np.concatenate([part for part, _ in self.parts])
        left = self.timing.end - (float(ticks["time_s"][-1]) if len(ticks) else self.timing.begin)
        if left > _LARGEST_GAP:
            raise HapticError(f"{self.episode.path}: its recording ends {left:.2f} s before it, as one that was cut")
        if not self._is_known:
            self.timing.clock, self.timing.clock_error = self._clock()
        return _demonstration(self.episode, self.session, self.timing, ticks, np.concatenate([contacts for _, contacts in self.parts]))

    def _clock(self) -> tuple[float, float]:
        """The fastest updates tell it: the network held them up least, and the age that the server attributes has the least of it, too.
        Before a session is a second old that age is not yet known."""
        steps, ways, ages = np.array(self._ways).T
        if (known := steps > _STEPS_UNTIL_KNOWN).any():
            ways, ages = ways[known], ages[known]
        single = ways - ages
        if len(single) >= 3 * _UPDATES:
            middle = np.median(np.lib.stride_tricks.sliding_window_view(single, _UPDATES), axis=1)
            if (jump := float(np.ptp(middle))) > _LARGEST_JUMP:
                raise HapticError(f"{self.episode.path}: its clock jumps against the server's, by {jump:.3f} s")
        clock = float(ways.min() - ages.min())
        return clock, float(np.median(np.abs(single - clock)))


def _contact_parts(block: Block, kept: np.ndarray, begin: float, fps: float) -> np.ndarray:
    """Of the ticks of one block that are kept: rows of CONTACT_PART, several of one contact and frame where that goes on in another."""
    ticks, of_tick = block.ticks, np.repeat(kept, block.ticks["contacts"])
    contacts = block.contacts[of_tick]
    frames = np.ceil((ticks["time_s"] - begin) * fps - 1e-6).astype(np.int64)
    lengths = _lengths(ticks)
    own = np.repeat(np.arange(len(ticks)), ticks["contacts"])[of_tick]
    names, which = np.unique(contacts["identity"], return_inverse=True)
    keys, first, group = np.unique(frames[own] * (len(names) + 1) + which, return_index=True, return_inverse=True)
    parts = np.zeros(len(keys), CONTACT_PART)
    parts["frame"], parts["identity"] = frames[own][first], contacts["identity"][first]
    for name in ("a_kind", "b_kind", "a", "b"):
        parts[name] = contacts[name][first]
    vectors = {name: np.column_stack([contacts[column] for column in columns]).astype(float) for name, columns in _CONTACT.items()}
    size = np.linalg.norm(vectors["force"], axis=1) * lengths[own]
    parts["weight"] = np.bincount(group, size, len(keys))
    for axis in range(3):
        parts["impulse"][:, axis] = np.bincount(group, vectors["force"][:, axis] * lengths[own], len(keys))
        for name in ("point", "normal"):
            parts[name][:, axis] = np.bincount(group, vectors[name][:, axis] * size, len(keys))
    return parts


def _lengths(ticks: np.ndarray) -> np.ndarray:
    """How long each tick's force was there, s: missed periods before it have its own."""
    if len(ticks) < 2:
        return np.full(len(ticks), 0.001)
    steps, times = np.diff(ticks["step"]), np.diff(ticks["time_s"])
    going_on = steps > 0
    period = 1 / round(1 / float(np.median(times[going_on] / steps[going_on]))) if going_on.any() else 0.001
    return period * np.concatenate([[1.0], np.where(going_on, steps, 1)])


def _demonstration(episode: Optional[EpisodeFiles], session: int, timing: Timing, ticks: np.ndarray,
                   contacts: np.ndarray) -> Demonstration:
    signals = {name: np.column_stack([ticks[column] for column in columns]) for name, columns in SIGNALS.items()}
    order = np.lexsort((contacts["identity"], contacts["frame"]))
    contacts = contacts[order]
    is_new = np.ones(len(contacts), bool)
    is_new[1:] = (np.diff(contacts["frame"]) != 0) | (contacts["identity"][1:] != contacts["identity"][:-1])
    whole = contacts[is_new].copy()
    for name in ("impulse", "weight", "point", "normal"):
        if len(contacts):
            whole[name] = np.add.reduceat(contacts[name], np.flatnonzero(is_new), axis=0)
    for name in ("point", "normal"):
        whole[name] /= whole["weight"][:, None]
    return Demonstration(episode, session, timing, ticks["time_s"].copy(), ticks["step"].astype(np.int64), _lengths(ticks), signals, whole)


def cut(blocks: Iterable[Block], episodes: Iterable[EpisodeFiles], fps: float,
        timings: Mapping[pathlib.Path, Timing]) -> Iterator[Demonstration]:
    """The episodes that a recording holds, in its order. timings: of those of which it is known."""
    waiting = [_Cut(episode, fps, timings.get(episode.path)) for episode in episodes]
    before: list[Block] = []
    for block in blocks:
        for each in waiting:
            each.feed(block, before)
        yield from (each.result() for each in waiting if each.is_over)
        waiting = [each for each in waiting if not each.is_over]
        before = [*before, block][-_KEPT_BEFORE:]
    yield from (each.result() for each in waiting if any(len(ticks) for ticks, _ in each.parts))


def whole_sessions(blocks: Iterable[Block], fps: float) -> Iterator[Demonstration]:
    """Each session of a recording as one episode without marks, from its first update to its last."""
    found: dict[int, list[Block]] = {}
    for block in blocks:
        of_session = block.ticks["session_id"]
        for session in np.unique(of_session[of_session > 0]).tolist():
            found.setdefault(session, []).append(block)
    for session, kept in found.items():
        whole = Block(np.concatenate([block.ticks for block in kept]), np.concatenate([block.contacts for block in kept]))
        ours = whole.ticks["session_id"] == session
        held = np.flatnonzero(ours & (whole.ticks["adopted"] > 0))
        if not len(held):
            continue
        timing = Timing(float(whole.ticks["time_s"][held[0]]), float(whole.ticks["time_s"][held[-1]]))
        inside = ours & (whole.ticks["time_s"] > timing.begin - 1 / fps) & (whole.ticks["time_s"] <= timing.end + 0.5 / fps)
        yield _demonstration(None, session, timing, whole.ticks[inside], _contact_parts(whole, inside, timing.begin, fps))
