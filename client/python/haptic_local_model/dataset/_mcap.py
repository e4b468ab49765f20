"""MCAP, as Foxglove and Rerun show it: poses as transforms, contacts as arrows, the wrench in every tick."""

from __future__ import annotations

import base64
import json
import pathlib
from typing import Any, Iterable, Mapping

import numpy as np

from haptic_local_model.dataset._frames import Field, Frames
from haptic_local_model.dataset._optional import require

_TIME = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_XYZ = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyz"}}
_WRENCH = {"type": "object", "description": "on the hand, world axes, N and N m",
           "properties": {"step": {"type": "integer"}, "force": _XYZ, "torque": _XYZ}}
_CONTACTS = {"type": "object", "properties": {"timestamp": _TIME, "contacts": {"type": "array", "items": {
    "type": "object", "properties": {"id": {"type": "integer"}, "force": _XYZ, "point": _XYZ, "normal": _XYZ}}}}}
_MARK = {"type": "object", "properties": {"task": {"type": "string"}, "outcome": {"type": "string"}, "mark": {"type": "string"}}}
_ROW = {"type": "object", "properties": {"value": {"type": "array"}}}
_IMAGE = {"type": "object", "properties": {"data": {"type": "string", "contentEncoding": "base64"}}}
_ARROW = 0.02  # m for each N
_PAUSE = 1.0   # s between episodes
_JSON = json.JSONEncoder(allow_nan=False, separators=(",", ":"))


class _Topics:
    """Messages as JSON, on topics that are there once something is said on them."""

    def __init__(self, writer: Any):
        self._writer, self._channels, self._schemas = writer, {}, {}  # type: ignore[var-annotated]

    def say(self, topic: str, schema: str, described: Mapping[str, Any], seconds: float, message: Mapping[str, Any]) -> None:
        if topic not in self._channels:
            if schema not in self._schemas:
                self._schemas[schema] = self._writer.register_schema(name=schema, encoding="jsonschema",
                                                                     data=json.dumps({"title": schema, **described}).encode())
            self._channels[topic] = self._writer.register_channel(topic=topic, message_encoding="json", schema_id=self._schemas[schema])
        nanoseconds = round(1e9 * seconds)
        self._writer.add_message(channel_id=self._channels[topic], log_time=nanoseconds, publish_time=nanoseconds,
                                 data=_JSON.encode(message).encode())


def write(frames: Iterable[Frames], path: pathlib.Path, fields: Mapping[str, Field], about: dict[str, Any]) -> None:
    """The episodes one after another, each from the wall clock's time at which it began, or where that is in the one before a second
    after it. fields: not used."""
    del fields
    writing = require("mcap.writer", "mcap")
    with open(path, "xb") as file:
        writer = writing.Writer(file)
        writer.start(profile="", library="haptic-local-model")
        writer.add_metadata("haptic", {key: value if isinstance(value, str) else json.dumps(value) for key, value in about.items()})
        topics, free_from = _Topics(writer), _PAUSE
        for each in frames:
            free_from = _write_episode(topics, each, free_from)
        writer.finish()


def _write_episode(topics: _Topics, frames: Frames, free_from: float) -> float:
    d, timing = frames.demonstration, frames.demonstration.timing
    length = timing.end - timing.begin
    start = max((d.episode.wall_clock if d.episode else 0.0) - length, free_from)
    marks = {"task": d.episode.task if d.episode else "", "outcome": d.episode.outcome if d.episode else "unmarked"}
    topics.say("/episode", "haptic.Mark", _MARK, start, {**marks, "mark": "begin"})
    for time, step, force in zip((d.time - timing.begin + start).tolist(), d.step.tolist(), d.signals["force"].tolist()):
        topics.say("/hand/wrench", "haptic.Wrench", _WRENCH, time, {"step": step, "force": _xyz(force[:3]), "torque": _xyz(force[3:])})
    arrows = _arrows(frames)
    for i in range(frames.count):
        _write_frame(topics, frames, arrows[i], i, start + i / frames.fps)
    for name, logged in (d.episode.streams.items() if d.episode else ()):
        for row, time in zip(logged.rows, (timing.clock.to_server(logged.times) - timing.begin + start).tolist()):
            _write_row(topics, name, np.asarray(row), time)
    topics.say("/episode", "haptic.Mark", _MARK, start + length, {**marks, "mark": "end"})
    return start + length + _PAUSE


def _write_frame(topics: _Topics, frames: Frames, arrows: list[dict[str, Any]], i: int, seconds: float) -> None:
    stamp = _stamp(seconds)
    for child, name in (("proxy", "observation.state"), ("handle", "action")):
        pose = frames.columns[name][i, :7].tolist()
        if np.isfinite(pose).all():
            topics.say("/tf", "foxglove.FrameTransform", {"type": "object"}, seconds, {
                "timestamp": stamp, "parent_frame_id": "world", "child_frame_id": child, "translation": _xyz(pose[:3]),
                "rotation": dict(zip("wxyz", pose[3:]))})
    known = frames.columns["contact.id"][i] >= 0
    columns = [frames.columns["contact." + name][i][known].tolist() for name in ("id", "force", "point", "normal")]
    contacts = [{"id": each, "force": _xyz(force), "point": _xyz(point), "normal": _xyz(normal)}
                for each, force, point, normal in zip(*columns)]
    topics.say("/contacts", "haptic.Contacts", _CONTACTS, seconds, {"timestamp": stamp, "contacts": contacts})
    topics.say("/contacts/arrows", "foxglove.SceneUpdate", {"type": "object"}, seconds, {"deletions": [], "entities": [{
        "timestamp": stamp, "frame_id": "world", "id": "contacts", "lifetime": {"sec": 0, "nsec": round(1.5e9 / frames.fps)},
        "frame_locked": False, "metadata": [], "arrows": arrows, "cubes": [], "spheres": [], "cylinders": [], "lines": [],
        "triangles": [], "texts": [], "models": []}]})


def _write_row(topics: _Topics, name: str, row: np.ndarray, seconds: float) -> None:
    if row.dtype == np.uint8 and row.ndim == 3 and row.shape[2] in (1, 3, 4):
        encoding = {1: "mono8", 3: "rgb8", 4: "rgba8"}[row.shape[2]]
        topics.say(f"/log/{name}", "foxglove.RawImage", _IMAGE, seconds, {
            "timestamp": _stamp(seconds), "frame_id": name, "width": row.shape[1], "height": row.shape[0], "encoding": encoding,
            "step": row.shape[1] * row.shape[2], "data": base64.b64encode(row.tobytes()).decode()})
        return
    values = [value if np.isfinite(value) else None for value in row.ravel().tolist()]
    topics.say(f"/log/{name}", "haptic.Row", _ROW, seconds, {"value": values, "shape": list(row.shape)})


def _arrows(frames: Frames) -> list[list[dict[str, Any]]]:
    """Of each frame, one for each contact, whose length is its force."""
    known = frames.columns["contact.id"] >= 0
    force, point = (frames.columns["contact." + name][known].astype(float) for name in ("force", "point"))
    length = np.linalg.norm(force, axis=1)
    axis = force / np.maximum(length, 1e-12)[:, None]
    # The arrow's own axis is x: it is turned about what is square to that and to where it points.
    turn = np.column_stack([1 + axis[:, 0], np.zeros(len(axis)), -axis[:, 2], axis[:, 1]])
    turn[turn[:, 0] < 1e-9] = (0, 0, 0, 1)
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    made = [{"pose": {"position": _xyz(at), "orientation": dict(zip("wxyz", quaternion))}, "shaft_length": 0.8 * _ARROW * size,
             "shaft_diameter": 0.002, "head_length": 0.2 * _ARROW * size, "head_diameter": 0.005,
             "color": {"r": 1, "g": 0.4, "b": 0, "a": 1}} for at, quaternion, size in zip(point.tolist(), turn.tolist(), length.tolist())]
    ends = np.cumsum(known.sum(axis=1)).tolist()
    return [made[begin:end] for begin, end in zip([0, *ends], ends)]


def _xyz(vector: Iterable[float]) -> dict[str, float]:
    return dict(zip("xyz", vector))


def _stamp(seconds: float) -> dict[str, int]:
    whole, nanoseconds = divmod(round(1e9 * seconds), 10**9)
    return {"sec": whole, "nsec": nanoseconds}
