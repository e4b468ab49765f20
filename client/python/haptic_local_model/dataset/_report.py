"""What a data set says of itself, and what it has when one looks."""

from __future__ import annotations

import collections
import json
import os
import pathlib
from typing import Any

import numpy as np

from haptic_local_model import HapticError
from haptic_local_model.dataset._optional import require

NAME = "haptic.json"  # in a set that is a folder; of one that is a file it is beside it


def description_of(place: pathlib.Path, is_file: bool) -> pathlib.Path:
    """Where a set at that place is described."""
    return place.with_name(place.name + ".json") if is_file else place / NAME


def check(place: str | os.PathLike[str]) -> list[str]:
    """Lines on what a data set that convert() has made contains, its clocks and units, and what is missing. Raises HapticError where it
    is none."""
    path = pathlib.Path(place)
    described = description_of(path, is_file=not path.is_dir())
    try:
        about = json.loads(described.read_text(encoding="utf-8"))
        lines = [_summary(path, about), *_marks_and_clocks(about), *_fields(about), *_missing(about)]
        count = len(about["episodes"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise HapticError(f"{path} must be a data set of haptic.dataset: {described.name} cannot be used ({error})") from None
    try:
        held = {"hdf5": _look_into_hdf5, "mcap": _look_into_mcap}.get(path.suffix[1:], _look_into_lerobot)(path)
    except HapticError:
        raise
    except Exception as error:  # Each reader has its own.
        raise HapticError(f"{path} is no whole data set: {error}") from None
    if held != count:
        raise HapticError(f"{path} has {held} episodes, and {described.name} {count}")
    return lines


def _summary(path: pathlib.Path, about: dict[str, Any]) -> str:
    episodes = about["episodes"]
    return (f"{path}: {len(episodes)} episodes, {sum(each['frames'] for each in episodes)} frames at {about['fps']:g} Hz, "
            f"{sum(each['seconds'] for each in episodes):.1f} s; ticks at {about['rate']:g} Hz; {len(about['contacts'])} contacts")


def _marks_and_clocks(about: dict[str, Any]) -> list[str]:
    changes = ", ".join(f"{name} {value}" for name, value in about["again"].items())
    outcomes = collections.Counter(each["outcome"] for each in about["episodes"])
    lines = [f"not as recorded: {changes}; the hand and the simulated world are as recorded"] if changes else []
    lines.append("outcomes: " + ", ".join(f"{count} {outcome}" for outcome, count in sorted(outcomes.items())))
    errors = [each["clock_error"] for each in about["episodes"] if each["clock_error"] is not None]
    if errors:
        lines.append(f"clocks: single updates are {1e3 * max(errors):.2f} ms from what is taken for the simulator's against the server's")
    if ageless := sum(not each["has_age"] for each in about["episodes"] if each["clock_error"] is not None):
        lines.append(f"clocks: in {ageless} episodes the server attributed no age to updates: without a network's delay that is right, "
                     "otherwise they are off by it")
    return lines


def _fields(about: dict[str, Any]) -> list[str]:
    farthest: dict[str, float] = {}
    for each in about["episodes"]:
        for name, seconds in each["farthest"].items():
            farthest[name] = max(farthest.get(name, 0.0), seconds)
    return [f"field {name} {tuple(field['shape'])} {field['dtype']}, {field['unit'] or 'number'}: {field['meaning']}"
            for name, field in about["fields"].items()] + [
        f"stream {name}: a frame's row is up to {1e3 * seconds:.1f} ms from its end" for name, seconds in farthest.items()]


def _missing(about: dict[str, Any]) -> list[str]:
    lines = [f"left out: {complaint}" for complaint in about["left_out"]]
    if many := sum(each["frames_with_more_contacts"] for each in about["episodes"]):
        lines.append(f"missing: {many} frames have more contacts than fields: give a larger --contacts")
    if unknown := sum(each["frames_without_force"] for each in about["episodes"]):
        lines.append(f"missing: {unknown} frames have no force (NaN): the server had no tick then")
    return lines


def _look_into_hdf5(path: pathlib.Path) -> int:
    with require("h5py", "hdf5").File(path, "r") as file:
        return len([np.asarray(demo["obs/force"][-1]) for demo in file["data"].values()])


def _look_into_mcap(path: pathlib.Path) -> int:
    with open(path, "rb") as file:
        summary = require("mcap.reader", "mcap").make_reader(file).get_summary()
        marks = [number for number, channel in summary.channels.items() if channel.topic == "/episode"]
        return summary.statistics.channel_message_counts[marks[0]] // 2


def _look_into_lerobot(path: pathlib.Path) -> int:
    info = json.loads((path / "meta/info.json").read_text(encoding="utf-8"))
    if not list(path.glob("data/*/*.parquet")):
        raise HapticError(f"{path} is no whole data set: it has no data")
    return info["total_episodes"]
