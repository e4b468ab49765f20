"""HDF5 in the layout that robomimic reads, with every stream at its own rate beside the frames."""

from __future__ import annotations

import json
import pathlib
from typing import Any, Iterable, Mapping

import numpy as np

from haptic_local_model.dataset._frames import Field, Frames
from haptic_local_model.dataset._optional import require

_COMPRESSED = {"compression": "gzip", "compression_opts": 1, "shuffle": True}


def write(frames: Iterable[Frames], path: pathlib.Path, fields: Mapping[str, Field], about: dict[str, Any]) -> None:
    """data/demo_I/{obs, actions, contact}: frames; streams/demo_I/NAME/{value, time}: each at its own rate, s from the beginning
    of the episode on, ticks among them."""
    h5py = require("h5py", "hdf5")
    with h5py.File(path, "x") as file:
        data, streams, total = file.create_group("data"), file.create_group("streams"), 0
        for number, each in enumerate(frames):
            _write_frames(data.create_group(f"demo_{number}"), each, fields)
            _write_streams(streams.create_group(f"demo_{number}"), each)
            total += each.count
        data.attrs["total"] = total
        data.attrs["env_args"] = json.dumps({"env_name": "haptic", "type": 1, "env_kwargs": {}})
        file.attrs["haptic"] = json.dumps(about)


def _write_frames(group: Any, frames: Frames, fields: Mapping[str, Field]) -> None:
    group.attrs["num_samples"] = frames.count
    for name, value in _marks(frames).items():
        group.attrs[name] = value
    group.create_dataset("actions", data=frames.columns["action"])
    last = np.arange(frames.count) == frames.count - 1
    group.create_dataset("dones", data=last.astype(np.int64))
    group.create_dataset("rewards", data=(last & (group.attrs["outcome"] == "success")).astype(np.float32))
    for name, column in frames.columns.items():
        kind, _, short = name.partition(".")
        if kind in ("observation", "contact"):
            made = group.create_dataset(f"{'obs' if kind == 'observation' else kind}/{short}",
                                        data=column if column.ndim > 1 else column[:, None], **_COMPRESSED)
            if name in fields:
                made.attrs["unit"], made.attrs["meaning"] = fields[name].unit, fields[name].meaning


def _marks(frames: Frames) -> dict[str, Any]:
    episode = frames.demonstration.episode
    if episode is None:
        return {"task": "", "outcome": "unmarked", "about": "{}", "episode": ""}
    return {"task": episode.task, "outcome": episode.outcome, "about": json.dumps(episode.about), "episode": episode.path.name}


def _write_streams(group: Any, frames: Frames) -> None:
    d = frames.demonstration

    def stream(name: str, times: np.ndarray, value: np.ndarray) -> None:
        made = group.create_group(name)
        made.create_dataset("time", data=times - d.timing.begin, **_COMPRESSED)
        made.create_dataset("value", data=value, **_COMPRESSED)

    for name, value in d.signals.items():
        stream("tick_" + name, d.time, value.astype(np.float32))
    for name, logged in (d.episode.streams.items() if d.episode else ()):
        stream(name, d.timing.clock.to_server(logged.times), np.asarray(logged.rows))
