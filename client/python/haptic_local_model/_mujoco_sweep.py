"""How the fingers of a MuJoCo gripper move: led once from one end to the other, whatever its mechanism is."""

from __future__ import annotations

import copy
from typing import Any, NamedTuple, Optional, Sequence

import numpy as np

import haptic_local_model as haptic
from haptic_local_model import _arguments
from haptic_local_model._library import CURVE_TERMS
from haptic_local_model._mujoco_shapes import carriers
from haptic_local_model._world import quaternions, rotation, rotation_vector

_BODY, _ACTUATOR = 1, 19  # mjOBJ_BODY, mjOBJ_ACTUATOR
_FREE, _BALL = 0, 1  # of mjtJoint
_CONNECT, _WELD = 0, 1  # of mjtEq
_HEAVY = 1e6  # kg and kg m²: what does not move meanwhile
_PLACES = 41  # where the fingers are looked at
_FIRM = 10.0  # kg and kg m²: what the led joints get, so that springs and damping of the mechanism count for little
_CALM = 1e-3  # kg and kg m²: what all joints of the mechanism get; without it light links rattle
_RUN_IN_DAMPING = 0.1  # N s/m and N m s/rad: of all joints, until what begins apart is together
_QUICK = 40.0  # rad/s: how fast the coordinate is led, and comes to rest
_AT_REST = 1.0  # s: for how long it may go on at each place
_STILL = 1e-6  # of the coordinate's range, in a step: it has come to rest
_LEAST_MOTION = 1e-5  # m or rad: of a body that the actuator moves
_LEAST_RANGE = 1e-4  # rad or m
_FIXED, _AFFINE, _NONE = 0, 1, 0  # mjGAIN_FIXED, mjBIAS_AFFINE, mjDYN_NONE
_DIRECT = (0, 2, 3)  # mjDYN_NONE, mjDYN_FILTER, mjDYN_FILTEREXACT


class Servo(NamedTuple):
    """What drives the coordinate s, an actuator's length: f = stiffness (target - s) - damping ds/dt, at most `most`."""
    stiffness: float
    damping: float
    most: float
    lower: float  #: s that it can be sent to, at least,
    upper: float  #: and at most.


class Finger(NamedTuple):
    """A body, and its pose in the palm's frame over x = -1 .. 1: factors of 1, x, x² ...: position, and quaternion w, x, y, z."""
    body: int
    terms: np.ndarray  #: (CURVE_TERMS, 7)


class Sweep(NamedTuple):
    """One actuator, led from its lower end to its upper one."""
    actuator: int
    s: np.ndarray  #: (n,), growing
    qpos: np.ndarray  #: (n, nq): of the model; what the actuator does not move stays
    lengths: np.ndarray  #: (n, nu): of all actuators
    fingers: list[Finger]
    joints: np.ndarray  #: (k,): of the mechanism; their places in qpos and in qvel;
    places: np.ndarray
    dofs: np.ndarray
    slopes: np.ndarray  #: and dq/ds of each, root of the mean square
    servo: Servo
    error: tuple[float, float]  #: by which the fingers are off their curves at most: m, rad

    def of_joints(self, each: Any) -> float:
        """Armature or damping of all degrees of freedom, at s."""
        return float(np.asarray(each)[self.dofs] @ self.slopes**2)

    def spring(self, model: Any) -> tuple[float, float]:
        """Of the joints' springs, at s: force = pull - stiffness s; from a parabola through their energy."""
        stretched = self.qpos[:, self.places] - np.asarray(model.qpos_spring)[self.places]
        stiffness = np.asarray(model.jnt_stiffness)[self.joints]
        if not stiffness.any():
            return 0.0, 0.0
        bent, slope, _ = np.polyfit(self.s, (0.5 * stiffness * stretched**2).sum(axis=1), 2)
        return max(0.0, 2 * float(bent)), -float(slope) - min(0.0, 2 * float(bent)) * float(self.s.mean())


def actuators_of(binding: Any, model: Any, data: Any, palm: int) -> list[int]:
    """Those that move nothing but what hangs on the palm by joints."""
    inside = _dofs_below(model, palm)
    moved = moments(binding, model, data) != 0
    return [int(i) for i in np.flatnonzero(moved.any(axis=1) & ~moved[:, ~inside].any(axis=1))]


def moments(binding: Any, model: Any, data: Any) -> np.ndarray:
    """(nu, nv): of each actuator the moment arms. Sparse or dense in MuJoCo, by its version."""
    if hasattr(data, "moment_rownnz"):
        dense = np.zeros((model.nu, model.nv))
        values = np.ravel(data.actuator_moment)
        for row, (count, first) in enumerate(zip(np.ravel(data.moment_rownnz), np.ravel(data.moment_rowadr))):
            dense[row, data.moment_colind[first:first + count]] = values[first:first + count]
        return dense
    return np.array(data.actuator_moment).reshape(model.nu, model.nv)


def sweep(binding: Any, model: Any, data: Any, palm: int, actuator: int) -> Sweep:
    """Raises haptic.HapticError where nothing moves, or the actuator has no range."""
    servo = servo_of(binding, model, data, actuator)
    led = _Led(binding, model, data, palm, actuator)
    lengths: list[float] = []
    poses, rows, of_all = [], [], []
    for target in np.linspace(servo.lower, servo.upper, _PLACES):
        led.go_to(target)
        if lengths and led.length - lengths[-1] < (servo.upper - servo.lower) * 1e-4:
            continue  # At its stop.
        lengths.append(led.length)
        poses.append(led.poses())
        rows.append(np.array(led.data.qpos))
        of_all.append(np.array(led.data.actuator_length)[:model.nu])
    name = actuator_name(binding, model, actuator)
    if len(lengths) < 3 * CURVE_TERMS // 2:
        raise haptic.HapticError(f"actuator {name!r} must move a jaw between {servo.lower:g} and {servo.upper:g}: at {len(lengths)} of "
                                 f"{_PLACES} places it came to rest elsewhere than at the one before")
    s, bodies = np.array(lengths), led.bodies
    positions = np.array([[X[0] for X in each] for each in poses])
    turns = _continuous(np.array([[X[1] for X in each] for each in poses]))
    motion = np.ptp(positions, axis=0).max(axis=1) + np.ptp(turns, axis=0).max(axis=1)
    moving = [i for i in range(len(bodies)) if motion[i] > _LEAST_MOTION]
    if not moving:
        raise haptic.HapticError(f"actuator {name!r} must move a jaw: no body on the palm moves while it goes from {s[0]:g} to {s[-1]:g}")
    x = (2 * s - s[0] - s[-1]) / (s[-1] - s[0])
    powers = x[:, None] ** np.arange(CURVE_TERMS)
    fingers, off = [], np.zeros(2)
    for i in moving:
        samples = np.hstack([positions[:, i], turns[:, i]])
        terms = np.linalg.lstsq(powers, samples, rcond=None)[0]
        fingers.append(Finger(bodies[i], terms))
        fitted = powers @ terms
        off = np.maximum(off, [np.linalg.norm(fitted[:, :3] - samples[:, :3], axis=1).max(), _apart(fitted[:, 3:], samples[:, 3:])])
    return Sweep(actuator, s, np.array(rows), np.array(of_all), fingers, *led.slopes(np.array(rows), s), servo, (float(off[0]), float(off[1])))


def find_actuator(binding: Any, model: Any, name: Any) -> int:
    """The number of the actuator of that name or number."""
    if isinstance(name, (int, np.integer)) and not isinstance(name, bool) and 0 <= name < model.nu:
        return int(name)
    if not isinstance(name, str):
        raise haptic.HapticError(f"jaw {_arguments.brief(name)} must be the name of an actuator, or a number from 0 to {model.nu - 1}")
    actuator = int(binding.mj_name2id(model, _ACTUATOR, name))
    if actuator < 0:
        raise haptic.HapticError(f"the model has no actuator {name!r}")
    return actuator


def actuator_name(binding: Any, model: Any, actuator: int) -> Any:
    return binding.mj_id2name(model, _ACTUATOR, actuator) or actuator


class _Led:
    """A copy of the model in which nothing touches and nothing weighs, and one actuator is a motor of ours."""

    def __init__(self, binding: Any, model: Any, data: Any, palm: int, actuator: int):
        self._binding, self._actuator, self._palm = binding, actuator, palm
        self._model = led = copy.copy(model)
        flags = binding.mjtDisableBit
        led.opt.disableflags |= int(flags.mjDSBL_CONTACT) | int(flags.mjDSBL_GRAVITY) | int(flags.mjDSBL_FRICTIONLOSS)
        # The actuators' lists are longer than nu where one has several outputs.
        led.actuator_gaintype[:], led.actuator_biastype[:], led.actuator_dyntype[:] = _FIXED, _NONE, _NONE
        led.actuator_gainprm[:] = led.actuator_biasprm[:] = 0
        led.actuator_gainprm[actuator, 0] = 1
        led.actuator_actadr[:], led.actuator_actnum[:] = -1, 0
        led.actuator_forcelimited[:] = led.actuator_ctrllimited[:] = False
        if hasattr(led, "jnt_actfrclimited"):
            led.jnt_actfrclimited[:] = False
        self._others = ~_dofs_below(model, palm)
        led.dof_armature[~self._others] += _CALM
        moved = moments(binding, model, data) != 0
        led.dof_armature[moved[actuator]] += _FIRM
        # What springs and dampers of these joints do is part of the drive.
        led.dof_damping[moved[actuator]], led.jnt_stiffness[moved.any(axis=0)[model.jnt_dofadr]], led.jnt_margin[:] = 0, 0, 0
        for name in ("dof_armature", "dof_M0"):  # For free joints MuJoCo reads the second alone.
            getattr(led, name)[self._others] += _HEAVY
        self.data = binding.MjData(led)
        self.data.qpos[:] = data.qpos
        self._let_go(data)
        self._kept = np.array(data.qpos)
        self._kept_places = _coordinates(model, self._others)
        self._come_to_rest()
        self._inertia = self._measured_inertia()
        of_body = carriers(model)
        below = _bodies_below(model, palm)
        self.bodies = sorted({int(of_body[body]) for body in below} - {int(of_body[palm])})

    def _let_go(self, data: Any) -> None:
        """Of what equalities hold of the palm, and of what is not on it."""
        model, below = self._model, set(_bodies_below(self._model, self._palm))
        active = np.array(getattr(data, "eq_active", getattr(model, "eq_active0", None)))
        of_site = np.asarray(model.site_bodyid)
        for i in range(model.neq):
            named = [int(each) for each in (model.eq_obj1id[i], model.eq_obj2id[i])]
            if model.eq_type[i] in (_CONNECT, _WELD) and getattr(model, "eq_objtype", [_BODY] * model.neq)[i] != _BODY:
                named = [int(of_site[each]) for each in named]
            if model.eq_type[i] in (_CONNECT, _WELD) and not below & set(named):
                active[i] = False
        if hasattr(data, "eq_active"):
            self.data.eq_active[:] = active

    @property
    def length(self) -> float:
        return float(self.data.actuator_length[self._actuator])

    def go_to(self, target: float) -> None:
        """As far as its stops and the mechanism let it."""
        step, w = self._model.opt.timestep, min(_QUICK, 0.2 / self._model.opt.timestep)
        before = np.inf
        for _ in range(int(_AT_REST / step)):
            speed = float(self.data.actuator_velocity[self._actuator])
            self.data.ctrl[self._actuator] = self._inertia * (w * w * (target - self.length) - 2 * w * speed)
            self._step()
            if abs(self.length - before) < _STILL * step and np.abs(self.data.qvel[~self._others]).max(initial=0) < 1e-4:
                break
            before = self.length

    def _come_to_rest(self) -> None:
        """What begins beyond a limit, or apart at a joint, is drawn where it belongs; it does not coast on."""
        damping = np.array(self._model.dof_damping)
        self._model.dof_damping[~self._others] += _RUN_IN_DAMPING
        for _ in range(int(_AT_REST / self._model.opt.timestep)):
            self._step()
        self._model.dof_damping[:] = damping
        self.data.qvel[:] = 0
        self._binding.mj_forward(self._model, self.data)

    def _step(self) -> None:
        self._binding.mj_step(self._model, self.data)
        self.data.qpos[self._kept_places] = self._kept[self._kept_places]
        self.data.qvel[self._others] = 0

    def _measured_inertia(self) -> float:
        """Of the coordinate, by what a unit force accelerates it by."""
        rest = self._acceleration(0)
        gained = self._acceleration(1) - rest
        if not gained > 0:
            raise haptic.HapticError(f"actuator {actuator_name(self._binding, self._model, self._actuator)!r} must move something: a force of 1 "
                                     f"accelerates it by {gained:g}")
        return 1 / gained

    def _acceleration(self, force: float) -> float:
        self.data.ctrl[:] = 0
        self.data.ctrl[self._actuator] = force
        self._binding.mj_forward(self._model, self.data)
        return float(moments(self._binding, self._model, self.data)[self._actuator] @ self.data.qacc)

    def poses(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Of the bodies in the palm's frame."""
        data, R = self.data, np.reshape(self.data.xmat[self._palm], (3, 3))
        self._binding.mj_kinematics(self._model, data)
        return [(R.T @ (data.xpos[body] - data.xpos[self._palm]),
                 quaternions((R.T @ np.reshape(data.xmat[body], (3, 3)))[None])[0]) for body in self.bodies]

    def slopes(self, rows: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Joints of one coordinate on the palm, where they are in qpos and in qvel, and dq/ds."""
        model = self._model
        joints = np.flatnonzero(~self._others[model.jnt_dofadr] & ~np.isin(model.jnt_type, (_FREE, _BALL)))
        places = np.asarray(model.jnt_qposadr)[joints]
        slopes = np.sqrt(np.mean(np.gradient(rows[:, places], s, axis=0)**2, axis=0))
        return joints, places, np.asarray(model.jnt_dofadr)[joints], slopes


def servo_of(binding: Any, model: Any, data: Any, actuator: int) -> Servo:
    """From its gain and bias: a position servo where it has one; else a motor, of which a servo of ours is made."""
    if model.actuator_dyntype[actuator] not in _DIRECT or model.actuator_gaintype[actuator] != _FIXED:
        raise haptic.HapticError(f"actuator {actuator_name(binding, model, actuator)!r} must be a motor or a position servo: others cannot be "
                                 "told what force they are to give")
    gain, bias = float(model.actuator_gainprm[actuator, 0]), np.asarray(model.actuator_biasprm)[actuator]
    controls = np.asarray(model.actuator_ctrlrange)[actuator] if model.actuator_ctrllimited[actuator] else None
    is_servo = model.actuator_biastype[actuator] == _AFFINE and bias[1] < 0
    most = _most_of(binding, model, data, actuator)
    reach = _reach(binding, model, data, actuator)
    if is_servo:
        rests = sorted((gain * control + bias[0]) / -bias[1] for control in controls) if controls is not None else reach
        if rests is None:
            raise haptic.HapticError(f"actuator {actuator_name(binding, model, actuator)!r} must have a range: write ctrlrange into it, or "
                                     "range into its joint")
        if reach is not None:
            rests = [max(rests[0], reach[0]), min(rests[1], reach[1])]
        _require_way(binding, model, actuator, rests)
        if most is None:
            most = -float(bias[1]) * (rests[1] - rests[0])
        return Servo(-float(bias[1]), max(0.0, -float(bias[2])), most, float(rests[0]), float(rests[1]))
    if reach is None:
        raise haptic.HapticError(f"actuator {actuator_name(binding, model, actuator)!r} must have a range: write range into its joint")
    _require_way(binding, model, actuator, reach)
    if controls is not None:
        by_control = abs(gain) * float(np.abs(controls).max())
        most = by_control if most is None else min(most, by_control)
    if most is None or not most > 0:
        raise haptic.HapticError(f"actuator {actuator_name(binding, model, actuator)!r} must have a largest force: write forcerange or "
                                 "ctrlrange into it")
    # All its force where it is a twentieth of its range away.
    return Servo(20 * most / (reach[1] - reach[0]), 0.0, most, float(reach[0]), float(reach[1]))


def has_range(binding: Any, model: Any, data: Any, actuator: int) -> bool:
    """Whether it, or the joints that it moves, have limits."""
    return bool(model.actuator_ctrllimited[actuator] and model.actuator_biasprm[actuator, 1] < 0) or _reach(binding, model, data, actuator) is not None


def _most_of(binding: Any, model: Any, data: Any, actuator: int) -> Optional[float]:
    """Its largest force, also by what its joints take."""
    limits = [float(np.abs(model.actuator_forcerange[actuator]).max())] if model.actuator_forcelimited[actuator] else []
    row = moments(binding, model, data)[actuator]
    for joint in np.flatnonzero(row[np.asarray(model.jnt_dofadr)] != 0):
        if hasattr(model, "jnt_actfrclimited") and model.jnt_actfrclimited[joint]:
            limits.append(float(np.abs(model.jnt_actfrcrange[joint]).max()) / abs(float(row[model.jnt_dofadr[joint]])))
    return min(limits, default=None)


def _require_way(binding: Any, model: Any, actuator: int, ends: Sequence[float]) -> None:
    if ends[1] - ends[0] < _LEAST_RANGE:
        raise haptic.HapticError(f"actuator {actuator_name(binding, model, actuator)!r} must move a jaw: its range is {ends[0]:g} to {ends[1]:g}")


def _reach(binding: Any, model: Any, data: Any, actuator: int) -> Optional[list[float]]:
    """The actuator's least and largest length, by the limits of the joints that it moves itself."""
    row, length = moments(binding, model, data)[actuator], float(data.actuator_length[actuator])
    ends = [length, length]
    for joint in np.flatnonzero(row[np.asarray(model.jnt_dofadr)] != 0):
        if not model.jnt_limited[joint]:
            return None
        arm, at = float(row[model.jnt_dofadr[joint]]), float(data.qpos[model.jnt_qposadr[joint]])
        ways = sorted(arm * (float(end) - at) for end in model.jnt_range[joint])
        ends = [ends[0] + ways[0], ends[1] + ways[1]]
    return ends if ends[1] > ends[0] else None


def _bodies_below(model: Any, palm: int) -> list[int]:
    below = np.zeros(model.nbody, bool)
    for body in range(palm + 1, model.nbody):
        parent = int(model.body_parentid[body])
        below[body] = parent == palm or below[parent]
    return np.flatnonzero(below).tolist()


def _dofs_below(model: Any, palm: int) -> np.ndarray:
    return np.isin(np.asarray(model.dof_bodyid), _bodies_below(model, palm))


def _coordinates(model: Any, dofs: np.ndarray) -> np.ndarray:
    """Of qpos: those of the joints of these dofs."""
    found = np.zeros(model.nq, bool)
    for joint in range(model.njnt):
        first, width = int(model.jnt_qposadr[joint]), {_FREE: 7, _BALL: 4}.get(int(model.jnt_type[joint]), 1)
        found[first:first + width] = dofs[model.jnt_dofadr[joint]]
    return found


def _continuous(turns: np.ndarray) -> np.ndarray:
    """(n, k, 4): a quaternion and its negative are one rotation: of each body those on one side."""
    for i in range(1, len(turns)):
        turns[i] *= np.where((turns[i] * turns[i - 1]).sum(axis=-1, keepdims=True) < 0, -1, 1)
    return turns


def _apart(fitted: np.ndarray, turns: np.ndarray) -> float:
    """Largest angle between two rows of quaternions, rad."""
    unit = fitted / np.linalg.norm(fitted, axis=1, keepdims=True)
    between = quaternions(np.array([rotation(a).T @ rotation(b) for a, b in zip(unit, turns)]))
    return max(float(np.linalg.norm(rotation_vector(each))) for each in between)
