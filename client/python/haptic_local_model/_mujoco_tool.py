"""The body of a MuJoCo model that the hand holds, with what is welded to it."""

from __future__ import annotations

import warnings
from typing import Any, Optional

import numpy as np
from numpy.typing import ArrayLike

import haptic_local_model as haptic
from haptic_local_model import _arguments
from haptic_local_model._mujoco_bodies import Bodies
from haptic_local_model._mujoco_shapes import Parts, carriers
from haptic_local_model._world import rotation

_FREE = 0  # mjJNT_FREE
_BODY = 1  # mjOBJ_BODY
_NO_CONTACT = np.isin(np.arange(32), (0, 2, 4))  # of mjtConstraint: mjCNSTR_EQUALITY, mjCNSTR_FRICTION_TENDON, mjCNSTR_LIMIT_TENDON


def find_body(binding: Any, model: Any, name: Any, what: str) -> int:
    """The number of the body of that name or number. what: it is to be."""
    if isinstance(name, (int, np.integer)) and not isinstance(name, bool) and 0 < name < model.nbody:
        return int(name)
    if not isinstance(name, str):
        raise haptic.HapticError(f"{what} {_arguments.brief(name)} must be the name of a body, or a number from 1 to {model.nbody - 1}")
    body = int(binding.mj_name2id(model, _BODY, name))
    if body < 0:
        raise haptic.HapticError(f"the model has no body {name!r}")
    return body


def find_tool(binding: Any, model: Any, name: Any) -> int:
    """The number of the body of that name or number. Raises haptic.HapticError where it cannot be the tool."""
    tool = find_body(binding, model, name, "tool")
    name = binding.mj_id2name(model, _BODY, tool) or tool
    joints = int(model.body_jntnum[tool])
    if joints != 1 or model.jnt_type[model.body_jntadr[tool]] != _FREE:
        raise haptic.HapticError(f"body {name!r} must have a free joint, as the tool moves freely in the hand: write <freejoint/> "
                                 + ("into it" if joints == 0 else f"in place of its {joints} joint" + "s" * (joints > 1)))
    return tool


class Tool:
    """Its number, and where it is in qpos, in qvel and among geoms. A gripper has the same members."""

    is_ghost = False  #: Whether it never pushes anything in MuJoCo itself.

    def __init__(self, binding: Any, model: Any, body: int, bodies: Bodies):
        self._binding, self._model, self._bodies, self.body = binding, model, bodies, body
        joint = model.body_jntadr[body]
        self.q = slice(model.jnt_qposadr[joint], model.jnt_qposadr[joint] + 7)
        self.v = slice(model.jnt_dofadr[joint], model.jnt_dofadr[joint] + 6)
        of_body = carriers(model)
        self.parts, self.kept = Parts({body: 0}), [body]
        self._parts = np.flatnonzero(of_body == body)
        self.geoms = np.flatnonzero(of_body[model.geom_bodyid] == body)
        self.size = 2 * float(np.abs(model.geom_size[self.geoms]).max(initial=0.01))  #: m
        self._gravity: Optional[np.ndarray] = None  # m/s²: what a user set; None: the model's
        self._told = self._weight = (np.zeros(3), np.zeros(3))  # force, and centre of mass in the tool's frame

    def warn(self) -> None:
        """Of what the hand feels otherwise than one might think."""
        model = self._model
        hanging = [body for body in range(model.nbody) if model.body_dofnum[body] > 0 and model.body_parentid[body] in self._parts]
        if hanging:
            first = self._binding.mj_id2name(model, _BODY, hanging[0]) or f"body {hanging[0]}"
            warnings.warn(f"bodies that hang on the tool by joints ({len(hanging)}, the first {first!r}) sink into what they "
                          "touch, and the hand does not feel it: weld them to the tool by leaving out their joints", stacklevel=4)
        if len(self.geoms) == 0:
            warnings.warn("the tool has no geoms: nothing but its weight is felt", stacklevel=4)

    def links(self) -> list[haptic.Link]:
        return [self._link()]

    def curves(self) -> list[haptic.Curve]:
        return []

    def drives(self, is_ready: bool) -> list[haptic.Drive]:
        return []

    def configuration(self, data: Any) -> np.ndarray:
        return np.array(data.qpos[self.q])

    def sample(self, data: Any) -> tuple[np.ndarray, np.ndarray]:
        """Where it is after a frame, and its velocity, as the server has them."""
        q, v = np.array(data.qpos[self.q]), np.array(data.qvel[self.v])
        v[3:] = rotation(q[3:]) @ v[3:]
        return q, v

    def place(self, data: Any, q: np.ndarray, v: np.ndarray) -> None:
        """Before a frame, where the proxy is."""
        self._bodies.place(data, self.body, q, v)

    def _link(self) -> haptic.Link:
        mass, centre, inertia = self._bodies.inertia(self.body)
        link = haptic.box(mass=mass, size=(0, 0, 0))
        link.centre[:], link.inertia[:] = centre, inertia.ravel()
        return link

    def is_told(self, gravity: Optional[ArrayLike]) -> None:
        """The server knows it as it is now; gravity: where that is not the model's, m/s²."""
        self._gravity = None if gravity is None else np.array(gravity, dtype=float)
        self.weigh()
        mass, centre, _ = self._bodies.inertia(self.body)
        self._told = mass * (self.gravity() if self._gravity is None else self._gravity), centre

    def gravity(self) -> np.ndarray:
        """On it, m/s²."""
        return self._bodies.gravity_on(self.body)

    def weigh(self) -> None:
        """The model has changed."""
        mass, centre, _ = self._bodies.inertia(self.body)
        self._weight = mass * (self._bodies.gravity() if self._gravity is None else self._gravity), centre

    def arm(self, data: Any) -> float:
        """From its origin to its farthest point, m."""
        places = np.linalg.norm(np.asarray(data.geom_xpos)[self.geoms] - data.xpos[self.body], axis=1)
        return float((places + np.asarray(self._model.geom_rbound)[self.geoms]).max(initial=0))

    def external_wrench(self, data: Any) -> np.ndarray:
        """What pushes it besides contacts and the weight that was told, N and N m about its origin, world axes."""
        wrench = np.array(data.qfrc_passive[self.v])
        wrench += data.qfrc_actuator[self.v]
        wrench += data.qfrc_applied[self.v]
        rows = np.asarray(data.efc_force)[:data.nefc] * _NO_CONTACT[np.asarray(data.efc_type)[:data.nefc]]
        if rows.any():
            of_constraints = np.zeros(self._model.nv)
            self._binding.mj_mulJacTVec(self._model, data, of_constraints, rows)
            wrench += of_constraints[self.v]
        turn = rotation(data.qpos[self.q][3:])
        wrench[3:] = turn @ wrench[3:]
        for body in self._parts[np.asarray(data.xfrc_applied)[self._parts].any(axis=1)]:
            applied = data.xfrc_applied[body]
            wrench += _about(data.xipos[body] - data.xpos[self.body], applied[:3])
            wrench[3:] += applied[3:]
        if not np.array_equal(self._weight, self._told):  # A part of it is compensated, or it has changed.
            wrench += _about(turn @ self._weight[1], self._weight[0]) - _about(turn @ self._told[1], self._told[0])
        return wrench


def _about(arm: np.ndarray, force: np.ndarray) -> np.ndarray:
    return np.concatenate([force, np.cross(arm, force)])
