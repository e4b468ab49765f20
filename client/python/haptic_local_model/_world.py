"""What the sessions of engines have in common: shapes once, poses in each frame, and the tool's impulses on bodies."""

from __future__ import annotations

import abc
import functools
import math
import os
import warnings
from typing import Any, Collection, Iterable, Optional, Sequence, TypeVar

import numpy as np
from numpy.typing import ArrayLike

import haptic_local_model as haptic
import haptic_local_model.shapes

# Bodies within this are sent, m, and within what the tool travels until the next update but two has come, up to the
# farthest, m: one that was not sent is a wall.
_NEAR_BODIES, _FARTHEST_BODIES = 0.02, 0.3
_USUAL_SPEED = 0.3  # m/s: of a hand that was at rest
_FRAMES_LOOSE = 20  # after a body touched one that the server cannot hold: one that bounces on it changes hands but once
_Session = TypeVar("_Session", bound="EngineSession")
_TOOL = -1  # the carrier of the tool's shapes


class Frames:
    """The frames of a session."""

    def __init__(self, touch: haptic.Session, period: float, arm: float, has_shapes: bool = True):
        """period: about that of the frames, s. arm: from the tool's origin to its farthest point, m. has_shapes: whether
        the server was offered them."""
        self._touch, self._period, self._arm, self._has_shapes = touch, period, arm, has_shapes
        self.length = 0.0  #: Of the steps of the present frame, s.
        self.held = np.zeros(0, haptic.HELD)  #: Bodies to be put where the server has them, as haptic.Session.held().

    def begin(self, step: float) -> int:
        """Takes what arrived. Returns how many steps, of `step` seconds, are due."""
        self._touch.poll()
        self.held = self._touch.held()
        steps = self._touch.steps(step)
        self.length = steps * step
        return steps

    def waits(self) -> bool:
        """Whether the server has the shapes to itself, and says neither that it uses them nor why it does not."""
        told = self._touch.connected and self._touch.message
        return self._has_shapes and not self._touch.has_scene and not told

    def delay(self) -> float:
        """From the state that is known until what is sent now is replaced, s."""
        return self._touch.state.round_trip + 2 * max(self.length, self._period)

    def speed(self, v: np.ndarray) -> float:
        """Of the fastest point of a tool of that velocity, at most, m/s."""
        x, y, z, *turning = v.tolist()
        return math.hypot(x, y, z) + self._arm * math.hypot(*turning)

    def reach(self, v: np.ndarray) -> float:
        """How far bodies are, m, that a tool of that velocity may push before the next frame's are there, or those after it if
        these get lost."""
        return min(_NEAR_BODIES + 3 * 1.5 * max(self.speed(v), _USUAL_SPEED) * self.delay(), _FARTHEST_BODIES)


class Placed:
    """Shapes, each in the frame of what carries it: the world, the tool or a body."""

    def __init__(self) -> None:
        self.shapes: list[haptic.shapes.Shape] = []
        self.positions: list[np.ndarray] = []
        self.rotations: list[np.ndarray] = []  # w, x, y, z
        self.friction: list[float] = []
        self.carriers: list[int] = []
        self.radii: list[float] = []  # m, of balls around them
        self.excluded: list[tuple[int, int]] = []

    def add(self, carrier: int, kind: str, size: Sequence[float], position: Any, rotation: Any, friction: float,
            vertices: Optional[np.ndarray] = None, triangles: Optional[np.ndarray] = None) -> None:
        """carrier: haptic.WORLD, 0, a body's number, or what of_tool() gives."""
        side = haptic.TOOL_LINK if carrier == _TOOL else haptic.MOVABLE_BODY if carrier else haptic.WORLD
        self.shapes.append(haptic.shapes.shape(kind, size, side, max(carrier, 0), vertices=vertices, triangles=triangles))
        self.positions.append(np.array(position, dtype=float))
        self.rotations.append(np.array(rotation, dtype=float))
        self.friction.append(friction)
        self.carriers.append(carrier)
        self.radii.append(_radius(kind, np.asarray(size), vertices))

    @functools.cached_property
    def _finder(self) -> "Gaps":
        return Gaps(np.array(self.radii), np.array(self.carriers), _TOOL)

    def gaps(self, at: np.ndarray) -> dict[int, float]:
        """As Gaps.find(), once all shapes have been added."""
        return self._finder.find(at)

    @property
    def bodies(self) -> list[int]:
        """Numbers of those that have shapes."""
        return sorted(set(self.carriers) - {haptic.WORLD, _TOOL})

    @property
    def arm(self) -> float:
        """From the tool's origin to its farthest point, m."""
        return max((float(np.linalg.norm(at)) + radius for at, radius, carrier in zip(self.positions, self.radii, self.carriers)
                    if carrier == _TOOL), default=0.01)


class EngineSession:
    """What every engine's session hands on to the session that it holds."""

    touch: haptic.Session

    def __enter__(self: _Session) -> _Session:
        self.touch.__enter__()
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self) -> None:
        """Says goodbye, and ends a server that the session started."""
        self.touch.close()

    @property
    def running(self) -> bool:
        """As haptic.Session.running: set `touch.touch.running` to False to end a loop."""
        return self.touch.running

    def show(self, port: int = 0, open_browser: bool = True) -> str:
        """As haptic.Session.show()."""
        return self.touch.show(port, open_browser)

    def _repr_html_(self) -> Optional[str]:
        """As haptic.Session: in a notebook, the page."""
        return self.touch._repr_html_()

    def hold(self, position: Sequence[float], rotation: Sequence[float] = (1, 0, 0, 0)) -> None:
        """As haptic.Session.hold(): m; w, x, y, z; world axes."""
        self.touch.hold(position, rotation)

    def release(self) -> None:
        """The hand of hold() lets go."""
        self.touch.release()

    def episode(self, task: str, folder: str | os.PathLike[str] = "demonstrations", **options: Any) -> haptic.Episode:
        """As haptic.Session.episode()."""
        return self.touch.episode(task, folder, **options)

    def log(self, **values: Any) -> None:
        """As haptic.Session.log()."""
        self.touch.log(**values)


class WorldSession(EngineSession, abc.ABC):
    """A client for one world of an engine, of which a subclass says what it has."""

    def __init__(self, link: haptic.Link, q: np.ndarray, gravity: Sequence[float], rule: str, period: float,
                 options: dict[str, Any]):
        """link, q: the tool and where it is. gravity: of the world. rule: that of friction, one of haptic.FRICTION_RULES."""
        self._gravity_W = np.array(gravity, dtype=float)
        self._placed, self._rule, self._warned = self._shapes(), rule, False
        self._pushes: dict[int, np.ndarray] = {}
        self._near_bodies = NearBodies()
        arm = self._placed.arm
        defaults = {"length": 2 * arm, "gravity": gravity, "rate": 1 / period}
        self.touch = haptic.Session(tool=link, q=q, **{**defaults, **options})
        self._frames = Frames(self.touch, period, arm)
        self._q, self._v = q, np.zeros(6)
        self._give()

    def offer(self) -> None:
        """Where shapes or friction have changed, or what stands still was moved."""
        self._placed = self._shapes()
        self._give()

    def _give(self) -> None:
        placed = self._placed
        self.touch.offer(placed.shapes, np.reshape(placed.positions, (-1, 3)), np.reshape(placed.rotations, (-1, 4)),
                         placed.friction, self._rule, None, placed.excluded, self._dynamics())

    def _dynamics(self) -> np.ndarray:
        """Of the bodies that can be pushed and described: the server can hold them."""
        inertias = {body: self._inertia(body) for body in self._placed.bodies if self._can_be_pushed(body)}
        self._told = {body: described for body, described in inertias.items() if described is not None}
        found = haptic.dynamics(len(self._told))
        for to, (body, described) in zip(found, self._told.items()):
            to["body"], to["gravity"] = body, self._gravity_W
            to["mass"], to["centre"], to["inertia"], to["damping"] = described
            to["angular_damping"] = to["damping"]
        return found

    def _begin_frame(self, step: float) -> int:
        """The proxy's pose, the tool's impulses on bodies, and how many steps of the engine are due."""
        steps = self._frames.begin(step)
        self._q, self._v = self.touch.q, self.touch.v
        length = self._frames.length
        self._place_held()
        self._pushes = {body: impulse / length for body, impulse in self.touch.impulses(length).items()} if steps else {}
        return steps

    def _place_held(self, after: float = 0) -> None:
        """Puts the bodies that the hand holds where they are so long after the frame's beginning, s."""
        rows: list[Any] = self._frames.held.tolist()
        for body, let_go, position, turn, velocity, *_ in rows:
            if not (let_go and after):
                self._place(body, np.array(position) + after * np.array(velocity[:3]), np.array(turn), np.array(velocity))

    def _end_frame(self) -> None:
        """Sends where bodies are, and what the tool may push."""
        if self._frames.length == 0:
            return
        self._warn_of_shapes()
        self.touch.sample(self._q, self._v, self._frames.length)
        placed = {body: self._pose(body) for body in self._placed.bodies}
        gaps = dict(list(self._gaps(placed).items())[:haptic.MAX_POSES])  # A body needs a pose, too.
        poses = haptic.poses(len(gaps))
        for to, body in zip(poses, gaps):
            to["body"], (to["position"], to["rotation"], to["velocity"]) = body, placed[body]
        near = self._near_bodies.find({body: gap for body, gap in gaps.items() if self._can_be_pushed(body)},
                                      self._frames.reach(self._v), self._touching, self._told if self.touch.holds else ())
        bodies = haptic.bodies(min(len(near), haptic.MAX_BODIES))
        for to, body in zip(bodies, near):
            to["id"] = body
            self._describe(body, to)
        self.touch.send(None, bodies, poses)

    def _warn_of_shapes(self) -> None:
        if self.touch.connected and not self.touch.has_scene and self.touch.message and not self._warned:
            self._warned = True
            warnings.warn(f"nothing is felt: {self.touch.message}", stacklevel=4)

    def _gaps(self, poses: dict[int, tuple]) -> dict[int, float]:
        placed = self._placed
        frames = {_TOOL: (self._q[:3], self._q[3:]), haptic.WORLD: (np.zeros(3), np.array((1.0, 0, 0, 0))),
                  **{body: pose[:2] for body, pose in poses.items()}}
        turns = {carrier: rotation(turn) for carrier, (_, turn) in frames.items()}
        at = np.array([frames[carrier][0] + turns[carrier] @ place
                       for carrier, place in zip(placed.carriers, placed.positions)]).reshape(-1, 3)
        return placed.gaps(at)

    @abc.abstractmethod
    def _shapes(self) -> Placed:
        """Of the world."""

    @abc.abstractmethod
    def _pose(self, body: int) -> tuple[Any, Any, Any]:
        """Position, rotation and velocity of a body's frame."""

    @abc.abstractmethod
    def _place(self, body: int, position: np.ndarray, turn: np.ndarray, velocity: np.ndarray) -> None:
        """Puts a body that nothing holds in its place; arguments as _pose() returns them."""

    @abc.abstractmethod
    def _inertia(self, body: int) -> Optional[tuple[float, Any, Any, float]]:
        """Mass, its centre in the body's frame, inertia about that in the body's axes, and what share of its velocity is lost
        in a second. None if joints hold it, or what else than contacts and its weight moves it."""

    @abc.abstractmethod
    def _can_be_pushed(self, body: int) -> bool:
        """Or is it a wall that moves by itself?"""

    @abc.abstractmethod
    def _describe(self, body: int, to: np.ndarray) -> None:
        """Fills a record of haptic.BODY."""

    @abc.abstractmethod
    def _touching(self) -> Iterable[tuple[int, int]]:
        """Numbers of bodies that touch each other."""


def of_tool() -> int:
    """The carrier of the tool's shapes."""
    return _TOOL


class Gaps:
    """How far bodies are from the tool at least, by balls around shapes."""

    def __init__(self, radii: np.ndarray, carriers: np.ndarray, tool: int):
        """radii: of the balls, m. carriers: of the shapes: bodies, 0 for the world, or `tool`."""
        self._of_tool = np.flatnonzero(carriers == tool)
        self._moves = np.flatnonzero((carriers != tool) & (carriers != 0))
        self._bodies, self._place = np.unique(carriers[self._moves], return_inverse=True)
        self._around = radii[self._moves, None] + radii[None, self._of_tool]

    def find(self, at: np.ndarray) -> dict[int, float]:
        """The bodies' gaps, m, nearest first. at: the balls' centres."""
        between = at[self._moves, None] - at[None, self._of_tool]
        away = np.sqrt(np.einsum("ijk,ijk->ij", between, between)) - self._around
        nearest = np.full(len(self._bodies), np.inf)
        np.minimum.at(nearest, self._place, away.min(axis=1, initial=np.inf))
        order = np.argsort(nearest)
        return dict(zip(self._bodies[order].tolist(), nearest[order].tolist()))


class NearBodies:
    """Which bodies the server must be told the state of, as the tool may push them."""

    def __init__(self) -> None:
        self._loose: dict[int, int] = {}  # frames for which a body that the server could hold is still told

    def find(self, pushable: dict[int, float], reach: float, pairs: Any, holdable: Collection[int]) -> list[int]:
        """Those within reach, what touches one of them, what touches that, and so on: what lies on a body moves with it. Where the
        server could hold all of them, none. pushable: all that there are, with their gaps, m. pairs(): of bodies that touch or hang
        on each other."""
        near = [body for body, gap in pushable.items() if gap < reach]
        if not near or all(body in holdable for body in pushable):
            return []
        touching = np.array(list(pairs()), dtype=np.int64).reshape(-1, 2)
        touching = touching[np.isin(touching, [*pushable]).all(axis=1)]
        near = _with_touching(near, touching)
        found = _with_touching([body for body in near if body not in holdable], touching)
        self._loose = {body: frames - 1 for body, frames in self._loose.items() if frames > 1 and body in near}
        self._loose.update((body, _FRAMES_LOOSE) for body in found if body in holdable)
        return found + [body for body in self._loose if body not in found]


def _with_touching(bodies: list[int], pairs: np.ndarray) -> list[int]:
    found = list(bodies)
    for body in found:
        found += [other for other in dict.fromkeys(pairs[(pairs == body).any(axis=1)].ravel().tolist()) if other not in found]
    return found


def rotation(quaternion: ArrayLike) -> np.ndarray:
    """The matrix of (w, x, y, z)."""
    w, x, y, z = map(float, np.asarray(quaternion))
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def quaternions(matrices: np.ndarray) -> np.ndarray:
    """(w, x, y, z) of each: of four ways the one without a small divisor."""
    m = matrices
    d0, d1, d2 = m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]
    yz, zy, zx, xz, xy, yx = m[:, 2, 1], m[:, 1, 2], m[:, 0, 2], m[:, 2, 0], m[:, 1, 0], m[:, 0, 1]
    ways = np.array([[1 + d0 + d1 + d2, yz - zy, zx - xz, xy - yx],
                     [yz - zy, 1 + d0 - d1 - d2, xy + yx, zx + xz],
                     [zx - xz, xy + yx, 1 - d0 + d1 - d2, yz + zy],
                     [xy - yx, zx + xz, yz + zy, 1 - d0 - d1 + d2]])
    best = np.argmax([1 + d0 + d1 + d2, 1 + d0 - d1 - d2, 1 - d0 + d1 - d2, 1 - d0 - d1 + d2], axis=0)
    chosen = ways[best, :, np.arange(len(m))]
    return chosen / np.linalg.norm(chosen, axis=1, keepdims=True)


def upright(normal: ArrayLike) -> np.ndarray:
    """(w, x, y, z) of a frame whose z axis is that unit vector."""
    z = np.asarray(normal, dtype=float)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    return quaternions(np.column_stack([x, np.cross(z, x), z])[None])[0]


def rotation_vector(quaternion: ArrayLike) -> np.ndarray:
    """Of (w, x, y, z): axis times angle, rad, from 0 to pi."""
    q = np.asarray(quaternion, dtype=float)
    q = q if q[0] >= 0 else -q
    sine = np.linalg.norm(q[1:])
    return q[1:] * (2 * np.arctan2(sine, q[0]) / sine if sine > 1e-12 else 2)


def _radius(kind: str, size: np.ndarray, vertices: Optional[np.ndarray]) -> float:
    if kind == "half_space":
        return np.inf
    if vertices is not None:
        return float(np.linalg.norm(vertices, axis=1).max())
    return float({"sphere": lambda: size[0], "capsule": lambda: size[0] + size[1] / 2, "ellipsoid": lambda: max(size),
                  "cylinder": lambda: np.hypot(size[0], size[1] / 2), "box": lambda: np.linalg.norm(size) / 2}[kind]())
