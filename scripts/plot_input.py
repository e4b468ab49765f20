"""What scripts/plot.py draws: the tick log, the world and the phases of the session."""

import csv
import itertools
import math
import pathlib
import tomllib
import xml.etree.ElementTree as xml
from dataclasses import dataclass

import numpy as np

# Of the tick log's columns (haptic_server/report/tick_columns.h) those that are drawn.
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
class Shape:
    """A body's shape in its owner's frame: what is within `radius` of the hull of `points` (Nx3), m; or, if it
    has `triangles` (Mx3, indices of points), these."""

    points: np.ndarray
    radius: float = 0.0
    triangles: np.ndarray | None = None

    def moved(self, pose):
        """In the frame in which the owner has that pose (4x4)."""
        return Shape(self.points @ pose[:3, :3].T + pose[:3, 3], self.radius, self.triangles)

    def outline(self, view):
        """Corners (Nx2, m) of the convex outline of what is seen of it; `view`: the indices of the two axes that
        are shown."""
        seen = self.points[:, view]
        if self.radius > 0:
            seen = np.concatenate([point + self.radius * CIRCLE for point in seen])
        return hull(seen)

    def contours(self, view):
        """What is seen of the triangles: (corners of each, Mx3x2; the edges at which those that face the viewer
        end, Nx2x2), m."""
        corners = self.points[self.triangles][:, :, view]
        (ax, ay), (bx, by) = ((corners[:, i] - corners[:, 0]).T for i in (1, 2))
        faces_us = ax * by > bx * ay
        ends = {}  # of each edge: of how many triangles that face us, and of how many others
        for triangle, front in zip(self.triangles, faces_us):
            for a, b in zip(triangle, np.roll(triangle, -1)):
                ends.setdefault((min(a, b), max(a, b)), [0, 0])[0 if front else 1] += 1
        edges = [edge for edge, (front, back) in ends.items() if front == 1 or front + back == 1]
        return corners, self.points[np.array(edges, int).reshape(-1, 2)][:, :, view]


@dataclass
class Body:
    name: str  # of its model
    shape: Shape


@dataclass
class World:
    """What does not move, loose bodies and the tool's other links, all where they begin; the link that the
    hand holds, in the hand's frame; what the world says of itself; and what is not drawn of it, in words."""

    name: str
    description: str
    tool: str
    walls: list
    loose: list
    links: list
    held: list
    left_out: list


CIRCLE = np.array([(math.cos(a), math.sin(a)) for a in np.linspace(0, 2 * math.pi, 32, False)])


def sphere_points():
    """On the unit sphere, the ends of the axes among them."""
    rings = [(math.sin(a), math.cos(a)) for a in np.linspace(0, math.pi, 17)]
    return np.array([(*(r * c), z) for r, z in rings for c in CIRCLE])


def hull(points):
    """Corners of the convex hull of points in the plane, in order (Andrew's monotone chain)."""
    ordered = sorted(set(map(tuple, np.round(points, 9))))

    def chain(sequence):
        corners = []
        for point in sequence:
            while len(corners) > 1 and not turns_left(*corners[-2:], point):
                corners.pop()
            corners.append(point)
        return corners[:-1]

    return np.array(chain(ordered) + chain(reversed(ordered)))


def turns_left(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) > (b[1] - a[1]) * (c[0] - a[0])


def matrix(position, rotation):
    """A pose as a 4x4 matrix."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, position
    return pose


def rotation_of(w, x, y, z):
    """The rotation of a unit quaternion."""
    return np.array(
        [
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        ]
    )


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
    log = {name: np.array(values) for name, values in columns.items()}
    # Before its first update and after its last word the frames of a session mean nothing.
    log["session"][log["server_state"] == "off"] = 0
    return log


def number(text, column, path, rows):
    try:
        return float(text)
    except ValueError:
        raise InputError(
            f"{path}:{rows.line_num}: column '{column}': '{text}' is not a number"
        ) from None


def read_source(path):
    """The <world> of an SDF file."""
    with open(path, encoding="utf-8") as file:
        # SDFormat uses the prefix without declaring it, which the XML reader refuses.
        text = file.read().replace("<sdf ", '<sdf xmlns:haptic="haptic" ', 1)
    return xml.fromstring(text).find("world")


def read_starts(path, tool):
    """The poses (4x4) of the tool's other starts."""
    models = [model for model in read_source(path).findall("model") if model.get("name") == tool]
    return [read_pose(start) for model in models for start in model.findall("{haptic}start")]


def read_world(path):
    """The world at `path` with the tool that it names."""
    try:
        source = read_source(path)
        said = [" ".join(source.findtext("{haptic}" + n, "").split()) for n in ("description", "tool")]
        world = World(source.get("name"), *said, [], [], [], [], [])
        folder = pathlib.Path(path).parent
        for model in source.findall("model"):
            if model.get("name") == world.tool:
                read_tool(model, world, folder)
                continue
            fixed = model.findtext("static", "false").strip() in ("true", "1")
            bodies = [body for link in model.iter("link")
                      for body in link_bodies(model, link, folder, world.left_out)]
            (world.walls if fixed else world.loose).extend(bodies)
    except (OSError, UnicodeDecodeError, xml.ParseError, AttributeError, ValueError) as error:
        raise InputError(f"{path}: not a world: {error}") from error
    return world


def read_tool(model, world, folder):
    hand = model.find("{haptic}hand")
    held = model.find("link").get("name") if hand is None else hand.findtext("link").strip()
    for link in model.iter("link"):
        if link.get("name") != held:
            world.links += link_bodies(model, link, folder, world.left_out)
            continue
        # Without <haptic:hand> it is held at its centre of mass.
        at = read_pose(link.find("inertial"))[:3, 3] if hand is None else None
        in_link = matrix(at, np.eye(3)) if hand is None else read_pose(hand)
        shapes = link_shapes(link, model.get("name"), folder, world.left_out)
        world.held += [shape.moved(np.linalg.inv(in_link)) for shape in shapes]


def read_pose(element):
    """Of an SDF element, as a matrix."""
    text = "" if element is None else element.findtext("pose", "")
    x, y, z, roll, pitch, yaw = [float(part) for part in text.split()] or 6 * [0.0]
    (cr, cp, cy), (sr, sp, sy) = np.cos((roll, pitch, yaw)), np.sin((roll, pitch, yaw))
    about_x = np.array([(1, 0, 0), (0, cr, -sr), (0, sr, cr)])
    about_y = np.array([(cp, 0, sp), (0, 1, 0), (-sp, 0, cp)])
    about_z = np.array([(cy, -sy, 0), (sy, cy, 0), (0, 0, 1)])
    return matrix((x, y, z), about_z @ about_y @ about_x)


def link_bodies(model, link, folder, left_out):
    pose, name = read_pose(model) @ read_pose(link), model.get("name")
    return [Body(name, shape.moved(pose)) for shape in link_shapes(link, name, folder, left_out)]


def link_shapes(link, name, folder, left_out):
    """The finite shapes of a link in its frame. What cannot be drawn of the model `name` is added to `left_out`."""
    for collision in link.iter("collision"):
        kind = collision.find("geometry")[0]
        value = lambda name: float(kind.findtext(name))
        if kind.tag == "box":
            half = np.array([float(part) / 2 for part in kind.findtext("size").split()])
            shape = Shape(half * np.array(list(itertools.product((-1, 1), repeat=3))))
        elif kind.tag == "sphere":
            shape = Shape(np.zeros((1, 3)), value("radius"))
        elif kind.tag == "capsule":
            shape = Shape(np.outer((-0.5, 0.5), (0, 0, value("length"))), value("radius"))
        elif kind.tag == "cylinder":
            ends = value("length") * np.array((-0.5, 0.5))
            shape = Shape(np.array([(*(value("radius") * c), z) for c in CIRCLE for z in ends]))
        elif kind.tag == "ellipsoid":
            radii = np.array([float(part) for part in kind.findtext("radii").split()])
            shape = Shape(radii * sphere_points())
        elif kind.tag == "mesh":
            shape = read_mesh(kind, folder)
        else:
            shape = None
        if shape is None:
            if kind.tag != "plane":  # It has no end.
                left_out.append(f"{name} ({kind.tag})")
            continue
        yield shape.moved(read_pose(collision))


def read_mesh(element, folder):
    """The shape of a <mesh>; None if its file is of a format that is not read here, or it is a part of a file."""
    path = folder / element.findtext("uri").strip().removeprefix("file://")
    readers = {".obj": read_obj, ".stl": read_stl}
    reader = readers.get(path.suffix.lower())
    if reader is None or element.find("submesh") is not None:
        return None
    points, triangles = reader(path)
    scale = np.array([float(part) for part in element.findtext("scale", "1 1 1").split()])
    # Triangles meet where their corners are at one place.
    points, place = np.unique(np.round(points * scale, 9), axis=0, return_inverse=True)
    return Shape(points, triangles=place.reshape(-1)[triangles])


def read_obj(path):
    """(points, Nx3; triangles, Mx3) of a Wavefront file; faces become fans."""
    points, triangles = [], []
    with open(path, encoding="utf-8") as file:
        for words in map(str.split, file):
            if words[:1] == ["v"]:
                points.append([float(word) for word in words[1:4]])
            elif words[:1] == ["f"]:
                face = [int(word.split("/")[0]) for word in words[1:]]
                face = [i - 1 if i > 0 else len(points) + i for i in face]
                triangles += [(face[0], *pair) for pair in zip(face[1:], face[2:])]
    return np.array(points), np.array(triangles)


def read_stl(path):
    """The same of an STL file, binary or text."""
    data = path.read_bytes()
    count = int.from_bytes(data[80:84], "little")
    if len(data) == 84 + 50 * count:
        facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        points = np.frombuffer(data, facet, count, 84)["corners"].reshape(-1, 3).astype(float)
    else:
        lines = map(str.split, data.decode().splitlines())
        points = np.array([[float(word) for word in words[1:4]] for words in lines if words[:1] == ["vertex"]])
    return points, np.arange(len(points)).reshape(-1, 3)


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
