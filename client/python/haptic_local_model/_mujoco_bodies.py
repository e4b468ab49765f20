"""The bodies of a MuJoCo model: what the server must know to move them, and how they are put in a place."""

from __future__ import annotations

import math
from typing import Any, Collection

import numpy as np

import haptic_local_model as haptic
from haptic_local_model._mujoco_changes import Changes
from haptic_local_model._mujoco_pairs import has_flag
from haptic_local_model._world import quaternions, rotation

_FREE, _SLIDE, _HINGE = 0, 2, 3  # of mjtJoint
_JOINTS = {_SLIDE: haptic.JOINTS["prismatic"], _HINGE: haptic.JOINTS["revolute"]}
_KEPT = 1e6  # kg and kg m²: what a coordinate resists with that is put in its place before each frame
_LEAST_MASS, _MOST_MASS = 1e-6, 1e6  # kg
_MOST_FREEDOMS = 16  # of what joints connect, at the server
_PUT_ELSEWHERE = 5e-3  # m or rad, between two frames
_NEVER_SLEEPS = 3  # mjSLEEP_NEVER
_OF_JOINT, _OF_JOINT_IN_PARENT, _OF_SLIDER_CRANK, _OF_TENDON, _OF_SITE, _OF_BODY = range(6)  # mjtTrn
_CONNECT, _WELD, _OF_JOINTS = 0, 1, 2  # of mjtEq
_SITE_OBJECT = 6  # mjOBJ_SITE
_ROUND_JOINT, _OVER_PULLEY, _THROUGH_SITE = 1, 2, 3  # of mjtWrap


class Bodies:
    """Of one model. A body has its own number; what is welded to it counts as a part."""

    def __init__(self, binding: Any, model: Any, tool: int, changes: Changes):
        self._binding, self._model, self._tool, self._changes = binding, model, tool, changes
        self._kept: set[int] = set()
        self._left: dict[int, np.ndarray] = {}  # of those that are kept: qpos as a frame left it

    def place(self, data: Any, body: int, X: np.ndarray, v: np.ndarray, joint: tuple[float, float] = (0, 0)) -> None:
        """X: position and rotation of its frame; v: that frame's velocity, world axes; joint: the same of its joint, if it hangs
        on one."""
        at, along = self._places(body)
        if at.stop - at.start == 1:
            q = joint[0] + float(self._model.qpos0[at][0])
            if self._model.jnt_type[self._model.body_jntadr[body]] == _HINGE:  # A pose does not tell how often it has turned.
                q += 2 * math.pi * round((float(data.qpos[at][0]) - q) / (2 * math.pi))
            data.qpos[at], data.qvel[along] = q, joint[1]
            return
        data.qpos[at], data.qvel[along] = X, v
        data.qvel[along][3:] = rotation(X[3:]).T @ v[3:]

    def leave(self, data: Any) -> None:
        """A frame has ended."""
        self._left = {body: np.array(data.qpos[self._places(body)[0]]) for body in self._kept}

    def was_moved(self, data: Any, body: int) -> bool:
        """Whether somebody has put it elsewhere since the frame before, by more than steps of MuJoCo would."""
        return body in self._left and bool(np.abs(data.qpos[self._places(body)[0]] - self._left[body]).max() > _PUT_ELSEWHERE)

    def keep(self, body: int) -> None:
        """Nothing moves it within a frame, until let_go()."""
        if body in self._kept:
            return
        self._kept.add(body)
        for name in ("dof_armature", "dof_M0"):  # For free joints MuJoCo reads the second alone.
            self._changes.set(name, self._places(body)[1], _KEPT)
        if hasattr(self._model, "tree_sleep_policy"):  # MuJoCo 3 lists no contact of a sleeping tool with what does not move.
            self._changes.set("tree_sleep_policy", int(self._model.body_treeid[body]), _NEVER_SLEEPS)

    def let_go(self, body: int) -> None:
        if body not in self._kept:
            return
        self._kept.discard(body)
        for name in ("dof_armature", "dof_M0"):
            self._changes.give_back(name, self._places(body)[1])
        if hasattr(self._model, "tree_sleep_policy"):
            tree = int(self._model.body_treeid[body])
            if all(int(self._model.body_treeid[other]) != tree for other in self._kept):
                self._changes.give_back("tree_sleep_policy", tree)

    def dynamics(self, data: Any, offered: Collection[int], carriers: np.ndarray) -> np.ndarray:
        """Records of haptic.DYNAMICS of the bodies that can be pushed and that the server can move: all that joints connect have
        a shape that was offered, and nothing moves them that it cannot be told. carriers: of each body what it moves with."""
        model = self._model
        welded = np.asarray(model.body_weldid)
        roots = [int(body) for body in np.flatnonzero((welded == np.arange(model.nbody)) & (np.asarray(model.body_dofnum) > 0))
                 if body != self._tool]
        moved = self._moved_by_others(data, roots)
        trees: dict[int, list[int]] = {}
        for root in roots:
            trees.setdefault(self._tree_of(root, carriers), []).append(root)
        told = [body for tree in trees.values() for body in tree
                if sum(model.body_dofnum[each] for each in tree) <= _MOST_FREEDOMS
                and all(each in offered and each not in moved and self._can_be_told(each, carriers) for each in tree)]
        found = haptic.dynamics(len(told))
        for to, root in zip(found, told):
            self._describe(root, to)
            self._describe_joint(root, to)
        return found

    def _places(self, body: int) -> tuple[slice, slice]:
        """In qpos and in qvel."""
        model, joint = self._model, int(self._model.body_jntadr[body])
        first, along = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        is_free = model.jnt_type[joint] == _FREE
        return slice(first, first + (7 if is_free else 1)), slice(along, along + (6 if is_free else 1))

    def _can_be_told(self, body: int, carriers: np.ndarray) -> bool:
        """It has mass and one joint, free, a slide or a hinge, and hangs on no wall that moves."""
        model, joint = self._model, int(self._model.body_jntadr[body])
        mass = model.body_mass[np.asarray(model.body_weldid) == body].sum()
        if model.body_jntnum[body] != 1 or not _LEAST_MASS <= mass <= _MOST_MASS:
            return False
        if model.jnt_type[joint] == _FREE:
            along = self._places(body)[1]
            return not (model.jnt_stiffness[joint].any() or model.dof_frictionloss[along].any()
                        or self._changes.own("dof_armature")[along].any() or model.dof_damping[along].any())
        root = carriers[model.body_parentid[body]]
        low, high = model.jnt_range[joint]
        if model.jnt_type[joint] == _HINGE and (high - low > 2 * math.pi if model.jnt_limited[joint] else model.jnt_stiffness[joint].any()):
            return False  # How often it has turned decides.
        curved = (getattr(model, name, np.zeros(0)) for name in ("jnt_stiffnesspoly", "dof_dampingpoly"))
        is_held = root != self._tool and (root == 0 or model.body_dofnum[root] > 0)
        return model.jnt_type[joint] in _JOINTS and is_held and not any(map(np.any, curved))

    def _from_root(self, body: int) -> tuple[int, np.ndarray]:
        """The body that it is welded to, 0 for the world, and its frame in that one's, 4 × 4."""
        model, X = self._model, np.eye(4)
        while body != 0 and model.body_dofnum[body] == 0 and model.body_mocapid[body] < 0:
            X = _frame(model.body_pos[body], model.body_quat[body]) @ X
            body = int(model.body_parentid[body])
        return body, X

    def _tree_of(self, body: int, carriers: np.ndarray) -> int:
        """The body among those that joints connect with it that hangs on the world, or on what only moves by itself."""
        parent = int(carriers[self._model.body_parentid[body]])
        return body if parent == 0 or self._model.body_dofnum[parent] == 0 else self._tree_of(parent, carriers)

    def _moved_by_others(self, data: Any, bodies: list[int]) -> set[int]:
        """Those that fluids, equalities, tendons, actuators or flexes move."""
        model, option = self._model, self._model.opt
        if option.density > 0 or option.viscosity > 0 or getattr(model, "nflex", 0) > 0:
            return set(bodies)
        return set(np.asarray(model.body_weldid)[sorted(self._named(data))].tolist())

    def _named(self, data: Any) -> set[int]:
        """Bodies that active equalities, tendons and actuators name, by themselves, a joint or a site."""
        model = self._model
        of_site, of_joint, named = np.asarray(model.site_bodyid), np.asarray(model.jnt_bodyid), {0}
        kinds = model.eq_objtype if hasattr(model, "eq_objtype") else np.zeros(model.neq, int)
        is_active = data.eq_active if hasattr(data, "eq_active") else model.eq_active
        for active, equality, kind, *items in zip(is_active, model.eq_type, kinds, model.eq_obj1id, model.eq_obj2id):
            if not active:
                continue
            if equality == _OF_JOINTS:
                named.update(int(of_joint[item]) for item in items if item >= 0)
            elif equality in (_CONNECT, _WELD):
                named.update(int(of_site[item] if kind == _SITE_OBJECT else item) for item in items)
        for kind, item in zip(model.wrap_type, model.wrap_objid):
            if kind in (_ROUND_JOINT, _THROUGH_SITE):
                named.add(int((of_joint if kind == _ROUND_JOINT else of_site)[item]))
            elif kind > _THROUGH_SITE:
                named.add(int(model.geom_bodyid[item]))
        for kind, items in zip(model.actuator_trntype, np.asarray(model.actuator_trnid).reshape(-1, 2)):
            if kind in (_OF_JOINT, _OF_JOINT_IN_PARENT):
                named.add(int(of_joint[items[0]]))
            elif kind in (_OF_SLIDER_CRANK, _OF_SITE):
                named.update(int(of_site[item]) for item in items if item >= 0)
            elif kind == _OF_BODY:
                named.add(int(items[0]))
        return named - {0}

    def inertia(self, root: int) -> tuple[float, np.ndarray, np.ndarray]:
        """Of a body with what is welded to it: mass, its centre, and inertia about that, in the body's frame."""
        model, parts = self._model, np.flatnonzero(np.asarray(self._model.body_weldid) == root)
        masses, frames = np.asarray(model.body_mass)[parts], [self._from_root(int(part))[1] for part in parts]
        centres = np.array([X[:3, 3] + X[:3, :3] @ model.body_ipos[part] for part, X in zip(parts, frames)])
        mass = float(masses.sum())
        centre, about = masses @ centres / max(mass, _LEAST_MASS), np.zeros((3, 3))
        for part, part_mass, X, place in zip(parts, masses, frames, centres - centre):
            turn = X[:3, :3] @ rotation(model.body_iquat[part])
            about += (turn * model.body_inertia[part]) @ turn.T + part_mass * (place @ place * np.eye(3) - np.outer(place, place))
        return mass, centre, about

    def gravity(self) -> np.ndarray:
        """m/s², as the flags have it."""
        return np.array(self._model.opt.gravity) * self._is_on("GRAVITY")

    def _describe(self, root: int, to: np.ndarray) -> None:
        model, parts = self._model, np.flatnonzero(np.asarray(self._model.body_weldid) == root)
        to["body"], (to["mass"], to["centre"], to["inertia"]) = root, self.inertia(root)
        weights = np.asarray(model.body_mass)[parts] * (1 - np.asarray(model.body_gravcomp)[parts])
        to["gravity"] = weights.sum() / max(to["mass"], _LEAST_MASS) * self.gravity()

    def _describe_joint(self, body: int, to: np.ndarray) -> None:
        model, joint, (at, along) = self._model, int(self._model.body_jntadr[body]), self._places(body)
        if model.jnt_type[joint] == _FREE:
            return
        root, X = self._from_root(int(model.body_parentid[body]))
        X = X @ _frame(model.body_pos[body], model.body_quat[body]) @ _frame(model.jnt_pos[joint], (1, 0, 0, 0))
        zero = float(model.qpos0[at][0])
        to["joint"], to["parent"] = _JOINTS[int(model.jnt_type[joint])], root or haptic.NO_BODY
        to["place_in_parent"], to["turn_in_parent"] = X[:3, 3], quaternions(X[None, :3, :3])[0]
        to["place_in_body"], to["axis"] = model.jnt_pos[joint], model.jnt_axis[joint]
        if model.jnt_limited[joint] and self._is_on("LIMIT"):
            to["lower"], to["upper"] = model.jnt_range[joint] - zero
        to["reference"], to["armature"] = model.qpos_spring[at][0] - zero, self._changes.own("dof_armature")[along][0]
        for name, value, *flags in (("stiffness", model.jnt_stiffness[joint], "PASSIVE", "SPRING"),
                                    ("joint_damping", model.dof_damping[along], "PASSIVE", "DAMPER"),
                                    ("friction", model.dof_frictionloss[along], "FRICTIONLOSS")):
            to[name] = np.ravel(value)[0] if all(map(self._is_on, flags)) else 0

    def _is_on(self, flag: str) -> bool:
        """Unless the model's flags disable it. Which there are depends on MuJoCo's version."""
        return not has_flag(self._binding.mjtDisableBit, "mjDSBL_" + flag, self._model.opt.disableflags)


def _frame(position: Any, turn: Any) -> np.ndarray:
    X = np.eye(4)
    X[:3, 3], X[:3, :3] = position, rotation(turn)
    return X
