"""What happened in an episode, on the server's clock: its ticks, and the contacts' part in each frame."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Iterable, Iterator, Mapping, Optional

import numpy as np

from haptic_local_model import HapticError
from haptic_local_model.dataset._clock import Clock, clock_of
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
_SIDES = ("a_kind", "b_kind", "a", "b")
_LARGEST_GAP = 0.2  # s: between the last tick of a recording and the end of an episode in it
_HELD = 3  # blocks, until its clock must be known, and before it: an update comes at most so much after what it is about

CONTACT_PART = np.dtype([("frame", "<i8"), ("identity", "<u8"), ("a_kind", "u1"), ("b_kind", "u1"), ("a", "<u4"), ("b", "<u4"),
                         ("impulse", "<f8", 3), ("weight", "<f8"), ("point", "<f8", 3), ("normal", "<f8", 3)])


@dataclasses.dataclass
class Timing:
    """When an episode was, on the server's clock, s, and that clock against the session's."""
    begin: float
    end: float
    clock: Clock


@dataclasses.dataclass
class Demonstration:
    """One episode. Frame i ends at timing.begin + i / fps and lasts 1 / fps.

    period: of the server's loop, s. time (n,), s, step (n,) and dt (n,), s, how long its force was there: of the ticks, from one frame
    before its beginning to its end. signals: (n, m) of each in SIGNALS, world axes: wrenches on the hand, N and N m, poses, m and
    quaternion w x y z, the proxy's twist, m/s and rad/s, and the gripper's opening, 0 to 1. contacts: records of CONTACT_PART, a row for each contact and
    frame: impulse, N s; weight, N s, the sum of its size, by which point, m, and normal are weighted."""
    episode: Optional[EpisodeFiles]
    timing: Timing
    period: float
    time: np.ndarray
    step: np.ndarray
    dt: np.ndarray
    signals: dict[str, np.ndarray]
    contacts: np.ndarray


class _Parts:
    """What the blocks of a recording have of an episode."""

    def __init__(self, episode: Optional[EpisodeFiles], session: int, timing: Timing, fps: float):
        self._episode, self._session, self.timing, self._fps, self._period = episode, session, timing, fps, 0.001
        self._ticks: list[dict[str, np.ndarray]] = []
        self._contacts = [np.zeros(0, CONTACT_PART)]

    def take(self, block: Block) -> None:
        ticks, timing = block.ticks, self.timing
        kept = ((ticks["session_id"] == self._session) & (ticks["time_s"] > timing.begin - 1 / self._fps)
                & (ticks["time_s"] <= timing.end + 0.5 / self._fps))
        if not kept.any():
            return
        self._period = block.period
        own = ticks[kept]
        signals = {name: np.column_stack([own[column] for column in columns]) for name, columns in SIGNALS.items()}
        self._ticks.append({"time": own["time_s"].copy(), "step": own["step"].astype(np.int64), "dt": block.lengths[kept], **signals})
        self._contacts.append(_contact_parts(block, kept, timing.begin, self._fps))

    def whole(self) -> Demonstration:
        """Raises HapticError where there is not all of it."""
        timing, name = self.timing, self._episode.path if self._episode else "a session"
        if not self._ticks:
            raise HapticError(f"{name} has no tick in its recording")
        joined = {field: np.concatenate([part[field] for part in self._ticks]) for field in self._ticks[0]}
        if (left := timing.end - joined["time"][-1]) > _LARGEST_GAP:
            raise HapticError(f"{name}: its recording ends {left:.2f} s before it, as one that was cut")
        return Demonstration(self._episode, timing, self._period, joined.pop("time"), joined.pop("step"), joined.pop("dt"), joined,
                             _merged(np.concatenate(self._contacts)))


class _Search:
    """An episode that is looked for in the blocks of a recording. timing: as it is known from another replay."""

    def __init__(self, episode: EpisodeFiles, fps: float, timing: Optional[Timing]):
        self.episode, self.is_over = episode, False
        self._fps, self._session, self._timing = fps, int(episode.updates["session"][0]), timing
        self._sampled = dict(zip(episode.updates["sequence"].tolist(), episode.updates["sampled"].tolist()))
        self._parts = self._begin(timing) if timing else None
        self._held: list[Block] = []  # until its clock is known
        self._ways: list[tuple[float, float, float]] = []  # of its updates: sampled when, taken when, how old then; s

    def _begin(self, timing: Timing) -> _Parts:
        return _Parts(self.episode, self._session, timing, self._fps)

    def feed(self, block: Block) -> None:
        ticks = block.ticks
        ours = ticks["session_id"] == self._session
        for tick in ticks[ours & (ticks["adopted"] > 0)]:
            if (sampled := self._sampled.get(int(tick["adopted"]))) is not None:
                self._ways.append((sampled, float(tick["time_s"]), float(tick["age_s"])))
        self._held.append(block)
        if self._parts is None and not self._ways:
            del self._held[:-_HELD]
        if self._parts is None and self._ways and (self._ways[-1][2] > 0 or len(self._held) > 2 * _HELD):
            self._parts = self._begin(self._timing_now())
        if self._parts is not None:
            self._take_held(self._parts)
            end = self._parts.timing.end + 1 / self._fps
            self.is_over = bool((ours & (ticks["time_s"] > end)).any())

    def _timing_now(self) -> Timing:
        times, clock = list(self._sampled.values()), clock_of(self._ways)
        return Timing(float(clock.to_server(times[0])), float(clock.to_server(times[-1])), clock)

    def _take_held(self, parts: _Parts) -> None:
        for block in self._held:
            parts.take(block)
        self._held.clear()

    @property
    def is_found(self) -> bool:
        return bool(self._ways)

    def result(self) -> Demonstration:
        """Raises HapticError where there is not all of it, or its clock jumps."""
        parts = self._parts or self._begin(self._timing_now())
        self._take_held(parts)
        whole = parts.whole()
        if self._timing is None:
            try:
                whole.timing.clock = clock_of(self._ways, finds_jumps=True)
            except HapticError as error:
                raise HapticError(f"{self.episode.path}: {error}") from None
        return whole


def _contact_parts(block: Block, kept: np.ndarray, begin: float, fps: float) -> np.ndarray:
    """Of the ticks of one block that are kept: rows of CONTACT_PART, several of one contact and frame where that goes on in another."""
    ticks, of_tick = block.ticks, np.repeat(kept, block.ticks["contacts"])
    contacts = block.contacts[of_tick]
    frames = np.ceil((ticks["time_s"] - begin) * fps - 1e-6).astype(np.int64)
    own = np.repeat(np.arange(len(ticks)), ticks["contacts"])[of_tick]
    names, which = np.unique(contacts["identity"], return_inverse=True)
    keys, first, group = np.unique(frames[own] * (len(names) + 1) + which, return_index=True, return_inverse=True)
    parts = np.zeros(len(keys), CONTACT_PART)
    parts["frame"], parts["identity"] = frames[own][first], contacts["identity"][first]
    for name in _SIDES:
        parts[name] = contacts[name][first]
    vectors = {name: np.column_stack([contacts[column] for column in columns]).astype(float) for name, columns in _CONTACT.items()}
    size = np.linalg.norm(vectors["force"], axis=1) * block.lengths[own]
    parts["weight"] = np.bincount(group, size, len(keys))
    for axis in range(3):
        parts["impulse"][:, axis] = np.bincount(group, vectors["force"][:, axis] * block.lengths[own], len(keys))
        for name in ("point", "normal"):
            parts[name][:, axis] = np.bincount(group, vectors[name][:, axis] * size, len(keys))
    return parts


def _merged(parts: np.ndarray) -> np.ndarray:
    """One row for each contact and frame, with means of points and normals."""
    parts = parts[np.lexsort((parts["identity"], parts["frame"]))]
    is_new = np.ones(len(parts), bool)
    is_new[1:] = (np.diff(parts["frame"]) != 0) | (parts["identity"][1:] != parts["identity"][:-1])
    whole = parts[is_new].copy()
    for name in ("impulse", "weight", "point", "normal") if len(parts) else ():
        whole[name] = np.add.reduceat(parts[name], np.flatnonzero(is_new), axis=0)
    for name in ("point", "normal"):
        whole[name] /= whole["weight"][:, None]
    return whole


def cut(blocks: Iterable[Block], episodes: Iterable[EpisodeFiles], fps: float, timings: Mapping[pathlib.Path, Timing],
        refused: dict[pathlib.Path, str]) -> Iterator[Demonstration]:
    """The episodes that a recording holds, in its order. timings: of those of which it is known, by path. refused: gets a line of each
    that is there and cannot be used."""
    searches = [_Search(episode, fps, timings.get(episode.path)) for episode in episodes]

    def results(ended: list[_Search]) -> Iterator[Demonstration]:
        for each in ended:
            try:
                yield each.result()
            except HapticError as error:
                refused[each.episode.path] = str(error)

    for block in blocks:
        for each in searches:
            each.feed(block)
        yield from results([each for each in searches if each.is_over])
        searches = [each for each in searches if not each.is_over]
    yield from results([each for each in searches if each.is_found])


def whole_sessions(blocks: Iterable[Block], fps: float) -> Iterator[Demonstration]:
    """Each session of a recording as one episode without marks, from its first update to its last."""
    found: dict[int, _Parts] = {}
    ends: dict[int, float] = {}
    before: list[Block] = []
    for block in blocks:
        taken = block.ticks[block.ticks["adopted"] > 0]
        for session in np.unique(taken["session_id"]).tolist():
            times = taken["time_s"][taken["session_id"] == session]
            ends[session] = float(times[-1])
            if session not in found:
                found[session] = _Parts(None, session, Timing(float(times[0]), np.inf, Clock()), fps)
                for earlier in before:
                    found[session].take(earlier)
        for parts in found.values():
            parts.take(block)
        before = [block]
    for session, parts in found.items():
        parts.timing.end = ends[session]
        yield parts.whole()
