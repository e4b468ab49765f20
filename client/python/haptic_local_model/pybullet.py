"""A PyBullet world in the hand.

    client = pybullet.connect(pybullet.DIRECT)
    tool = pybullet.loadURDF("tool.urdf", physicsClientId=client)
    with haptic.pybullet.Session(client, tool=tool) as touch:
        while touch.running:
            for _ in range(touch.drive()):      # proxy pose onto the tool
                touch.push()                    # impulses onto bodies: PyBullet forgets forces after each step
                pybullet.stepSimulation(physicsClientId=client)
            touch.send()                        # where bodies are, and what the tool can push

drive() returns how many steps of the engine's `fixedTimeStep` bring its time up to the hand's, so the loop may run at any
rate and come late. Every body with mass can be pushed, also the links of a robot: what its joints leave of its mobility is
computed at the present pose, without the centripetal part of its acceleration. Motors, friction and limits of joints, and
constraints, take no part: they are felt only as far as the engine moves the body. So are forces of your own.
"""

from __future__ import annotations

import functools
import pathlib
import warnings
from typing import Any, Iterable, Iterator, Optional

import numpy as np
import pybullet

import haptic_local_model as haptic
from haptic_local_model._mobility import Freedom, Tree, free
from haptic_local_model._world import Placed, WorldSession, of_tool, rotation, upright

_DAMPING = 0.04  # 1/s: of every body, unless changeDynamics says otherwise, which PyBullet does not tell
_BASE = -1  # PyBullet's number of a body's base; its links are 0, 1, …
_LINKS = 4096  # of a body, at most: a number of ours is that of a body and a link
_AWAKE = pybullet.ACTIVATION_STATE_DISABLE_SLEEPING
_MOVES = (pybullet.JOINT_REVOLUTE, pybullet.JOINT_PRISMATIC)


class Session(WorldSession):
    """A client for the world of one physics client.

    tool: number of a body with mass and no joints. From here on it is where the proxy is: its mass in PyBullet is 0, and while
    the server answers it collides with nothing. The tool's own weight is felt: gravity=(0, 0, 0) takes it away. period: about
    that of your frames, s. Other arguments are those of haptic.Session.

    What stands still is taken to stay: call offer() after it was moved, and where bodies come and go. What you excluded from
    collisions by filters PyBullet does not tell. A convex mesh has no margin from here on, as its surface is where its vertices
    are. Raises haptic.HapticError where the tool or a shape cannot be used.
    """

    def __init__(self, client: int, tool: int, *, period: float = 1 / 60, **options: Any):
        self._world, self._tool = _Client(client), tool
        if self._world.getPhysicsEngineParameters()["useRealTimeSimulation"]:
            raise haptic.HapticError("PyBullet's real-time simulation must be off: the session says when a step is due")
        mass, _, inertia = self._world.getDynamicsInfo(tool, _BASE)[:3]
        if mass <= 0 or self._world.getNumJoints(tool) > 0:
            raise haptic.HapticError(f"body {tool} has the mass {mass} kg and {self._world.getNumJoints(tool)} joints; the "
                                     "tool must have mass and no joints, as it moves freely in the hand")
        link = haptic.box(mass, (0, 0, 0))
        link.inertia[:] = np.diag(inertia).ravel()
        self._world.changeDynamics(tool, _BASE, mass=0)
        self._trees: dict[int, Tree] = {}  # of bodies, at the end of the present frame
        self._step, self._steps = 0.0, 0  # length, s, and how many the present frame has had
        position, turn = self._world.getBasePositionAndOrientation(tool)
        super().__init__(link, np.array([*position, *_w_first(turn)]), self._gravity(), "product", period, options)

    def drive(self) -> int:
        """Before a frame: the tool where the proxy is. Returns how many steps to take."""
        self._step, self._steps = self._world.getPhysicsEngineParameters()["fixedTimeStep"], 0
        steps = self._begin_frame(self._step)
        self._world.setCollisionFilterGroupMask(self._tool, _BASE, *((1, -1) if self.touch.tool_pushes else (0, 0)))
        self._world.resetBasePositionAndOrientation(self._tool, self._q[:3].tolist(), np.roll(self._q[3:], -1).tolist())
        self._world.resetBaseVelocity(self._tool, self._v[:3].tolist(), self._v[3:].tolist())
        return steps

    def push(self) -> None:
        """Before each step: what the hand holds where it is, and the tool's impulses on bodies, as forces for this step."""
        self._place_held(self._steps * self._step)
        self._steps += 1
        for number, wrench in self._pushes.items():
            body, link = _body_and_link(number)
            at, frame = self._pose(number)[0], pybullet.WORLD_FRAME
            self._world.applyExternalForce(body, link, wrench[:3].tolist(), list(at), frame)
            self._world.applyExternalTorque(body, link, wrench[3:].tolist(), frame)

    def send(self) -> None:
        """After a frame: what is near the tool, at the pose that the steps led to."""
        self._trees = {}
        self._end_frame()

    def _gravity(self) -> list[float]:
        parameters = self._world.getPhysicsEngineParameters()
        return [parameters[f"gravityAcceleration{axis}"] for axis in "XYZ"]

    def _shapes(self) -> Placed:
        placed = Placed()
        for body in map(self._world.getBodyUniqueId, range(self._world.getNumBodies())):
            first, still = len(placed.shapes), {}
            for link in range(_BASE, self._world.getNumJoints(body)):
                if link == _BASE:
                    still[link] = self._world.getDynamicsInfo(body, _BASE)[0] == 0
                else:
                    joint = self._world.getJointInfo(body, link)
                    still[link] = joint[2] == pybullet.JOINT_FIXED and still[joint[16]]
                if not still[link]:
                    self._world.changeDynamics(body, link, activationState=_AWAKE)
                carrier = of_tool() if body == self._tool else haptic.WORLD if still[link] else _number(body, link)
                self._add_shapes(placed, body, link, carrier)
            of_body = range(first, len(placed.shapes))  # A body's links do not touch each other.
            placed.excluded += [(i, j) for i in of_body for j in of_body if j < i and placed.carriers[i] != placed.carriers[j]]
        return placed

    def _add_shapes(self, placed: Placed, body: int, link: int, carrier: int) -> None:
        friction = self._world.getDynamicsInfo(body, link)[1]
        place, turn = ((0, 0, 0), (0, 0, 0, 1)) if carrier != haptic.WORLD else self._frame(body, link)
        told = self._world.getCollisionShapeData(body, link)
        if not told and len(set(self._world.getAABB(body, link))) > 1:
            warnings.warn(f"body {body}, link {link} is not felt: PyBullet does not tell its shape, as of a height field. Load it as a "
                          "mesh by a URDF", stacklevel=5)
        for _, _, kind, size, file, at, turned in told:
            at, turned = pybullet.multiplyTransforms(place, turn, at, turned)
            if kind == pybullet.GEOM_PLANE:
                _, turned = pybullet.multiplyTransforms((0, 0, 0), turned, (0, 0, 0), np.roll(upright(size), -1))
            for name, sizes, *mesh in self._pieces(body, link, kind, size, file):
                placed.add(carrier, name, sizes, at, _w_first(turned), friction, *mesh)

    def _pieces(self, body: int, link: int, kind: int, size: Any, file: bytes) -> Iterator[tuple]:
        """Kind and sizes of haptic.shapes, and of meshes vertices and triangles."""
        if kind == pybullet.GEOM_MESH:
            yield from self._pieces_of_mesh(body, link, size, pathlib.Path(file.decode(errors="replace")))
        elif kind in _BASIC:
            yield _BASIC[kind][0], _BASIC[kind][1](size)
        else:
            raise haptic.HapticError(f"body {body}, link {link}: a shape of type {kind} must be one of {[*_BASIC]} (basic "
                                     f"shapes) or {pybullet.GEOM_MESH} (a mesh)")

    def _pieces_of_mesh(self, body: int, link: int, scale: Any, file: pathlib.Path) -> Iterator[tuple]:
        """Of a file .obj each object is a convex piece. Of a mesh that is not convex PyBullet tells no vertices."""
        vertices = np.array(self._world.getMeshData(body, link)[1]).reshape(-1, 3)
        if len(vertices) > 0:
            self._world.changeDynamics(body, link, collisionMargin=0)
        if file.suffix.lower() == ".obj" and file.is_file():
            corners, objects = _read_obj(file)
            if len(vertices) == 0:
                yield "mesh", (), corners * scale, np.concatenate(objects)
            else:
                yield from (("hull", (), corners[np.unique(each)] * scale) for each in objects)
        elif 0 < len(vertices) == self._world.getMeshData(body, link, collisionShapeIndex=0)[0]:
            yield "hull", (), vertices
        else:
            raise haptic.HapticError(f"body {body}, link {link}: of a mesh that is not one convex piece PyBullet tells only the "
                                     "file, and that only where it was loaded by a URDF: load it so, from a file .obj")

    def _frame(self, body: int, link: int) -> tuple[Any, Any]:
        """Position and rotation (x, y, z, w) of its frame, whose origin is its centre of mass."""
        if link == _BASE:
            return self._world.getBasePositionAndOrientation(body)
        return self._world.getLinkState(body, link, computeForwardKinematics=1)[:2]

    def _pose(self, number: int) -> tuple[Any, Any, Any]:
        body, link = _body_and_link(number)
        position, turn = self._frame(body, link)
        return position, _w_first(turn), self._tree(body).velocity(link + 1, self._speeds(body))

    def _place(self, number: int, position: np.ndarray, turn: np.ndarray, velocity: np.ndarray) -> None:
        body, _ = _body_and_link(number)
        self._world.resetBasePositionAndOrientation(body, position.tolist(), np.roll(turn, -1).tolist())
        self._world.resetBaseVelocity(body, velocity[:3].tolist(), velocity[3:].tolist())

    def _inertia(self, number: int) -> Optional[tuple[float, Any, Any, float]]:
        body, _ = _body_and_link(number)
        if self._world.getNumJoints(body) > 0 or self._world.getNumConstraints() > 0:
            return None
        mass, _, inertia = self._world.getDynamicsInfo(body, _BASE)[:3]
        return (mass, (0, 0, 0), np.diag(inertia), _DAMPING) if min(inertia) > 0 else None

    def _can_be_pushed(self, number: int) -> bool:
        return True

    def _describe(self, number: int, to: np.ndarray) -> None:
        body, link = _body_and_link(number)
        tree = self._tree(body)
        to["centre"] = self._frame(body, link)[0]
        to["velocity"] = tree.velocity(link + 1, self._speeds(body))
        to["inverse_inertia"], to["acceleration"] = tree.inverse_inertia(link + 1), tree.acceleration(link + 1)
        shapes = self._world.getCollisionShapeData(body, link)
        if self._world.getNumJoints(body) == 0 and len(shapes) == 1 and shapes[0][2] in _ROUND:
            to["round"] = _ROUND[shapes[0][2]]
            to["axis"] = rotation(_w_first(self._frame(body, link)[1])) @ rotation(_w_first(shapes[0][6]))[:, 2]

    def _tree(self, body: int) -> Tree:
        if body not in self._trees:
            self._trees[body] = self._tree_now(body)
        return self._trees[body]

    def _tree_now(self, body: int) -> Tree:
        world, links = self._world, range(_BASE, self._world.getNumJoints(body))
        dynamics = [world.getDynamicsInfo(body, link) for link in links]
        frames = [self._frame(body, link) for link in links]
        turns = [rotation(_w_first(turn)) for _, turn in frames]
        inertias = [(R * each[2]) @ R.T for R, each in zip(turns, dynamics)]
        freedoms, parents = free(0, frames[0][0]) if dynamics[0][0] > 0 else [], [-1]
        for link in links[1:]:
            joint = world.getJointInfo(body, link)
            point, turn = world.getLinkState(body, link)[4:6]
            axis, none = rotation(_w_first(turn)) @ joint[13], np.zeros(3)
            parents.append(joint[16] + 1)
            if joint[2] in _MOVES:
                linear, angular = (axis, none) if joint[2] == pybullet.JOINT_PRISMATIC else (none, axis)
                freedoms.append(Freedom(link + 1, linear, angular, point, joint[6]))
        return Tree(parents, [each[0] for each in dynamics], inertias, [place for place, _ in frames], freedoms,
                    self._gravity(), self._frames.delay())

    def _speeds(self, body: int) -> list[float]:
        speeds = [*sum(self._world.getBaseVelocity(body), ())] if self._world.getDynamicsInfo(body, _BASE)[0] > 0 else []
        return speeds + [self._world.getJointState(body, link)[1] for link in range(self._world.getNumJoints(body))
                         if self._world.getJointInfo(body, link)[2] in _MOVES]

    def _touching(self) -> Iterable[tuple[int, int]]:
        return [(_number(point[1], point[3]), _number(point[2], point[4])) for point in self._world.getContactPoints()]


_BASIC = {pybullet.GEOM_SPHERE: ("sphere", lambda size: size[:1]), pybullet.GEOM_BOX: ("box", lambda size: size),
          pybullet.GEOM_CYLINDER: ("cylinder", lambda size: (size[1], size[0])),
          pybullet.GEOM_CAPSULE: ("capsule", lambda size: (size[1], size[0])),
          pybullet.GEOM_PLANE: ("half_space", lambda size: ())}
_ROUND = {pybullet.GEOM_SPHERE: haptic.SPHERE, pybullet.GEOM_CYLINDER: haptic.ROUND_ABOUT_AXIS,
          pybullet.GEOM_CAPSULE: haptic.ROUND_ABOUT_AXIS}


class _Client:
    """PyBullet's functions, for one physics client."""

    def __init__(self, number: int):
        self._number = number

    def __getattr__(self, name: str) -> Any:
        return functools.partial(getattr(pybullet, name), physicsClientId=self._number)


def _number(body: int, link: int) -> int:
    """Ours, of a body and one of its links; 0 is none."""
    return body * _LINKS + link + 2


def _body_and_link(number: int) -> tuple[int, int]:
    body, link = divmod(number, _LINKS)
    return body, link - 2


def _w_first(quaternion: Any) -> np.ndarray:
    return np.roll(quaternion, 1)


def _read_obj(file: pathlib.Path) -> tuple[np.ndarray, list[np.ndarray]]:
    """Vertices, and of each object its triangles."""
    vertices: list[list[float]] = []
    objects: list[list[tuple[int, int, int]]] = [[]]
    for words in map(str.split, file.read_text(errors="replace").splitlines()):
        if words[:1] == ["v"]:
            vertices.append([float(word) for word in words[1:4]])
        elif words[:1] in (["o"], ["g"]):
            objects.append([])
        elif words[:1] == ["f"]:
            corners = [int(word.split("/")[0]) for word in words[1:]]
            corners = [corner - 1 if corner > 0 else len(vertices) + corner for corner in corners]
            objects[-1] += [(corners[0], b, c) for b, c in zip(corners[1:], corners[2:])]
    return np.array(vertices), [np.array(each) for each in objects if each]
