"""What scripts/plot.py draws: the tick log, the world and the phases of the session."""

import csv
import math
import tomllib
import xml.etree.ElementTree as xml
from dataclasses import dataclass

import numpy as np

# Of the tick log's columns (haptic_server/loop/tick_columns.h) those that are drawn.
WORD_COLUMNS = {"server_state"}
SUBJECTS = ("device", "proxy", "tool")
NUMBER_COLUMNS = (
    [f"{s}_{axis}_m" for s in SUBJECTS for axis in "xyz"]
    + [f"{s}_q{part}" for s in SUBJECTS for part in "wxyz"]
    + [f"{s}_force_{axis}_N" for s in ("hand", "env", "command") for axis in "xyz"]
    + ["session", "time_s", "hand_measured", "active_contacts", "predicted_contacts"]
    + ["smallest_separation_m", "adopted", "lateness_s", "execution_s", "overruns"]
    + ["datagrams", "dropped"]
)

# Stretches shorter than this, s, are part of what surrounds them: contact comes and goes at each
# touch.
SHORTEST_PHASE = 0.3


class InputError(Exception):
    """What is wrong with a file, in one line."""


@dataclass
class Phase:
    begin: float  # s
    end: float  # s
    label: str


@dataclass
class Box:
    """The outline of a box in the view: m, rad, in the frame of what owns it. Seen from above the view's
    axes are x and y of the world, from the side x and z."""

    x: float
    y: float
    yaw: float
    length: float
    width: float

    def corners(self, x=0.0, y=0.0, yaw=0.0):
        """4x2, m, for an owner at x, y, yaw in the view."""
        a, b = self.length / 2, self.width / 2
        inner = np.array([(-a, -b), (a, -b), (a, b), (-a, b)]) @ turn(self.yaw).T
        return (inner + (self.x, self.y)) @ turn(yaw).T + (x, y)


@dataclass
class World:
    """Outlines of what does not move, of loose bodies where they begin, and of the tool at its hand."""

    walls: list
    loose: list
    tool: list


def turn(angle):
    """Rotation in the plane by angle, rad."""
    return np.array([(math.cos(angle), -math.sin(angle)), (math.sin(angle), math.cos(angle))])


def read_log(path):
    """The columns that the picture needs, by name."""
    try:
        with open(path, newline="", encoding="utf-8") as file:
            rows = csv.reader(file)
            header = next(rows, [])
            missing = [n for n in [*NUMBER_COLUMNS, *WORD_COLUMNS] if n not in header]
            if missing:
                raise InputError(f"{path}: not a tick log: column '{missing[0]}' is missing")
            wanted = [(n, header.index(n)) for n in header if n in (*NUMBER_COLUMNS, *WORD_COLUMNS)]
            columns = {name: [] for name, _ in wanted}
            for row in rows:
                if len(row) != len(header):
                    raise InputError(
                        f"{path}:{rows.line_num}: has {len(row)} columns instead of {len(header)}"
                    )
                for name, i in wanted:
                    word = name in WORD_COLUMNS
                    columns[name].append(row[i] if word else number(row[i], name, path, rows))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    if not columns["time_s"]:
        raise InputError(f"{path}: holds no tick")
    return {name: np.array(values) for name, values in columns.items()}


def number(text, column, path, rows):
    try:
        return float(text)
    except ValueError:
        raise InputError(
            f"{path}:{rows.line_num}: column '{column}': '{text}' is not a number"
        ) from None


def read_models(path):
    """The models of an SDF file."""
    with open(path, encoding="utf-8") as file:
        # SDFormat uses the prefix without declaring it, which the XML reader refuses.
        text = file.read().replace("<sdf ", '<sdf xmlns:haptic="haptic" ', 1)
    return xml.fromstring(text).findall(".//model")


def read_world(path, tool, from_side):
    """What the world at `path` holds, with the model named `tool` as virtual tool; of its shapes the
    boxes."""
    try:
        world = World([], [], [])
        for model in read_models(path):
            boxes = [box for link in model.iter("link") for box in link_boxes(link, from_side)]
            if model.get("name") == tool:
                hand = model.find("{haptic}hand")
                at = (0, 0, 0) if hand is None else read_pose(hand, from_side)
                world.tool += [placed(box, (-at[0], -at[1], 0)) for box in boxes]
                continue
            boxes = [placed(box, read_pose(model, from_side)) for box in boxes]
            fixed = model.findtext("static", "false").strip() in ("true", "1")
            (world.walls if fixed else world.loose).extend(boxes)
    except (OSError, UnicodeDecodeError, xml.ParseError, ValueError) as error:
        raise InputError(f"{path}: not a world: {error}") from error
    return world


def read_starts(path, tool):
    """The poses x, y, yaw (m, rad) of the model's other starts, seen from above."""
    return [read_pose(start, from_side=False)
            for model in read_models(path) if model.get("name") == tool
            for start in model.findall("{haptic}start")]


def read_pose(element, from_side):
    """Position and angle of an SDF element in the view."""
    pose = [float(part) for part in element.findtext("pose", "0 0 0 0 0 0").split()]
    return (pose[0], pose[2], -pose[4]) if from_side else (pose[0], pose[1], pose[5])


def link_boxes(link, from_side):
    for collision in link.iter("collision"):
        text = collision.findtext("geometry/box/size")
        if text is not None:
            size = [float(part) for part in text.split()]
            outline = Box(*read_pose(collision, from_side), size[0], size[2 if from_side else 1])
            yield placed(outline, read_pose(link, from_side))


def placed(box, pose):
    """The box in the frame in which its owner has the pose x, y, yaw."""
    x, y, yaw = pose
    centre = turn(yaw) @ (box.x, box.y) + (x, y)
    return Box(centre[0], centre[1], box.yaw + yaw, box.length, box.width)


def touching(log):
    """Whether there is contact, tick by tick; short gaps within one touch are closed."""
    time, touches = log["time_s"], log["active_contacts"] > 0
    at = np.flatnonzero(touches)
    for last, first in zip(at, at[1:]):
        if time[first] - time[last] < SHORTEST_PHASE:
            touches[last:first] = True
    return touches


def state_labels(log):
    """What the server was doing, tick by tick."""
    named = {"off": "no session", "fading": "fading", "fault": "fault"}
    running = np.where(touching(log), "contact", "free motion")
    return np.array([named.get(s, r) for s, r in zip(log["server_state"], running)])


def phases_from_states(log):
    """Stretches of one state, the short ones joined to what came before."""
    time, labels = log["time_s"], state_labels(log)
    starts = [0, *np.flatnonzero(labels[1:] != labels[:-1]) + 1, len(time)]
    phases = []
    for first, after in zip(starts, starts[1:]):
        end = time[min(after, len(time) - 1)]
        label = str(labels[first])
        short = end - time[first] < SHORTEST_PHASE
        if phases and (short or phases[-1].label == label):
            phases[-1].end = end
        else:
            phases.append(Phase(time[first], end, label))
    return phases


def phases_from_hand(path, log):
    """The segments of the hand script, from the beginning of each session on."""
    try:
        with open(path, "rb") as file:
            script = tomllib.load(file)
        segments = script["segment"]
        spatial = any(s.get("move_to", {}).get("position", (0, 0, 0))[2] != 0 for s in segments)
        segments = [(float(s["duration"]), describe_segment(s, spatial)) for s in segments]
    except (OSError, tomllib.TOMLDecodeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not a hand script: {error!r}") from error
    phases = []
    for session in np.unique(log["session"][log["session"] > 0]):
        times = log["time_s"][log["session"] == session]
        begin, last = times[0], times[-1]
        for duration, label in segments:
            end = min(begin + duration, last)
            if begin < last:
                phases.append(Phase(begin, end, label))
            begin += duration
        if begin < last:
            phases.append(Phase(begin, last, f"after the script: {script.get('after', 'release')}"))
    return phases


def describe_segment(segment, spatial):
    if "move_to" in segment:
        target = segment["move_to"]
        parts = []
        if "position" in target:
            shown = target["position"][: 3 if spatial else 2]
            parts.append("(" + ", ".join(f"{1e3 * p:g}" for p in shown) + ") mm")
        if "rotation" in target:
            parts.append(f"{math.degrees(target['rotation'][2]):.0f}°")
        verb = "move by " if target.get("relative") else "move to "
        return verb + ", ".join(parts) if parts else "stay"
    wrench = segment["wrench"]
    parts = []
    for axis, constant, amplitude in zip(
        "xyz", wrench.get("force", (0, 0, 0)), wrench.get("force_amplitude", (0, 0, 0))
    ):
        if constant:
            parts.append(f"{axis}: {constant:g} N")
        if amplitude:
            parts.append(f"{axis}: {amplitude:g}·sin(2π·{wrench.get('frequency', 0):g} t) N")
    return "push " + ", ".join(parts) if parts else "let go"
