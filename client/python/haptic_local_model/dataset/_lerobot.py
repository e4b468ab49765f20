"""LeRobot's data set, written by LeRobot's own writer."""

from __future__ import annotations

import pathlib
from typing import Any, Iterable, Mapping

import numpy as np

from haptic_local_model import HapticError
from haptic_local_model.dataset._frames import Field, Frames
from haptic_local_model.dataset._optional import require

_VERSION = "v3.0"
_AXES = ("x", "y", "z")
_NAMES = {"observation.state": [*_AXES, "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz", "gripper"],
          "action": [*_AXES, "qw", "qx", "qy", "qz", "gripper"]}
_WRENCH = ["fx", "fy", "fz", "tx", "ty", "tz"]


def write(frames: Iterable[Frames], path: pathlib.Path, fields: Mapping[str, Field], about: dict[str, Any]) -> None:
    """Raises HapticError where LeRobot writes another version, or an episode's streams have other shapes than the first one's."""
    datasets = require("lerobot.datasets.lerobot_dataset", "lerobot")
    if datasets.CODEBASE_VERSION != _VERSION:
        raise HapticError(f"--to lerobot needs a LeRobot that writes {_VERSION}, and this one writes {datasets.CODEBASE_VERSION}")
    if about["fps"] != round(about["fps"]):
        raise HapticError(f"--fps {about['fps']:g} must be whole with --to lerobot")
    made, features = None, {}
    try:
        for each in frames:
            _join_state(each, about["state"], fields)
            own = _features(each, fields)
            if made is None:
                features = own
                made = datasets.LeRobotDataset.create(repo_id=path.name, root=path, fps=round(each.fps), features=features,
                                                      robot_type="haptic", use_videos=False)
            if own != features:
                raise HapticError(_difference(each, own, features))
            _write_episode(made, each, features)
    finally:
        if made is not None:
            made.finalize()  # Left alone it writes when it is collected, wherever the folder is by then.


def _join_state(frames: Frames, names: Iterable[str], fields: Mapping[str, Field]) -> None:
    """Puts these columns behind observation.state, flat: of what is observed LeRobot's policies and its viewer take that and images."""
    parts = [frames.columns["observation.state"]]
    for name in names:
        if f"observation.{name}" not in frames.columns:
            known = ", ".join(sorted(column.partition(".")[2] for column in frames.columns if column.startswith("observation.")))
            raise HapticError(f"--state {name} must be one of {known}")
        parts.append(frames.columns[f"observation.{name}"].reshape(frames.count, -1).astype(np.float32))
    joined = frames.columns["observation.state"] = np.concatenate(parts, axis=1)
    fields["observation.state"].shape = joined.shape[1:]


def _features(frames: Frames, fields: Mapping[str, Field]) -> dict[str, dict[str, Any]]:
    features: dict[str, dict[str, Any]] = {}
    for name, column in frames.columns.items():
        shape = column.shape[1:] or (1,)
        if name in fields:
            names = _NAMES.get(name) or (_WRENCH if shape == (6,) else None)
            names = names if names is None or len(names) == shape[0] else None
            features[name] = {"dtype": fields[name].dtype, "shape": shape, "names": names}
        elif "image" in name and not _is_image(column):
            raise HapticError(f"--to lerobot takes {name} for a picture: log it by a name without 'image'")
        elif _is_image(column):
            features[name.replace("observation.", "observation.images.")] = {
                "dtype": "image", "shape": shape, "names": ["height", "width", "channels"]}
        else:
            dtype = {"f": "float32", "b": "bool"}.get(column.dtype.kind, "int64")
            features[name] = {"dtype": dtype, "shape": shape, "names": None}
    features["next.done"] = features["next.success"] = {"dtype": "bool", "shape": (1,), "names": None}
    return features


def _is_image(column: np.ndarray) -> bool:
    return column.dtype == np.uint8 and column.ndim == 4 and column.shape[3] == 3


def _difference(frames: Frames, own: dict[str, Any], first: dict[str, Any]) -> str:
    episode = frames.demonstration.episode
    name = min(name for name in {*own, *first} if own.get(name) != first.get(name))
    return (f"{episode.path if episode else 'a session'}: {name} is {_shape_of(own, name)}, and {_shape_of(first, name)} "
            "in the first episode")


def _shape_of(features: dict[str, Any], name: str) -> str:
    return f"{features[name]['dtype']} {features[name]['shape']}" if name in features else "not there"


def _write_episode(made: Any, frames: Frames, features: Mapping[str, dict[str, Any]]) -> None:
    episode = frames.demonstration.episode
    succeeded = episode is not None and episode.outcome == "success"
    for i in range(frames.count):
        is_last = np.array([i == frames.count - 1])
        row: dict[str, Any] = {"next.done": is_last, "next.success": is_last & succeeded,
                               "task": (episode.task if episode else "") or "no task"}
        for name, column in frames.columns.items():
            named = name if name in features else name.replace("observation.", "observation.images.")
            value = np.atleast_1d(column[i])
            row[named] = value if features[named]["dtype"] == "image" else value.astype(features[named]["dtype"])
        made.add_frame(row)
    made.save_episode()
