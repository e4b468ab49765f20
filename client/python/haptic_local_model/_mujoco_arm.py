"""What carries a gripper in MuJoCo, and how it follows the hand: a free joint, a mocap body, or an arm by its own actuators."""

from __future__ import annotations

import abc
from typing import Any, Collection, Optional

import numpy as np

import haptic_local_model as haptic
from haptic_local_model._mujoco_shapes import carriers
from haptic_local_model._mujoco_sweep import actuator_name, moments
from haptic_local_model._world import quaternions, rotation, rotation_vector

_FREE, _SLIDE, _HINGE = 0, 2, 3  # of mjtJoint
_WELD, _BODY, _SITE_OBJECT = 1, 1, 6  # mjEQ_WELD, mjOBJ_BODY, mjOBJ_SITE
_FIXED, _LINEAR = 0, (0, 1)  # mjGAIN_FIXED; mjBIAS_NONE, mjBIAS_AFFINE
_DIRECT = (0, 2, 3)  # mjDYN_NONE, mjDYN_FILTER, mjDYN_FILTEREXACT
_ROUNDS = 20  # of a frame's inverse kinematics
_CLOSE = 1e-6  # m and rad
_STUCK = 1e-3  # m and rad
_DAMPING = 1e-4  # of inverse kinematics, relative: near singular postures it goes slowly
_QUICKNESS, _OF_FRAME = 40.0, 0.3  # 1/s: of an arm that follows by motors, at most, and so much in a frame
_LONGEST_STEP = 0.2  # rad or m, of a joint in one round
_FASTEST = 6.0  # rad/s or m/s, of a joint: beyond its reach an arm would whip
_LEVER = 0.03  # m/rad: so much counts a turn of the palm where an arm cannot have both
_TO_REST = 0.5  # 1/s: how an arm with a choice goes back to the posture that it began in


class Arm(abc.ABC):
    """What moves the palm's body in the engine. The hand feels nothing of it."""

    is_free = False  #: Whether nothing carries the palm.

    def __init__(self, binding: Any, model: Any, palm: int):
        self._binding, self._model, self._palm, self.bodies = binding, model, palm, set[int]()
        self.kept: list[int] = []  #: Bodies that nothing moves within a frame.
        self._wanted = np.zeros(7)

    @abc.abstractmethod
    def follow(self, data: Any, X: np.ndarray, v: np.ndarray) -> None:
        """Before a frame's steps. X: of the palm's frame: position, and w, x, y, z; v: its twist, world axes."""

    def error(self, data: Any) -> float:
        """How far the palm is from where it was to be, m."""
        return float(np.linalg.norm(np.asarray(data.xpos[self._palm]) - self._wanted[:3]))


class _Free(Arm):
    """Its root has a free joint; the palm is fixed to that."""

    is_free = True

    def __init__(self, binding: Any, model: Any, palm: int, root: int, from_palm: np.ndarray):
        super().__init__(binding, model, palm)
        self.kept = [root]
        joint = int(model.body_jntadr[root])
        self._q, self._v, self._from_palm = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint]), from_palm

    def follow(self, data: Any, X: np.ndarray, v: np.ndarray) -> None:
        self._wanted = X
        R = rotation(X[3:])
        arm = R @ self._from_palm[:3, 3]
        turn = R @ self._from_palm[:3, :3]
        data.qpos[self._q:self._q + 3] = X[:3] + arm
        data.qpos[self._q + 3:self._q + 7] = quaternions(turn[None])[0]
        data.qvel[self._v:self._v + 3] = v[:3] + np.cross(v[3:], arm)
        data.qvel[self._v + 3:self._v + 6] = turn.T @ v[3:]


class _Mocap(Arm):
    """A mocap body that it is fixed to, or that a weld draws it to."""

    def __init__(self, binding: Any, model: Any, palm: int, mocap: int, from_palm: np.ndarray):
        super().__init__(binding, model, palm)
        self._row, self._from_palm = int(model.body_mocapid[mocap]), from_palm

    def follow(self, data: Any, X: np.ndarray, v: np.ndarray) -> None:
        self._wanted = X
        R = rotation(X[3:])
        data.mocap_pos[self._row] = X[:3] + R @ self._from_palm[:3, 3]
        data.mocap_quat[self._row] = quaternions((R @ self._from_palm[:3, :3])[None])[0]


class _Driven(Arm):
    """Joints between the world and the palm, by servos or motors; without either they are put in their places."""

    def __init__(self, binding: Any, model: Any, data: Any, palm: int, dofs: np.ndarray, period: float):
        super().__init__(binding, model, palm)
        self._quickness = min(_QUICKNESS, _OF_FRAME / period)
        self._dofs = dofs
        self._joints = np.asarray(model.dof_jntid)[dofs]
        self._q = np.asarray(model.jnt_qposadr)[self._joints]
        self._rest = np.array(data.qpos[self._q])
        self._target, self._longest, self._back = self._rest, _FASTEST * period, _TO_REST * period
        self._copy = binding.MjData(model)
        rows = moments(binding, model, data)
        inside = np.zeros(model.nv, bool)
        inside[dofs] = True
        moves = (rows != 0).any(axis=1) & ~(rows[:, ~inside] != 0).any(axis=1)
        self._actuators, self._gears = np.flatnonzero(moves), rows[moves][:, dofs]
        for actuator in self._actuators:
            _require_linear(binding, model, int(actuator))
        if len(self._actuators) == 0:
            self.kept = sorted({int(body) for body in np.asarray(model.jnt_bodyid)[self._joints] if model.body_jntnum[body] == 1})

    def follow(self, data: Any, X: np.ndarray, v: np.ndarray) -> None:
        self._wanted = X
        speed = self._solve(data, X, v)
        if len(self._actuators) == 0:
            data.qpos[self._q], data.qvel[self._dofs] = self._target, speed
            return
        self._command(data, speed)

    def _solve(self, data: Any, X: np.ndarray, v: np.ndarray) -> np.ndarray:
        """From the latest target on. Where that is stuck at limits, towards the posture that is found from the first one on. Returns the
        joints' velocity."""
        self._copy.qpos[:] = data.qpos
        limits = self._limits()
        low, high = np.maximum(limits[0], self._target - self._longest), np.minimum(limits[1], self._target + self._longest)
        reached, J, free, off = self._reach(X, self._target, low, high)
        if off > _STUCK:
            other, *_, from_rest = self._reach(X, self._rest, *limits)
            reached = np.clip(other, low, high) if from_rest < _STUCK else reached
        self._target = reached
        speed = np.zeros(len(self._dofs))
        speed[free] = _damped(J[:, free], v)
        return np.clip(speed, -_FASTEST, _FASTEST)

    def _reach(self, X: np.ndarray, begin: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """Damped least squares on the pose, with joints at their limits left out. Returns where the joints are, the palm's Jacobian there,
        which joints are free, and by how much the pose is off at most, m or rad."""
        binding, model, copy = self._binding, self._model, self._copy
        q, J, free = begin, np.zeros((6, model.nv)), np.ones(len(self._dofs), bool)
        for round_ in range(_ROUNDS):
            copy.qpos[self._q] = q
            binding.mj_kinematics(model, copy)
            binding.mj_comPos(model, copy)
            binding.mj_jacBody(model, copy, J[:3], J[3:], self._palm)
            off = np.concatenate([X[:3] - copy.xpos[self._palm], rotation_vector(
                quaternions((rotation(X[3:]) @ np.reshape(copy.xmat[self._palm], (3, 3)).T)[None])[0])])
            if np.abs(off).max() < _CLOSE and round_ > 0:
                break
            back = self._back * (self._rest - q) if round_ == 0 else np.zeros(len(self._dofs))
            step, free = _within(J[:, self._dofs], off, back, low - q, high - q)
            q = np.clip(q + np.clip(step, -_LONGEST_STEP, _LONGEST_STEP), low, high)
        return q, J[:, self._dofs], free, float(np.abs(off).max())

    def _limits(self) -> tuple[np.ndarray, np.ndarray]:
        limited = np.asarray(self._model.jnt_limited)[self._joints] != 0
        ranges = np.asarray(self._model.jnt_range)[self._joints]
        return np.where(limited, ranges[:, 0], -np.inf), np.where(limited, ranges[:, 1], np.inf)

    def _command(self, data: Any, speed: np.ndarray) -> None:
        """Servos are sent where their springs hold the arm at its target; motors do what a spring and a damper of each joint ask for.
        Both beside weight, friction and what moving takes, and within their ranges."""
        binding, model, chosen = self._binding, self._model, self._actuators
        binding.mj_forward(model, data)
        carried = np.array(data.qfrc_bias - data.qfrc_passive)
        if hasattr(model, "jnt_actgravcomp"):  # By the actuators' own side.
            carried -= np.where(np.asarray(model.jnt_actgravcomp)[model.dof_jntid] != 0, data.qfrc_gravcomp, 0)
        wanted, pull = np.zeros(model.nv), np.zeros(model.nv)
        wanted[self._dofs] = self._quickness**2 * (self._target - data.qpos[self._q])
        wanted[self._dofs] += 2 * self._quickness * (speed - data.qvel[self._dofs])
        binding.mj_mulM(model, data, pull, wanted)
        gain, bias = np.asarray(model.actuator_gainprm)[chosen, 0], np.asarray(model.actuator_biasprm)[chosen]
        bias = np.where(np.asarray(model.actuator_biastype)[chosen, None] == 0, 0, bias)
        is_servo = bias[:, 1] < 0
        to_actuators = np.linalg.pinv(self._gears.T)
        still, moving = to_actuators @ carried[self._dofs], to_actuators @ pull[self._dofs]
        length = np.asarray(data.actuator_length)[chosen] + self._gears @ (self._target - data.qpos[self._q])
        springs = still - bias[:, 0] - bias[:, 1] * length - bias[:, 2] * (self._gears @ speed)
        motors = still + moving - bias[:, 0] - bias[:, 2] * np.asarray(data.actuator_velocity)[chosen]
        control = np.where(is_servo, springs, motors) / gain
        limited, ranges = np.asarray(model.actuator_ctrllimited)[chosen] != 0, np.asarray(model.actuator_ctrlrange)[chosen]
        data.ctrl[chosen] = np.where(limited, np.clip(control, ranges[:, 0], ranges[:, 1]), control)


def arm_of(binding: Any, model: Any, data: Any, palm: int, links: Collection[int], period: float) -> Arm:
    """links: bodies of the gripper. period: of frames, s. Raises haptic.HapticError where nothing moves the palm."""
    chain = [palm]  # with the bodies that carry it
    while int(model.body_parentid[chain[-1]]) != 0:
        chain.append(int(model.body_parentid[chain[-1]]))
    for body in chain:
        if model.body_mocapid[body] >= 0:
            return _Mocap(binding, model, palm, body, np.linalg.inv(_pose(data, palm)) @ _pose(data, body))
    joints = np.flatnonzero(np.isin(model.jnt_bodyid, chain))
    kinds, name = np.asarray(model.jnt_type)[joints], binding.mj_id2name(model, _BODY, palm) or palm
    if len(joints) == 0:
        raise haptic.HapticError(f"gripper {name!r} must be on something that moves: joints, a free joint or a mocap body")
    if len(joints) == 1 and kinds[0] == _FREE:
        carrier = int(model.jnt_bodyid[joints[0]])
        return _Free(binding, model, palm, carrier, np.linalg.inv(_pose(data, palm)) @ _pose(data, carrier))
    drawn = _mocap_of_weld(model, data, palm, chain)
    if drawn is None and not np.isin(kinds, (_SLIDE, _HINGE)).all():
        raise haptic.HapticError(f"the joints that carry gripper {name!r} must be hinges and slides, or one free joint")
    arm: Arm
    if drawn is not None:
        arm = _Mocap(binding, model, palm, *drawn)
    else:
        arm = _Driven(binding, model, data, palm, np.flatnonzero(np.isin(model.dof_jntid, joints)), period)
    arm.bodies = _carried_by(model, chain) - set(links)
    return arm


def _carried_by(model: Any, chain: list[int]) -> set[int]:
    """What moves with the first joint of the chain: the arm, and what hangs on it."""
    of_body, first = carriers(model), next(body for body in reversed(chain) if model.body_dofnum[body] > 0)
    return {int(of_body[body]) for body in range(model.nbody) if _hangs_on(model, body, first)} - {0}


def _hangs_on(model: Any, body: int, root: int) -> bool:
    while body > root:
        body = int(model.body_parentid[body])
    return body == root


def _require_linear(binding: Any, model: Any, actuator: int) -> None:
    if (model.actuator_dyntype[actuator] not in _DIRECT or model.actuator_gaintype[actuator] != _FIXED or model.actuator_gainprm[actuator, 0] == 0
            or model.actuator_biastype[actuator] not in _LINEAR):
        raise haptic.HapticError(f"actuator {actuator_name(binding, model, actuator)!r} of the arm must be a motor, or a servo of position or "
                                 "velocity: others cannot be told what force they are to give")


def _within(J: np.ndarray, motion: np.ndarray, back: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The step that moves the palm so, and goes `back` where that does not move it; and which joints are free: those that would leave
    their limits stop there, and the others do without them."""
    free, step = np.ones(J.shape[1], bool), np.zeros(J.shape[1])
    for _ in range(J.shape[1]):
        A = J[:, free]
        left = motion - J[:, ~free] @ step[~free]
        step[free] = _damped(A, left - A @ back[free]) + back[free]
        stops = free & ((step < low) & (low > -1e-9) | (step > high) & (high < 1e-9))
        if not stops.any():
            break
        step[stops], free = np.clip(step, low, high)[stops], free & ~stops
    return step, free


def _damped(J: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """J: (6, n), of metres and radians; a turn counts by its lever."""
    weights = np.array([1, 1, 1, _LEVER, _LEVER, _LEVER])
    J, motion = weights[:, None] * J, weights * motion
    size = max(float(np.linalg.norm(J)), 1e-9)
    return np.asarray(J.T @ np.linalg.solve(J @ J.T + (_DAMPING * size)**2 * np.eye(6), motion))


def _mocap_of_weld(model: Any, data: Any, palm: int, chain: list[int]) -> Optional[tuple[int, np.ndarray]]:
    """The mocap body that an equality welds one of the chain to, and its frame in the palm's where the weld is satisfied."""
    for i in range(model.neq):
        if model.eq_type[i] != _WELD or not np.ravel(getattr(data, "eq_active", getattr(model, "eq_active", [1] * model.neq)))[i]:
            continue
        of_sites = hasattr(model, "eq_objtype") and model.eq_objtype[i] == _SITE_OBJECT
        named = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
        bodies = [int(model.site_bodyid[each]) for each in named] if of_sites else list(named)
        for one, other in ((0, 1), (1, 0)):
            if bodies[one] not in chain or model.body_mocapid[bodies[other]] < 0:
                continue
            X = _sites_together(model, named) if of_sites else _welded(np.asarray(model.eq_data)[i])
            from_palm = np.linalg.inv(_pose(data, palm)) @ _pose(data, bodies[one])
            return bodies[other], from_palm @ (X if one == 0 else np.linalg.inv(X))
    return None


def _welded(data: np.ndarray) -> np.ndarray:
    """Of the second body in the first one's frame: their anchors are together, and their turn is the one that was stated."""
    X = np.eye(4)
    X[:3, :3] = rotation(data[6:10])
    X[:3, 3] = data[3:6] - X[:3, :3] @ data[:3]
    return X


def _sites_together(model: Any, sites: tuple[int, int]) -> np.ndarray:
    one, other = (_placed(model.site_pos[site], model.site_quat[site]) for site in sites)
    return one @ np.linalg.inv(other)


def _placed(position: Any, turn: Any) -> np.ndarray:
    X = np.eye(4)
    X[:3, 3], X[:3, :3] = position, rotation(turn)
    return X


def _pose(data: Any, body: int) -> np.ndarray:
    X = np.eye(4)
    X[:3, 3], X[:3, :3] = data.xpos[body], np.reshape(data.xmat[body], (3, 3))
    return X

