"""Demonstrations with the forces in them: data sets of what the hand felt, contact by contact, in every tick.

    haptic_server --record run.pcap                                 # on the machine with the device
    with touch.episode("insert the peg"): ...                       # in the simulator, each attempt; touch.log(qpos=…, image=…)
    python3 -m haptic_local_model.dataset run.pcap demonstrations --to lerobot --fps 30 --out insert

A recording is played again, bit for bit, on the server's own tick: the contacts' forces in it are what the hand felt, and with
--again they are what it would have felt with another stiffness, or later news of the world. docs/dataset.md has every field.
"""

from __future__ import annotations

import dataclasses
import importlib
import itertools
import os
import pathlib
import shutil
from typing import Any, Iterable, Iterator, Mapping, Sequence

import haptic_local_model as haptic
from haptic_local_model import HapticError, _arguments
from haptic_local_model.dataset._demonstration import Demonstration, Timing, cut, whole_sessions
from haptic_local_model.dataset._episode_files import EpisodeFiles, find_episodes
from haptic_local_model.dataset._frames import Field, Frames, PairNumbers, describe, frames_of, window_length
from haptic_local_model.dataset._report import check, describe_set
from haptic_local_model.dataset._signals import blocks

__all__ = ["Demonstration", "EpisodeFiles", "Field", "Frames", "FORMATS", "Timing", "again", "check", "convert", "demonstrations", "frames"]

#: Formats, and whether each is one file.
FORMATS = {"lerobot": False, "hdf5": True, "mcap": True}
_DELAY = "delay"  # among --again's names: haptic_replay's --late


def demonstrations(recordings: Sequence[str | os.PathLike[str]], episodes: Iterable[EpisodeFiles], fps: float = 30,
                   options: Sequence[str] = (), timings: Mapping[pathlib.Path, Timing] | None = None) -> Iterator[Demonstration]:
    """Each episode with what the recordings say of it; where there are no episodes, each session. options: the server's. The recording
    must come back bit for bit, but where timings say, by the episode's path, when they were. Raises HapticError that names what cannot
    be used, or an episode of which no recording knows."""
    waiting = {each.path: each for each in episodes}
    has_episodes = bool(waiting)
    for recording in recordings:
        played = blocks(recording, options, compares=timings is None)
        if not has_episodes:
            yield from whole_sessions(played, fps)
            continue
        for found in cut(played, waiting.values(), fps, timings or {}):
            assert found.episode
            del waiting[found.episode.path]
            yield found
    if waiting:
        raise HapticError(f"no recording knows the episode {next(iter(waiting))}: give the one of its server")


def frames(found: Iterable[Demonstration], fps: float = 30, contacts: int = 8, pairs: PairNumbers | None = None) -> Iterator[Frames]:
    """fps: frames in a second. contacts: of how many each frame tells, those of the largest force."""
    pairs = pairs or PairNumbers()
    for each in found:
        yield frames_of(each, rate_of(each), fps, contacts, pairs)


def rate_of(found: Demonstration) -> float:
    """Of the server, Hz."""
    return float(round(1 / float(found.dt.min())))


def convert(recordings: Sequence[str | os.PathLike[str]], places: Sequence[str | os.PathLike[str]], form: str,
            out: str | os.PathLike[str], fps: float = 30, contacts: int = 8, options: Sequence[str] = (), state: Sequence[str] = (),
            changed: Mapping[str, str] | None = None, timings: Mapping[pathlib.Path, Timing] | None = None) -> dict[str, Any]:
    """Makes a data set of the recordings and of the episodes in the folders `places`, in one of FORMATS, at `out`, which must not be
    there. state: what else of "force", "impulse", … and the logged streams LeRobot's observation.state has. changed: by again(), what is otherwise than recorded; timings: as demonstrations() takes them. Returns what haptic.json beside it, or in it, says.
    Raises HapticError; then there is nothing at `out`."""
    _arguments.choice(form, FORMATS, "format")
    fps, contacts = _arguments.number(fps, "fps", 1, 1000, "Hz"), _arguments.integer(contacts, "contacts", 1, 64)
    target = pathlib.Path(out)
    if target.exists():
        raise HapticError(f"--out {target} must not be there yet")
    episodes, complaints = find_episodes(places)
    if places and not episodes:
        raise HapticError(complaints[0] if complaints else f"there are no episodes in {_listed(places)}")
    about: dict[str, Any] = {"library": f"haptic-local-model {haptic.__version__}", "recordings": [os.fspath(each) for each in recordings],
                             "options": list(options), "again": dict(changed or {}), "hand": "its motion, and its force where the device measures or estimates that, as recorded", "fps": fps, "state": list(state),
                             "left_out": complaints}
    partial = target.with_name(target.name + ".part")
    _remove(partial)
    pairs = PairNumbers()
    found = demonstrations(recordings, episodes, fps, [*options, *_arguments_of(changed or {})], timings)
    first = next(found, None)
    if first is None:
        raise HapticError(f"no session of {_listed(recordings)} had an update")
    fields = describe(rate_of(first), fps, contacts)
    about |= {"rate": rate_of(first), "fields": {name: dataclasses.asdict(field) for name, field in fields.items()}}
    numbers: list[dict[str, Any]] = []
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        writer = importlib.import_module(f"haptic_local_model.dataset._{form}")
        writer.write(_counted(frames(itertools.chain([first], found), fps, contacts, pairs), numbers), partial, fields, about)
        about |= {"episodes": numbers, "contacts": [_named(pair, numbers) for pair in pairs.pairs.values()]}
        describe_set(about, partial, is_file=FORMATS[form])
        partial.rename(target)
    except OSError as error:
        raise HapticError(f"--out {target} cannot be written: {error}") from None
    finally:
        _remove(partial)
    return about


def again(recordings: Sequence[str | os.PathLike[str]], places: Sequence[str | os.PathLike[str]], form: str,
          out: str | os.PathLike[str], changes: Mapping[str, Sequence[str]], **options: Any) -> list[pathlib.Path]:
    """The same hands in other worlds: for each combination of the values a data set of its own in the folder `out`, named by them.
    changes: values by name: "delay", s, by which everything from the simulator comes later, or an option of the server's local model or
    controller, as "stiffness", N/m. The hand, its motion and what is known of its force, is as it was recorded, and so is the simulated
    world; a frame of one set is the same moment in all."""
    for name in changes:
        if name != _DELAY and not name.replace("-", "").isalnum():
            raise HapticError(f"--again {name} must be delay, or an option of haptic_server")
    episodes, _ = find_episodes(places)
    if not episodes:
        raise HapticError("--again needs episodes: each of its sets has the same ones")
    timings = {each.episode.path: each.timing for each in demonstrations(recordings, episodes, options.get("fps", 30), options.get("options", ()))
               if each.episode}
    made = []
    for values in itertools.product(*changes.values()):
        changed = dict(zip(changes, values))
        place = pathlib.Path(out) / (",".join(f"{name}={value}" for name, value in changed.items()) + _ending(form))
        convert(recordings, places, form, place, changed=changed, timings=timings, **options)
        made.append(place)
    return made


def _listed(places: Sequence[str | os.PathLike[str]]) -> str:
    return ", ".join(os.fspath(place) for place in places)


def _ending(form: str) -> str:
    return f".{form}" if FORMATS[_arguments.choice(form, FORMATS, "format")] else ""


def _arguments_of(changed: Mapping[str, str]) -> list[str]:
    """Of haptic_replay."""
    return [part for name, value in changed.items() for part in ("--late" if name == _DELAY else f"--{name}", value)]


def _counted(made: Iterable[Frames], numbers: list[dict[str, Any]]) -> Iterator[Frames]:
    for each in made:
        d, episode = each.demonstration, each.demonstration.episode
        numbers.append({"episode": episode.path.name if episode else "", "task": episode.task if episode else "",
                        "outcome": episode.outcome if episode else "unmarked", "frames": each.count, "seconds": d.timing.end - d.timing.begin,
                        "clock_error": d.timing.clock_error, "frames_with_more_contacts": each.left_out,
                        "about": episode.about if episode else {}})
        yield each


def _named(pair: Mapping[str, int], episodes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """A pair in contact, with the names of its sides, as far as an episode tells them."""
    names: dict[str, str] = next((each["about"]["bodies"] for each in episodes if "bodies" in each["about"]), {})

    def name(side: str) -> str:
        kind, number = pair[f"{side}_kind"], pair[side]
        if kind == haptic.MOVABLE_BODY:
            return str(names.get(str(number), f"body {number}"))
        return "world" if kind == haptic.WORLD else f"tool's link {number}"

    return {**pair, "a_name": name("a"), "b_name": name("b")}


def _remove(partial: pathlib.Path) -> None:
    if partial.is_dir():
        shutil.rmtree(partial)
    elif partial.exists():
        partial.unlink()
