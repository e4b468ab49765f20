"""The bodies of a MuJoCo model: what the server must know to move them, and how they are put in a place."""

from __future__ import annotations

import math
from typing import Any, Collection, NamedTuple, Optional

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
_OF_JOINT, _OF_JOINT_IN_PARENT, _OF_SLIDER_CRANK, _OF_TENDON, _OF_SITE, _OF_BODY, _OF_ORIENTATION = range(7)  # mjtTrn
_CONNECT, _WELD, _OF_JOINTS = 0, 1, 2  # of mjtEq
_SITE_OBJECT = 6  # mjOBJ_SITE
_ROUND_JOINT, _OVER_PULLEY, _THROUGH_SITE = 1, 2, 3  # of mjtWrap
# Why the server does not hold a body:
NO_SHAPE = "no shape of it was given to the server"
FLUID, FLEX = "a fluid acts on it", "the model has a flex"
ACTUATOR, EQUALITY, TENDON = "an actuator moves it", "an equality holds it", "a tendon acts on it"
BALL_JOINT, SECOND_JOINT = "its joint is a ball", "it has a second joint"
MASS = "it weighs less than 1 mg or more than 1000 t"
FREE_JOINT = "its free joint has a spring, friction, damping or an armature"
COUNTS_TURNS = "its hinge counts its turns"
HANGS_ON_TOOL = "it hangs on the tool by a joint"
HANGS_ON_MOCAP = "it hangs on a mocap body, or on a wall that was moved"
CURVED = "its spring or damping is no straight line"
TOO_MANY = f"joints connect more than {_MOST_FREEDOMS} degrees of freedom"


class Reason(NamedTuple):
    """why: one of the above; body: that of which it is so: this one, or one that joints connect with it."""
    why: str
    body: int


class Bodies:
    """Of one model. A body has its own number; what is welded to it counts as a part."""

    def __init__(self, binding: Any, model: Any, tool: Collection[int], changes: Changes):
        """tool: the bodies of it, and of what carries it."""
        self._binding, self._model, self.tool, self._changes = binding, model, tool, changes
        self._kept: set[int] = set()
        self._left: dict[int, np.ndarray] = {}  # of those that are kept: qpos as a frame left it
        self._put: dict[int, tuple[np.ndarray, np.ndarray]] = {}  # where they were put in this frame, and how they move

    def place(self, data: Any, body: int, X: np.ndarray, v: np.ndarray, joint: tuple[float, float] = (0, 0)) -> None:
        """X: position and rotation of its frame; v: that frame's velocity, world axes; joint: the same of its joint, if it hangs
        on one."""
        at, along = self._places(body)
        if at.stop - at.start == 1:
            q = joint[0] + float(self._model.qpos0[at][0])
            if self._model.jnt_type[self._model.body_jntadr[body]] == _HINGE:  # A pose does not tell how often it has turned.
                q += 2 * math.pi * round((float(data.qpos[at][0]) - q) / (2 * math.pi))
            data.qpos[at], data.qvel[along] = q, joint[1]
            self._put[body] = np.array([q]), np.array([joint[1]])
            return
        data.qpos[at], data.qvel[along] = X, v
        data.qvel[along][3:] = rotation(X[3:]).T @ v[3:]
        self._put[body] = np.array(X), np.array(v)

    def leave(self, data: Any, length: float) -> list[int]:
        """A frame of so many seconds has ended. Returns the kept bodies that somebody has put elsewhere within it, by more than steps
        of MuJoCo would."""
        moved = [body for body, (q, v) in self._put.items() if body in self._kept and body not in self.tool
                 and np.abs(data.qpos[self._places(body)[0]][:3] - q[:3] - length * v[:3]).max() > _PUT_ELSEWHERE]
        self._put = {}
        self._left = {body: np.array(data.qpos[self._places(body)[0]]) for body in self._kept}
        return moved

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
        told = [body for body, reason in self.reasons(data, offered, carriers).items() if reason is None]
        found = haptic.dynamics(len(told))
        for to, root in zip(found, told):
            self._describe(root, to)
            self._describe_joint(root, to)
        return found

    def reasons(self, data: Any, offered: Collection[int], carriers: np.ndarray) -> dict[int, Optional[Reason]]:
        """Of each body that can be pushed why the server does not hold it; None: it does. As dynamics(); data: None: as a reset
        leaves it."""
        model = self._model
        welded = np.asarray(model.body_weldid)
        roots = [int(body) for body in np.flatnonzero((welded == np.arange(model.nbody)) & (np.asarray(model.body_dofnum) > 0))
                 if body not in self.tool]
        moved = self._moved_by_others(data, roots)
        trees: dict[int, list[int]] = {}
        for root in roots:
            trees.setdefault(self._tree_of(root, carriers), []).append(root)
        found: dict[int, Optional[Reason]] = {}
        for tree in trees.values():
            own = {body: moved.get(body) or self._own_reason(body, carriers) or (None if body in offered else NO_SHAPE)
                   for body in tree}
            first = next((Reason(why, body) for body, why in own.items() if why), None)
            if first is None and sum(model.body_dofnum[body] for body in tree) > _MOST_FREEDOMS:
                first = Reason(TOO_MANY, tree[0])
            found.update((body, Reason(why, body) if why else first) for body, why in own.items())
        return found

    def _places(self, body: int) -> tuple[slice, slice]:
        """In qpos and in qvel."""
        model, joint = self._model, int(self._model.body_jntadr[body])
        first, along = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        is_free = model.jnt_type[joint] == _FREE
        return slice(first, first + (7 if is_free else 1)), slice(along, along + (6 if is_free else 1))

    def _own_reason(self, body: int, carriers: np.ndarray) -> Optional[str]:
        """None where it has mass and one joint, free, a slide or a hinge, and hangs on no wall that moves."""
        model, joint = self._model, int(self._model.body_jntadr[body])
        if model.body_jntnum[body] != 1:
            return SECOND_JOINT
        along = self._places(body)[1]
        if not _LEAST_MASS <= model.body_mass[np.asarray(model.body_weldid) == body].sum() <= _MOST_MASS:
            return MASS
        if any(np.any(getattr(model, name)[of]) for name, of in (("jnt_stiffnesspoly", joint), ("dof_dampingpoly", along))
               if hasattr(model, name)):
            return CURVED
        if model.jnt_type[joint] == _FREE:
            lists = model.dof_frictionloss, self._changes.own("dof_armature"), model.dof_damping
            return FREE_JOINT if model.jnt_stiffness[joint].any() or any(each[along].any() for each in lists) else None
        if model.jnt_type[joint] not in _JOINTS:
            return BALL_JOINT
        low, high = model.jnt_range[joint]
        counts = high - low > 2 * math.pi if model.jnt_limited[joint] else model.jnt_stiffness[joint].any()
        if model.jnt_type[joint] == _HINGE and counts:
            return COUNTS_TURNS  # How often it has turned decides.
        root = carriers[model.body_parentid[body]]
        if root in self.tool:
            return HANGS_ON_TOOL
        return None if root == 0 or model.body_dofnum[root] > 0 else HANGS_ON_MOCAP

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

    def _moved_by_others(self, data: Any, bodies: list[int]) -> dict[int, str]:
        """Those that fluids, equalities, tendons, actuators or flexes move, and which of these does."""
        model, option = self._model, self._model.opt
        if option.density > 0 or option.viscosity > 0:
            return dict.fromkeys(bodies, FLUID)
        if getattr(model, "nflex", 0) > 0:
            return dict.fromkeys(bodies, FLEX)
        found: dict[int, str] = {}
        for why, named in ((ACTUATOR, self._of_actuators()), (EQUALITY, self._of_equalities(data)), (TENDON, self._of_tendons())):
            for body in sorted(named - {0}):
                found.setdefault(int(model.body_weldid[body]), why)
        return found

    def _of_equalities(self, data: Any) -> set[int]:
        """Bodies that active ones name, by themselves, a joint or a site."""
        model, named = self._model, set[int]()
        of_site, of_joint = np.asarray(model.site_bodyid), np.asarray(model.jnt_bodyid)
        kinds = model.eq_objtype if hasattr(model, "eq_objtype") else np.zeros(model.neq, int)
        is_active = getattr(data, "eq_active", getattr(model, "eq_active0", None))
        if is_active is None:  # before 3.0
            is_active = model.eq_active
        for active, equality, kind, *items in zip(is_active, model.eq_type, kinds, model.eq_obj1id, model.eq_obj2id):
            if active and equality == _OF_JOINTS:
                named.update(int(of_joint[item]) for item in items if item >= 0)
            elif active and equality in (_CONNECT, _WELD):
                named.update(int(of_site[item] if kind == _SITE_OBJECT else item) for item in items)
        return named

    def _of_tendons(self) -> set[int]:
        """Bodies that they name by a joint, a site or a geom."""
        model, named = self._model, set[int]()
        of_site, of_joint = np.asarray(model.site_bodyid), np.asarray(model.jnt_bodyid)
        for kind, item in zip(model.wrap_type, model.wrap_objid):
            if kind in (_ROUND_JOINT, _THROUGH_SITE):
                named.add(int((of_joint if kind == _ROUND_JOINT else of_site)[item]))
            elif kind > _THROUGH_SITE:
                named.add(int(model.geom_bodyid[item]))
        return named

    def _of_actuators(self) -> set[int]:
        """Bodies that they name by themselves, a joint or a site."""
        model, named = self._model, set[int]()
        of_site, of_joint = np.asarray(model.site_bodyid), np.asarray(model.jnt_bodyid)
        for kind, items in zip(model.actuator_trntype, np.asarray(model.actuator_trnid).reshape(-1, 2)):
            if kind in (_OF_JOINT, _OF_JOINT_IN_PARENT):
                named.add(int(of_joint[items[0]]))
            elif kind in (_OF_SLIDER_CRANK, _OF_SITE) or (kind == _OF_ORIENTATION and items[1] >= 0):  # else of a ball joint
                named.update(int(of_site[item]) for item in items if item >= 0)
            elif kind == _OF_BODY:
                named.add(int(items[0]))
        return named

    def inertia(self, root: int) -> tuple[float, np.ndarray, np.ndarray]:
        """Of a body with what is welded to it: mass, its centre, and inertia about that, in the body's frame. Of one that is welded
        itself: with what is welded to it farther out."""
        model, parts = self._model, self._parts(root)
        masses, own = np.asarray(model.body_mass)[parts], np.linalg.inv(self._from_root(root)[1])
        frames = [own @ self._from_root(int(part))[1] for part in parts]
        centres = np.array([X[:3, 3] + X[:3, :3] @ model.body_ipos[part] for part, X in zip(parts, frames)])
        mass = float(masses.sum())
        centre, about = masses @ centres / max(mass, _LEAST_MASS), np.zeros((3, 3))
        for part, part_mass, X, place in zip(parts, masses, frames, centres - centre):
            turn = X[:3, :3] @ rotation(model.body_iquat[part])
            about += (turn * model.body_inertia[part]) @ turn.T + part_mass * (place @ place * np.eye(3) - np.outer(place, place))
        return mass, centre, about

    def _parts(self, root: int) -> np.ndarray:
        model, fixed = self._model, np.zeros(self._model.nbody, bool)
        fixed[root] = True
        for body in range(root + 1, model.nbody):
            fixed[body] = fixed[model.body_parentid[body]] and model.body_dofnum[body] == 0 and model.body_mocapid[body] < 0
        return np.flatnonzero(fixed)

    def gravity(self) -> np.ndarray:
        """m/s², as the flags have it."""
        return np.array(self._model.opt.gravity) * self._is_on("GRAVITY")

    def gravity_on(self, root: int) -> np.ndarray:
        """m/s², of a body with what is welded to it, as far as nothing compensates it."""
        model, parts = self._model, self._parts(root)
        masses = np.asarray(model.body_mass)[parts]
        return (masses * (1 - np.asarray(model.body_gravcomp)[parts])).sum() / max(masses.sum(), _LEAST_MASS) * self.gravity()

    def _describe(self, root: int, to: np.ndarray) -> None:
        to["body"], (to["mass"], to["centre"], to["inertia"]) = root, self.inertia(root)
        to["gravity"] = self.gravity_on(root)

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
