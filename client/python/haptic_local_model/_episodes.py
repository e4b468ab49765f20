"""Demonstrations as they are made: marks, and what the engine knew, beside the server's recording.

An episode is a folder: episode.json, of each stream NAME.npy with its rows and NAME.time.npy with the session's time of each, s,
and updates.npy, which says when what was sent to the server held, so that the recording's ticks and these rows have one clock.
Until it has ended its name ends in ".part"."""

from __future__ import annotations

import atexit
import json
import os
import pathlib
import time
import warnings
from typing import TYPE_CHECKING, Any, BinaryIO, Mapping, Optional

import numpy as np

from haptic_local_model import _arguments
from haptic_local_model._arguments import HapticError

if TYPE_CHECKING:
    import haptic_local_model as haptic

OUTCOMES = ("success", "failure", "discard")
#: Of an update: its session, its number in it, and the session's time when the tool was sampled for it, s.
UPDATE = np.dtype([("session", "<u8"), ("sequence", "<u8"), ("sampled", "<f8")])
#: What streams may not be called, as data sets have fields of these names, and those that begin with "tick_".
RESERVED = ("updates", "state", "force", "force_peak", "force_window", "impulse")
_HEADER = 256  # bytes of a file of numpy before its rows
_MOST_BYTES = 2**31


class _Rows:
    """A file of numpy that grows."""

    def __init__(self, path: pathlib.Path, dtype: np.dtype, shape: tuple[int, ...]):
        self.dtype, self.shape, self.count = dtype, shape, 0
        self._file: BinaryIO = open(path, "xb", buffering=1 << 18)  # pylint: disable=consider-using-with
        self._file.write(self._header())

    def _header(self) -> bytes:
        kind = self.dtype.descr if self.dtype.names else self.dtype.str
        text = repr({"descr": kind, "fortran_order": False, "shape": (self.count, *self.shape)}).encode("latin1")
        return b"\x93NUMPY\x01\x00" + (_HEADER - 10).to_bytes(2, "little") + text.ljust(_HEADER - 11) + b"\n"

    def append(self, row: np.ndarray) -> None:
        self._file.write(row.tobytes())
        self.count += 1

    def close(self) -> None:
        with self._file:
            self._file.seek(0)
            self._file.write(self._header())


class Episode:
    """One attempt at a task, in a `with` block, in which the session's loop runs:

        with touch.episode("insert the peg", folder="demonstrations") as episode:
            while episode.running:
                ...
                touch.send(data)
                touch.log(qpos=data.qpos, image=renderer.render())
            if episode.running:
                episode.success()

    The first mark stands. An exception makes it "interrupted"; an episode without a mark is "unmarked". A disk that is full ends it,
    with a warning: the session goes on."""

    def __init__(self, touch: "haptic.Session", task: str, folder: str | os.PathLike[str], buttons: Mapping[int, str],
                 about: Mapping[str, Any]):
        self._touch, self._failure = touch, ""
        self._buttons = {_arguments.integer(button, "button", 0, 31): _arguments.choice(outcome, OUTCOMES, "outcome")
                         for button, outcome in buttons.items()}
        self._down = touch.state.buttons
        self._task, self._about = os.fsdecode(_arguments.text(task, "task")), dict(about)
        self.bodies: dict[int, str] = {}  #: Names of the engine's bodies, by the numbers that are sent.
        self.outcome = "unmarked"  #: Or "success", "failure", "discard", "interrupted".
        self._streams: dict[str, tuple[_Rows, _Rows]] = {}
        self._sampled = touch.now
        place = pathlib.Path(os.fsdecode(_arguments.text(folder, "folder"))).absolute()
        self.path = _make_folder(place)  #: Of the episode, which moves when it has ended.
        try:
            self._describe()
            self._updates = self._open("updates", UPDATE, ())
        except (TypeError, ValueError, OSError) as error:
            self._remove()
            raise HapticError(f"no episode can be kept in {place}: {error}" if isinstance(error, OSError) else
                              f"what is said of an episode must be JSON: {error}") from None

    def __enter__(self) -> "Episode":
        return self

    def __exit__(self, kind: Any, *_: Any) -> None:
        if kind is not None:
            self._mark("interrupted")
        self.close()

    @property
    def running(self) -> bool:
        """Until it has a mark, by a button of the device or a call, and while the session runs."""
        return self.outcome == "unmarked" and not self._failure and self._touch.running

    def success(self) -> None:
        self._require_open()
        self._mark("success")

    def failure(self) -> None:
        self._require_open()
        self._mark("failure")

    def discard(self) -> None:
        """Nothing of it is kept, whatever mark it has."""
        self._require_open()
        self.outcome = "discard"

    def log(self, /, **values: Any) -> None:
        """A row of each of these streams, numbers or arrays of numbers, that holds now."""
        self._require_open()
        if self._failure:
            return
        now = np.array(self._touch.now, "<f8")
        rows = {name: self._row(name, value) for name, value in values.items()}
        try:
            for name, row in rows.items():
                if name not in self._streams:
                    self._streams[name] = (self._open(name, row.dtype, row.shape), self._open(name + ".time", now.dtype, ()))
                of_stream, times = self._streams[name]
                of_stream.append(row)
                times.append(now)
        except OSError as error:
            self._fail(error)

    def sampled(self) -> None:
        """The session has sampled the tool."""
        self._sampled = self._touch.now

    def sent(self, session: int, sequence: int) -> None:
        """And sent what it found there."""
        pressed, self._down = self._touch.state.buttons & ~self._down, self._touch.state.buttons
        for button, outcome in self._buttons.items():
            if pressed >> button & 1:
                self._mark(outcome)
        if sequence == 0 or self._failure:
            return
        try:
            self._updates.append(np.array((session, sequence, self._sampled), UPDATE))
        except OSError as error:
            self._fail(error)

    def close(self) -> None:
        """As the `with` block does."""
        if self._touch.current_episode is not self:
            return
        self._touch.current_episode = None
        atexit.unregister(self.close)
        for rows in (self._updates, *(rows for pair in self._streams.values() for rows in pair)):
            try:
                rows.close()
            except OSError as error:
                self._fail(error)
        try:
            if self.outcome == "discard":
                self._remove()
            elif not self._failure:
                self._describe()
                self.path = self.path.rename(self.path.with_suffix(""))
        except OSError as error:
            self._fail(error)

    def _mark(self, outcome: str) -> None:
        if self.outcome == "unmarked":
            self.outcome = outcome

    def _require_open(self) -> None:
        if self._touch.current_episode is not self:
            raise HapticError(f"the episode {self.path.name} has ended")

    def _row(self, name: str, value: Any) -> np.ndarray:
        if not name.isidentifier() or name in RESERVED or name.startswith("tick_"):
            raise HapticError(f"stream {name!r} must have an identifier as its name, which is none of {', '.join(RESERVED)} and tick_…")
        try:
            # A whole number is not the first of whole numbers alone.
            row = np.asarray(float(value) if type(value) is int else value)
        except ValueError:
            row = np.array(None)
        if row.dtype.kind not in "buif" or row.dtype.itemsize > 8 or not 0 < row.nbytes <= _MOST_BYTES:
            raise HapticError(f"{name} must be numbers of at most 64 bits each, and at most 2 GB of them, not {_arguments.brief(value)}")
        row = row.astype(row.dtype.newbyteorder("<"), copy=False)
        return self._like_before(name, row) if name in self._streams else row

    def _like_before(self, name: str, row: np.ndarray) -> np.ndarray:
        of_stream = self._streams[name][0]
        if of_stream.shape != row.shape:
            raise HapticError(f"{name} has the shape {row.shape}, and had {of_stream.shape} before in this episode")
        if np.can_cast(row.dtype, of_stream.dtype):
            return row.astype(of_stream.dtype, copy=False)
        with np.errstate(all="ignore"):
            made = row.astype(of_stream.dtype)
        if not np.array_equal(made, row, equal_nan=row.dtype.kind == "f" and made.dtype.kind == "f"):
            raise HapticError(f"{name} is {row.dtype} {_arguments.brief(row.tolist())}, and was {of_stream.dtype} before in this episode")
        return made

    def _open(self, name: str, dtype: np.dtype, shape: tuple[int, ...]) -> _Rows:
        return _Rows(self.path / f"{name}.npy", dtype, shape)

    def _describe(self) -> None:
        facts = {"format": 1, "task": self._task, "outcome": self.outcome, "about": self._about, "bodies": self.bodies,
                 "wall_clock": time.time(), "streams": sorted(self._streams)}
        (self.path / "episode.json").write_text(json.dumps(facts, indent=1, allow_nan=False), encoding="utf-8")

    def _fail(self, error: OSError) -> None:
        if not self._failure:
            self._failure = str(error)
            warnings.warn(f"{self.path}: {error}; the episode ends here, and keeps that name", stacklevel=4)

    def _remove(self) -> None:
        for file in self.path.iterdir():
            file.unlink()
        self.path.rmdir()


def _make_folder(inside: pathlib.Path) -> pathlib.Path:
    """Of an episode that begins."""
    stamp = time.strftime("%Y%m%dT%H%M%S", time.gmtime())
    try:
        inside.mkdir(parents=True, exist_ok=True)
        for number in range(10_000):
            path = inside / f"{stamp}_{number:04d}.part"
            if not path.exists() and not path.with_suffix("").exists():
                path.mkdir()
                return path
    except OSError as error:
        raise HapticError(f"no episode can be kept in {inside}: {error}") from None
    raise HapticError(f"no episode can be kept in {inside}: there are 10,000 of this second")


def open_episode(touch: "haptic.Session", task: str, folder: str | os.PathLike[str], buttons: Optional[Mapping[int, str]],
                 about: Mapping[str, Any]) -> Episode:
    """Raises HapticError where one is open, or cannot be kept."""
    if touch.current_episode is not None:
        raise HapticError(f"the episode {touch.current_episode.path.name} must end before another begins")
    if not isinstance(buttons, (Mapping, type(None))):
        raise HapticError(f"buttons {_arguments.brief(buttons)} must be outcomes by number")
    touch.current_episode = Episode(touch, task, folder, buttons or {}, about)
    atexit.register(touch.current_episode.close)
    return touch.current_episode
