"""A gripper of a MuJoCo model in the hand: its palm moves freely, and its jaws by one coordinate each actuator."""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import ArrayLike

import haptic_local_model as haptic
from haptic_local_model._library import CURVE_TERMS, Curve, Drive, Link
from haptic_local_model._mujoco_arm import Arm, arm_of
from haptic_local_model._mujoco_bodies import Bodies
from haptic_local_model._mujoco_shapes import Parts, carriers
from haptic_local_model._mujoco_sweep import Sweep, actuator_name, actuators_of, find_actuator, moments, sweep
from haptic_local_model._mujoco_tool import find_body
from haptic_local_model._world import rotation

_MOST_ACTUATORS = 4
_MOST_LINKS = 16
_AFFINE = 1  # mjBIAS_AFFINE
_WELL_SWEPT = (3e-4, 0.0087)  # m, rad: by which a finger may be off its curve without a warning
_LEAST_TRAVEL = 1e-4  # m
_STILL = 1e-6  # m or rad: of what a jaw does not move


def palm_of(binding: Any, model: Any, body: int) -> int:
    """The palm of the gripper that a body is a part of: itself or what carries it; 0: none."""
    data = binding.MjData(model)
    binding.mj_forward(model, data)
    while body > 0:
        found = actuators_of(binding, model, data, body)
        if 0 < len(found) <= _MOST_ACTUATORS:
            return _with_mount(model, body) if _carry_no_jaws(binding, model, data, body, found) else 0
        body = int(model.body_parentid[body])
    return 0


def _with_mount(model: Any, palm: int) -> int:
    """The first one of the bodies without joints that a palm is fixed to."""
    while model.body_dofnum[palm] == 0 and model.body_parentid[palm] > 0 and model.body_dofnum[model.body_parentid[palm]] == 0:
        palm = int(model.body_parentid[palm])
    return palm


def _carry_no_jaws(binding: Any, model: Any, data: Any, palm: int, actuators: Sequence[int]) -> bool:
    """Whether no body that one of them moves carries what another one alone moves: then they are joints of an arm."""
    return all(len(actuators_of(binding, model, data, int(model.body_parentid[body]))) >= len(actuators)
               for body in range(palm + 1, model.nbody) for actuator in actuators
               if moments(binding, model, data)[actuator][np.asarray(model.dof_bodyid) == body].any())


class Jaw(NamedTuple):
    """What one actuator moves, by q, m: the way of its farthest body from the lower end of the actuator's length."""
    sweep: Sweep
    ratio: float  #: m of q for each unit of the actuator's length
    link: int  #: of the tool, which leads
    actuators: tuple[int, ...]  #: that move it
    closed: float  #: q of the closed jaw,
    open: float  #: and of the open one.

    def q(self, s: float) -> float:
        return (s - float(self.sweep.s[0])) * self.ratio

    def drive(self, target: float, follows_device: bool) -> Drive:
        servo, r = self.sweep.servo, self.ratio
        return Drive(link=self.link, follows_device=follows_device, target=target, closed=self.closed, open=self.open,
                     stiffness=servo.stiffness / r**2, damping=servo.damping / r**2, most=servo.most / r)


class Gripper:
    """The tool of a session, as _mujoco_tool.Tool. palm: its body; jaws: actuators by name or number, default: all that move nothing but
    what hangs on the palm."""

    is_ghost = True

    def __init__(self, binding: Any, model: Any, data: Any, palm: Any, jaws: Sequence[Any], bodies: Bodies, period: float):
        self._binding, self._model, self._bodies = binding, model, bodies
        self.body = find_body(binding, model, palm, "gripper")
        self.jaws = self._swept(data, self._actuators(data, jaws))
        moved = [finger.body for jaw in self.jaws for finger in jaw.sweep.fingers]
        links = {self.body: 0, **{body: 1 + i for i, body in enumerate(moved)}}
        self._arm: Arm = arm_of(binding, model, data, self.body, links, period)
        self.kept = self._arm.kept
        self._of_geom = self._carriers_of_geoms()
        ghosts = (self._arm.bodies | set(self._around())) - set(links)
        self.parts = Parts(links, frozenset(ghosts), self._apart(links))
        self.geoms = np.flatnonzero(np.isin(self._of_geom, [*links, *ghosts]))
        self._felt = np.flatnonzero(np.isin(self._of_geom, [*links]))
        self.size = 2 * self.arm(data)
        self._sent = self.configuration(data), np.zeros(6 + len(self.jaws))
        #: 0 closed to 1 open; None: the device's gripper leads, or where it has none its first button, which opens and closes.
        self.target: Optional[float] = None
        self._opening = self._by_button = self._opening_of(self._present_q(data))
        self._was_down = False

    def warn(self) -> None:
        off = np.max([jaw.sweep.error for jaw in self.jaws], axis=0)
        if (off > _WELL_SWEPT).any():
            warnings.warn(f"the jaws are off their curves by up to {1e3 * off[0]:.2g} mm and {np.degrees(off[1]):.2g} degrees", stacklevel=4)
        if len(self._felt) == 0:
            warnings.warn("the gripper has no geoms: nothing is felt", stacklevel=4)

    def links(self) -> list[Link]:
        made = [self._link(self.body)]
        for jaw in self.jaws:
            for i, finger in enumerate(jaw.sweep.fingers):
                link = self._link(finger.body)
                link.parent, link.joint = 0, haptic.JOINTS["guided" if i == 0 else "following"]
                link.lower, link.upper = 0, jaw.q(float(jaw.sweep.s[-1]))
                made.append(link)
        return made

    def curves(self) -> list[Curve]:
        made = []
        for jaw in self.jaws:
            for i, finger in enumerate(jaw.sweep.fingers):
                curve = Curve(link=jaw.link + i, leader=jaw.link, armature=jaw.sweep.armature / jaw.ratio**2 if i == 0 else 0)
                for to, terms in zip(curve.terms, finger.terms):
                    to[:] = terms
                made.append(curve)
        return made

    def is_told(self, gravity: Optional[ArrayLike]) -> None:
        """An arm carries it, or the hand does."""

    def weigh(self) -> None:
        """As Tool.weigh()."""

    def gravity(self) -> np.ndarray:
        """What the hand feels of its weight, m/s²: nothing, where an arm carries it."""
        return self._bodies.gravity_on(self.body) if self._arm.is_free else np.zeros(3)

    def arm(self, data: Any) -> float:
        """From the palm's origin to its farthest point, m."""
        places = np.linalg.norm(np.asarray(data.geom_xpos)[self._felt] - data.xpos[self.body], axis=1)
        return float((places + np.asarray(self._model.geom_rbound)[self._felt]).max(initial=0.05))

    def configuration(self, data: Any) -> np.ndarray:
        """Where it is in the engine: pose of the palm, and q of each jaw."""
        return np.concatenate([data.xpos[self.body], data.xquat[self.body], self._present_q(data)])

    def sample(self, data: Any) -> tuple[np.ndarray, np.ndarray]:
        """As the server has them: it is where it was sent, however well the arm follows."""
        return self._sent

    def place(self, data: Any, q: np.ndarray, v: np.ndarray) -> None:
        """Before a frame: palm, jaws and what carries them."""
        self._sent, self._opening = (q, v), self._opening_of(q[7:])
        self._arm.follow(data, q[:7], v[:6])
        for jaw, at, speed in zip(self.jaws, q[7:], v[6:]):
            s = float(np.clip(at, 0, jaw.q(float(jaw.sweep.s[-1])))) / jaw.ratio + float(jaw.sweep.s[0])
            self._put_jaw(data, jaw, s, float(speed) / jaw.ratio)

    def press(self, buttons: int) -> None:
        """Bit 0: the device's first button is down."""
        if buttons & 1 and not self._was_down:
            self._by_button = 0.0 if self._by_button > 0.5 else 1.0
        self._was_down = bool(buttons & 1)

    def drives(self) -> list[Drive]:
        """Of the next update."""
        target = self._by_button if self.target is None else self.target
        return [jaw.drive(jaw.closed + target * (jaw.open - jaw.closed), self.target is None) for jaw in self.jaws]

    @property
    def opening(self) -> float:
        """0 closed to 1 open, of the proxy."""
        return self._opening

    def follow_error(self, data: Any) -> float:
        """How far the engine's palm is from where the hand has it, m."""
        return self._arm.error(data)

    def external_wrench(self, data: Any) -> np.ndarray:
        """As Tool: nothing, as an arm carries it."""
        return np.zeros(6)

    def _actuators(self, data: Any, jaws: Sequence[Any]) -> list[int]:
        binding, model = self._binding, self._model
        name = binding.mj_id2name(model, 1, self.body) or self.body
        found = actuators_of(binding, model, data, self.body)
        if len(jaws):
            named = [find_actuator(binding, model, jaw) for jaw in jaws]
            wrong = next((each for each in named if each not in found), None)
            if wrong is not None:
                raise haptic.HapticError(f"actuator {actuator_name(binding, model, wrong)!r} must move what hangs on {name!r}, and nothing else")
            return named
        if not found:
            raise haptic.HapticError(f"body {name!r} must be the palm of a gripper: no actuator moves what hangs on it, and nothing else")
        if not _carry_no_jaws(binding, model, data, self.body, found):
            raise haptic.HapticError(f"body {name!r} must be the palm of a gripper: what hangs on it is an arm, whose hand it is not")
        if len(found) > _MOST_ACTUATORS:
            names = ", ".join(repr(actuator_name(binding, model, each)) for each in found)
            raise haptic.HapticError(f"body {name!r} has {len(found)} actuators on it, {names}: name those of its jaws, at most {_MOST_ACTUATORS}")
        return found

    def _swept(self, data: Any, actuators: list[int]) -> list[Jaw]:
        """Actuators that move the same bodies are one jaw, which the first leads."""
        jaws: list[Jaw] = []
        known: dict[int, int] = {}
        link = 1
        for actuator in actuators:
            led = sweep(self._binding, self._model, data, self.body, actuator)
            shared = next((known[finger.body] for finger in led.fingers if finger.body in known), None)
            if shared is not None:
                first = jaws[shared].sweep
                stronger = first.servo._replace(most=first.servo.most + led.servo.most, stiffness=first.servo.stiffness + led.servo.stiffness,
                                                damping=first.servo.damping + led.servo.damping)
                jaws[shared] = jaws[shared]._replace(sweep=first._replace(servo=stronger), actuators=(*jaws[shared].actuators, actuator))
                continue
            known.update((finger.body, len(jaws)) for finger in led.fingers)
            ratio = self._travel(led) / float(led.s[-1] - led.s[0])
            jaw = Jaw(led, ratio, link, (actuator,), 0.0, 0.0)
            lower, upper = (float(np.clip(each, led.s[0], led.s[-1])) for each in (led.servo.lower, led.servo.upper))
            ends = jaw.q(lower), jaw.q(upper)
            closed, open_ = ends if self._is_closed_first(data, led) else ends[::-1]
            jaws.append(jaw._replace(closed=closed, open=open_))
            link += len(led.fingers)
        if link > _MOST_LINKS:
            raise haptic.HapticError(f"the gripper has {link} bodies that move, and may have {_MOST_LINKS}")
        return jaws

    def _travel(self, led: Sweep) -> float:
        """Way of the body whose geoms go farthest, m."""
        x = np.linspace(-1, 1, 41)[:, None] ** np.arange(CURVE_TERMS)
        longest = _LEAST_TRAVEL
        for finger in led.fingers:
            poses = x @ finger.terms
            centre = self._centre_of(finger.body)
            ways = np.array([pose[:3] + rotation(pose[3:] / np.linalg.norm(pose[3:])) @ centre for pose in poses])
            longest = max(longest, float(np.linalg.norm(np.diff(ways, axis=0), axis=1).sum()))
        return longest

    def _centre_of(self, body: int) -> np.ndarray:
        """Of the geoms of a body with what is welded to it, in its frame, m."""
        return self._bodies.inertia(body)[1]

    def _is_closed_first(self, data: Any, led: Sweep) -> bool:
        """Whether the jaws are closer together at the lower end of the actuator's length: by a copy of the data."""
        gaps = []
        for row in (led.qpos[0], led.qpos[-1]):
            at = self._binding.MjData(self._model)
            at.qpos[:] = row
            self._binding.mj_kinematics(self._model, at)
            gaps.append(self._gap(at, [finger.body for finger in led.fingers]))
        return gaps[0] <= gaps[1]

    def _gap(self, data: Any, bodies: list[int]) -> float:
        """Between the farthest geoms of the fingers, and what else is on the gripper as far out: m."""
        of_geom = self._carriers_of_geoms()
        own = np.flatnonzero(np.isin(of_geom, bodies))
        below = np.flatnonzero(np.isin(of_geom, self._around()))
        away = np.linalg.norm(np.asarray(data.geom_xpos)[own] - data.xpos[self.body], axis=1)
        tips = own[away >= 0.8 * away.max(initial=0)]
        between = []
        for tip in tips:
            others = below[of_geom[below] != of_geom[tip]]
            apart = np.linalg.norm(np.asarray(data.geom_xpos)[others] - data.geom_xpos[tip], axis=1)
            between.append(apart.min(initial=np.inf))
        return float(np.mean(between)) if between else 0.0

    def _carriers_of_geoms(self) -> np.ndarray:
        is_palm = np.arange(self._model.nbody) == self.body
        return np.asarray(carriers(self._model, is_palm)[self._model.geom_bodyid])

    def _apart(self, links: dict[int, int]) -> frozenset[tuple[int, int]]:
        """Of the palm with the jaws, of what one branch of the palm carries, and what overlaps while the jaws are open."""
        branch = {body: self._branch(body) for body in links}
        geoms = np.flatnonzero(np.isin(self._of_geom, [*links])).tolist()
        overlapping = self._overlapping()
        return frozenset((one, other) for one in geoms for other in geoms if one < other and (
            self.body in (a := int(self._of_geom[one]), b := int(self._of_geom[other])) or branch[a] == branch[b]
            or (one, other) in overlapping) and self._of_geom[one] != self._of_geom[other])

    def _branch(self, body: int) -> int:
        """The body on the palm that carries it."""
        while body != self.body and int(self._model.body_parentid[body]) != self.body and body != 0:
            body = int(self._model.body_parentid[body])
        return body

    def _overlapping(self) -> set[tuple[int, int]]:
        found = set()
        for jaw in self.jaws:
            rows = jaw.sweep.qpos if jaw.open > jaw.closed else jaw.sweep.qpos[::-1]
            for row in rows[len(rows) // 2:]:
                at = self._binding.MjData(self._model)
                at.qpos[:] = row
                self._binding.mj_kinematics(self._model, at)
                self._binding.mj_comPos(self._model, at)
                self._binding.mj_collision(self._model, at)
                found |= {(min(pair), max(pair)) for pair in zip(np.asarray(at.contact.geom1)[:at.ncon].tolist(),
                                                                 np.asarray(at.contact.geom2)[:at.ncon].tolist())}
        return found

    def _around(self) -> list[int]:
        """Bodies of the palm and of all that moves on it."""
        model, of_body = self._model, carriers(self._model)
        inside = {int(of_body[self.body])}
        for body in range(self.body + 1, model.nbody):
            if int(of_body[model.body_parentid[body]]) in inside:
                inside.add(int(of_body[body]))
        return sorted(inside)

    def _link(self, body: int) -> Link:
        mass, centre, inertia = self._bodies.inertia(body)
        link = haptic.box(mass=mass, size=(0, 0, 0))
        link.centre[:], link.inertia[:] = centre, inertia.ravel()
        return link

    def _present_q(self, data: Any) -> np.ndarray:
        return np.array([np.clip(jaw.q(float(data.actuator_length[jaw.sweep.actuator])), 0, jaw.q(float(jaw.sweep.s[-1])))
                         for jaw in self.jaws])

    def _opening_of(self, q: np.ndarray) -> float:
        return float(np.mean([(at - jaw.closed) / (jaw.open - jaw.closed) for jaw, at in zip(self.jaws, q)]))

    def _put_jaw(self, data: Any, jaw: Jaw, s: float, speed: float) -> None:
        """Its joints as the sweep had them, and servos where they leave them alone."""
        model, led = self._model, jaw.sweep
        for actuator in jaw.actuators:
            gain, bias = float(model.actuator_gainprm[actuator, 0]), np.asarray(model.actuator_biasprm)[actuator]
            if model.actuator_biastype[actuator] != _AFFINE or bias[1] >= 0 or gain == 0:
                data.ctrl[actuator] = 0
                continue
            control = -(bias[0] + bias[1] * np.interp(s, led.s, led.lengths[:, actuator])) / gain
            least, most = model.actuator_ctrlrange[actuator] if model.actuator_ctrllimited[actuator] else (-np.inf, np.inf)
            data.ctrl[actuator] = np.clip(control, least, most)
        for joint in np.flatnonzero(np.isin(model.jnt_bodyid, self._around())):
            at, along = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
            column = led.qpos[:, at]
            if int(model.jnt_bodyid[joint]) == self.body or np.ptp(column) < _STILL:
                continue  # It is another jaw's.
            data.qpos[at] = np.interp(s, led.s, column)
            slope = np.interp(s, led.s, np.gradient(column, led.s))
            data.qvel[along] = slope * speed
