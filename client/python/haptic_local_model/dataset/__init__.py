"""Demonstrations with the forces in them: data sets of what the hand felt, contact by contact, in every tick.

    haptic_server --record run.pcap                                 # on the machine with the device
    with touch.episode("insert the peg"): ...                       # in the simulator, each attempt; touch.log(qpos=…, image=…)
    python3 -m haptic_local_model.dataset run.pcap demonstrations --to lerobot --fps 30 --out insert

A recording is played again, bit for bit, on the server's own tick: the contacts' forces in it are what the hand felt, and with
--again they are what it would have felt with another stiffness, or later news of the world. docs/dataset.md has every field.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import itertools
import json
import os
import pathlib
import tempfile
from typing import Any, Iterable, Iterator, Mapping, Sequence

import haptic_local_model as haptic
from haptic_local_model import HapticError, _arguments
from haptic_local_model.dataset._changes import arguments_of, combinations
from haptic_local_model.dataset._clock import Clock
from haptic_local_model.dataset._demonstration import CONTACT_PART, Demonstration, Timing, cut, whole_sessions
from haptic_local_model.dataset._episode_files import EpisodeFiles, Stream, find_episodes
from haptic_local_model.dataset._frames import ContactNumbers, Field, Frames, describe, frames_of
from haptic_local_model.dataset._report import check, description_of
from haptic_local_model.dataset._signals import blocks

__all__ = ["CONTACT_PART", "Clock", "ContactNumbers", "Demonstration", "EpisodeFiles", "Field", "Frames", "FORMATS", "Stream", "Timing", "again", "check",
           "convert", "demonstrations", "find_episodes", "frames"]

#: Formats, and whether each is one file.
FORMATS = {"lerobot": False, "hdf5": True, "mcap": True}


@dataclasses.dataclass
class _Recorded:
    """What a set is made of. unread: a line of each episode that cannot be read; refused: of each that cannot be used, by path. timings:
    of episodes, by path, where they are known from another replay."""
    recordings: Sequence[str | os.PathLike[str]]
    episodes: Sequence[EpisodeFiles]
    options: Sequence[str]
    unread: list[str]
    refused: dict[pathlib.Path, str] = dataclasses.field(default_factory=dict)
    timings: Mapping[pathlib.Path, Timing] = dataclasses.field(default_factory=dict)

    @property
    def left_out(self) -> list[str]:
        return [*self.unread, *self.refused.values()]


def demonstrations(recordings: Sequence[str | os.PathLike[str]], episodes: Iterable[EpisodeFiles], fps: float = 30,
                   options: Sequence[str] = ()) -> Iterator[Demonstration]:
    """Each episode with what the recordings say of it; where there are no episodes, each session. options: the server's. Raises
    HapticError that names what cannot be used, or an episode of which no recording knows."""
    recorded = _Recorded(recordings, list(episodes), options, [])
    yield from _demonstrations(recorded, fps, None)
    if recorded.left_out:
        raise HapticError(recorded.left_out[0])


def _demonstrations(recorded: _Recorded, fps: float, changes: Sequence[str] | None) -> Iterator[Demonstration]:
    """changes: of haptic_replay's options; None: the recordings must come back bit for bit."""
    waiting = {each.path: each for each in recorded.episodes}
    for recording in recorded.recordings:
        played = blocks(recording, recorded.options, changes)
        if not recorded.episodes:
            yield from whole_sessions(played, fps)
            continue
        for found in cut(played, waiting.values(), fps, recorded.timings, recorded.refused):
            assert found.episode
            del waiting[found.episode.path]
            yield found
    why = "no recording knows it: give the one of its server" if changes is None else f"it has no tick with {' '.join(changes)}"
    for path in waiting:
        recorded.refused.setdefault(path, f"episode {path}: {why}")


def frames(found: Iterable[Demonstration], fps: float = 30, contacts: int = 8, numbers: ContactNumbers | None = None) -> Iterator[Frames]:
    """fps: frames in a second, that of `found`. contacts: of how many each frame tells, those of the largest force. numbers: of contacts,
    which several sets may share."""
    numbers = numbers or ContactNumbers()
    for each in found:
        yield frames_of(each, fps, contacts, numbers)


def convert(recordings: Sequence[str | os.PathLike[str]], places: Sequence[str | os.PathLike[str]], form: str,
            out: str | os.PathLike[str], fps: float = 30, contacts: int = 8, options: Sequence[str] = (),
            state: Sequence[str] = ()) -> dict[str, Any]:
    """Makes a data set of the recordings and of the episodes in the folders `places`, in one of FORMATS, at `out`, which must not be
    there. state: what else of "force", "impulse", … and the logged streams LeRobot's observation.state has. Returns what haptic.json in
    it, or beside it, says; "left_out" there has a line of each episode that could not be used. Raises HapticError; then there is nothing
    at `out`."""
    target, is_file = _target(out, form), FORMATS[form]
    recorded = _recorded(recordings, places, options)
    with _making(target) as folder:
        about = _write(recorded, form, folder / target.name, _given(form, fps, contacts, state), {})
        (folder / target.name).rename(target)
        if is_file:
            description_of(folder / target.name, is_file).rename(description_of(target, is_file))
    return about


def again(recordings: Sequence[str | os.PathLike[str]], places: Sequence[str | os.PathLike[str]], form: str,
          out: str | os.PathLike[str], changes: Mapping[str, Sequence[str]], fps: float = 30, contacts: int = 8,
          options: Sequence[str] = (), state: Sequence[str] = ()) -> list[pathlib.Path]:
    """The same hands in other worlds: for each combination of the values a data set of its own in the folder `out`, which must not be
    there, named by them. changes: values by name: "delay", s, by which everything from the simulator comes later, "friction", or an
    option of the server's contacts or controller, as "stiffness", N/m. The hand, its motion and what is known of its force, is as it was
    recorded, and so is the simulated world; a frame of one set is the same moment in all."""
    target, given = _target(out, ""), _given(form, fps, contacts, state)
    recorded = _recorded(recordings, places, options)
    if not recorded.episodes:
        raise HapticError("--again needs episodes: each of its sets has the same ones")
    found = [(each.episode, each.timing) for each in _demonstrations(recorded, fps, None) if each.episode]
    recorded.episodes = [episode for episode, _ in found]
    recorded.timings = {episode.path: timing for episode, timing in found}
    ending, made = f".{form}" if FORMATS[form] else "", []
    with _making(target) as folder:
        (folder / target.name).mkdir()
        for changed in combinations(changes):
            made.append(",".join(f"{name}={value}" for name, value in changed.items()) + ending)
            _write(dataclasses.replace(recorded, refused=dict(recorded.refused)), form, folder / target.name / made[-1], given, changed)
        (folder / target.name).rename(target)
    return [target / name for name in made]


def _given(form: str, fps: float, contacts: int, state: Sequence[str]) -> dict[str, Any]:
    _arguments.choice(form, FORMATS, "format")
    if state and form != "lerobot":
        raise HapticError(f"--state {','.join(state)} must be of --to lerobot, not {form}")
    return {"fps": _arguments.number(fps, "fps", 1, 1000, "Hz"), "contacts": _arguments.integer(contacts, "contacts", 1, 64),
            "state": list(state)}


def _target(out: str | os.PathLike[str], form: str) -> pathlib.Path:
    """form: "": a folder of sets."""
    target = pathlib.Path(out).absolute()
    if form:
        _arguments.choice(form, FORMATS, "format")
    try:
        for place in (target, description_of(target, is_file=True)) if form and FORMATS[form] else (target,):
            if place.exists():
                raise HapticError(f"--out {place} must not be there yet")
    except OSError as error:
        raise HapticError(f"--out {target} cannot be written: {error}") from None
    return target


@contextlib.contextmanager
def _making(target: pathlib.Path) -> Iterator[pathlib.Path]:
    """A folder beside what is made in it, which goes with what is left in it."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=".haptic_dataset_") as folder:
            yield pathlib.Path(folder)
    except OSError as error:
        raise HapticError(f"--out {target} cannot be written: {error}") from None


def _recorded(recordings: Sequence[str | os.PathLike[str]], places: Sequence[str | os.PathLike[str]], options: Sequence[str]) -> _Recorded:
    episodes, complaints = find_episodes(places)
    if places and not episodes:
        raise HapticError(complaints[0] if complaints else f"there are no episodes in {', '.join(os.fspath(place) for place in places)}")
    return _Recorded(list(dict.fromkeys(recordings)), episodes, options, complaints)


def _write(recorded: _Recorded, form: str, place: pathlib.Path, given: Mapping[str, Any], changed: Mapping[str, str]) -> dict[str, Any]:
    """At that place, in that format. Returns its description, which it wrote."""
    found = _demonstrations(recorded, given["fps"], arguments_of(changed) if changed else None)
    first = next(found, None)
    if first is None:
        raise HapticError((recorded.left_out or ["no session of the recordings had an update"])[0])
    numbers = ContactNumbers()
    episodes: list[dict[str, Any]] = []
    fields = describe(first.period, given["fps"], given["contacts"])
    about = {"library": f"haptic-local-model {haptic.__version__}", "recordings": [os.fspath(each) for each in recorded.recordings],
             "options": list(recorded.options), "again": dict(changed), "fps": given["fps"], "rate": 1 / first.period,
             "state": given["state"]}
    made = frames(_of_one_rate(itertools.chain([first], found)), given["fps"], given["contacts"], numbers)
    writer = importlib.import_module(f"haptic_local_model.dataset._{form}")
    try:
        writer.write(_counted(made, episodes), place, fields, about)
    except (HapticError, OSError):
        raise
    except Exception as error:  # A format's own library has its own.
        raise HapticError(f"--to {form} is not possible with these episodes: {' '.join(str(error).split())}") from None
    about |= {"fields": {name: dataclasses.asdict(field) for name, field in fields.items()}, "episodes": episodes,
              "contacts": numbers.described(), "left_out": recorded.left_out}
    description_of(place, FORMATS[form]).write_text(json.dumps(about, indent=1), encoding="utf-8")
    return about


def _of_one_rate(found: Iterable[Demonstration]) -> Iterator[Demonstration]:
    period = None
    for each in found:
        period = period or each.period
        if each.period != period:
            raise HapticError(f"recordings must have one rate, not {1 / period:g} and {1 / each.period:g} Hz")
        yield each


def _counted(made: Iterable[Frames], episodes: list[dict[str, Any]]) -> Iterator[Frames]:
    for each in made:
        timing, episode = each.demonstration.timing, each.demonstration.episode
        force = each.columns["observation.force"][:, 0]
        episodes.append({"episode": episode.path.name if episode else "", "task": episode.task if episode else "",
                         "outcome": episode.outcome if episode else "unmarked", "about": episode.about if episode else {},
                         "frames": each.count, "seconds": timing.end - timing.begin, "clock_error": timing.clock.error if episode else None,
                         "has_age": timing.clock.has_age,
                         "frames_with_more_contacts": each.left_out, "frames_without_force": int((force != force).sum()),
                         "farthest": each.farthest})
        yield each
