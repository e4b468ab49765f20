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

_NAME = "haptic.json"


def describe_set(about: dict[str, Any], made: pathlib.Path, is_file: bool) -> None:
    """Into the folder that was made, or beside the file that becomes NAME.hdf5 as NAME.hdf5.json."""
    place = made.with_name(made.name.removesuffix(".part") + ".json") if is_file else made / _NAME
    made.mkdir(exist_ok=True) if not is_file else None
    place.write_text(json.dumps(about, indent=1), encoding="utf-8")


def check(place: str | os.PathLike[str]) -> list[str]:
    """Lines on what a data set that convert() has made contains, its clocks and units, and what is missing. Raises HapticError where it
    is none."""
    path = pathlib.Path(place)
    described = path / _NAME if path.is_dir() else path.with_name(path.name + ".json")
    try:
        about = json.loads(described.read_text(encoding="utf-8"))
        episodes, fields = about["episodes"], about["fields"]
    except (OSError, ValueError, KeyError) as error:
        raise HapticError(f"{path} must be a data set of haptic.dataset: {described.name} cannot be read ({error})") from None
    lines = [f"{path}: {len(episodes)} episodes, {sum(each['frames'] for each in episodes)} frames at {about['fps']:g} Hz, "
             f"{sum(each['seconds'] for each in episodes):.1f} s; ticks at {about['rate']:g} Hz; {len(about['contacts'])} pairs in contact"]
    lines += _marks_and_clocks(about)
    lines += [f"field {name} {tuple(field['shape'])} {field['dtype']}, {field['unit'] or 'number'}: {field['meaning']}"
              for name, field in fields.items()]
    lines += [f"left out: {complaint}" for complaint in about["left_out"]]
    if many := sum(each["frames_with_more_contacts"] for each in episodes):
        lines.append(f"missing: {many} frames have more contacts than fields: give a larger --contacts")
    return lines + _look_inside(path, len(episodes))


def _marks_and_clocks(about: dict[str, Any]) -> list[str]:
    changes = ", ".join(f"{name} {value}" for name, value in about["again"].items())
    outcomes = collections.Counter(each["outcome"] for each in about["episodes"])
    worst = max((each["clock_error"] for each in about["episodes"]), default=0)
    return ([f"not as recorded: {changes}; the hand and the simulated world are as recorded"] if changes else []) + [
        "outcomes: " + ", ".join(f"{count} {outcome}" for outcome, count in sorted(outcomes.items())),
        f"clocks: the simulator's is known against the server's within {1e3 * worst:.2f} ms"]


def _look_inside(path: pathlib.Path, episodes: int) -> list[str]:
    """Against what is described; only of formats whose reader is small."""
    if path.suffix != ".hdf5":
        return []
    h5py = require("h5py", "hdf5")
    try:
        with h5py.File(path, "r") as file:
            held = len(file["data"])
            unknown = sum(int(np.isnan(demo["obs/force"][:, 0]).sum()) for demo in file["data"].values())
    except (OSError, KeyError) as error:
        raise HapticError(f"{path} is no whole data set: {error}") from None
    if held != episodes:
        raise HapticError(f"{path} has {held} episodes, and {path.name}.json {episodes}")
    return [f"missing: {unknown} frames without a force (NaN): the server had no tick then"] if unknown else []
