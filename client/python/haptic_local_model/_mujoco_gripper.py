"""A gripper of a MuJoCo model in the hand: its palm moves freely, and its jaws by one coordinate each actuator."""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import ArrayLike

import haptic_local_model as haptic
from haptic_local_model import _arguments
from haptic_local_model._library import CURVE_TERMS, Curve, Drive, Link
from haptic_local_model._mujoco_arm import Arm, arm_of
from haptic_local_model._mujoco_bodies import Bodies
from haptic_local_model._mujoco_shapes import Parts, carriers
from haptic_local_model._mujoco_sweep import Servo, Sweep, actuator_name, actuators_of, find_actuator, has_range, moments, servo_of, sweep
from haptic_local_model._mujoco_tool import find_body
from haptic_local_model._world import rotation

_MOST_ACTUATORS = 4
_MOST_LINKS = 16
_AFFINE = 1  # mjBIAS_AFFINE
_AS_FAR_OUT = 0.7  # of the farthest geom
_WELL_SWEPT = (3e-4, 0.0087)  # m, rad: by which a finger may be off its curve without a warning
_LEAST_TRAVEL = 1e-4  # m
_LEAST_GEAR = 0.01  # of an actuator that moves with the one that is led
_STILL = 1e-6  # m or rad: of what a jaw does not move


def palm_of(binding: Any, model: Any, body: int) -> int:
    """The palm of the gripper that a body is a part of: itself or what carries it; 0: none."""
    data = binding.MjData(model)
    binding.mj_forward(model, data)
    while body > 0:
        found = actuators_of(binding, model, data, body)
        if 0 < len(found) <= _MOST_ACTUATORS:
            is_one = _carry_no_jaws(binding, model, data, body, found) and all(
                has_range(binding, model, data, actuator) for actuator in found) and _has_jaws(binding, model, data, found)
            return _with_mount(model, body) if is_one else 0
        body = int(model.body_parentid[body])
    return 0


def _has_jaws(binding: Any, model: Any, data: Any, actuators: Sequence[int]) -> bool:
    """Whether they move two bodies or more, or one beside a palm that has geoms of its own."""
    moved = {int(body) for actuator in actuators for body in
             np.asarray(model.dof_bodyid)[moments(binding, model, data)[actuator] != 0]}
    palms = {int(model.body_parentid[body]) for body in moved}
    return len(moved) > 1 or bool(np.isin(model.geom_bodyid, [*palms]).any())


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


def _gear(led: Sweep, actuator: int) -> float:
    """By how much the length of another actuator changes with that of the one that is led."""
    return abs(float(led.lengths[-1, actuator] - led.lengths[0, actuator])) / float(led.s[-1] - led.s[0])


class Jaw(NamedTuple):
    """What one actuator moves, by q, m: the way of its farthest body from the lower end of the actuator's length."""
    sweep: Sweep
    ratio: float  #: m of q for each unit of the actuator's length
    link: int  #: of the tool, which leads
    actuators: tuple[int, ...]  #: that move it
    closed: float  #: q of the closed jaw,
    open: float  #: and of the open one.
    servo: Servo  #: of all of them,
    spring: tuple[float, float]  #: and what the joints do themselves: Sweep.spring(),
    damping: float  #: and N s/m or N m s/rad of s.

    def q(self, s: float) -> float:
        return (s - float(self.sweep.s[0])) * self.ratio

    def drive(self, target: float, follows_device: bool) -> Drive:
        """Servo and springs are one spring, which rests where they are in balance."""
        r, (k, pull) = self.ratio, self.spring
        both = self.servo.stiffness + k

        def balance(q: float) -> float:
            return self.q((self.servo.stiffness * (q / r + float(self.sweep.s[0])) + pull) / both)

        return Drive(link=self.link, follows_device=follows_device, target=balance(target), closed=balance(self.closed), open=balance(self.open),
                     stiffness=both / r**2, damping=(self.servo.damping + self.damping) / r**2, most=self.servo.most / r)


class Gripper:
    """The tool of a session, as _mujoco_tool.Tool. palm: its body; jaws: actuators by name or number, default: all that move nothing but
    what hangs on the palm."""

    is_ghost = True

    def __init__(self, binding: Any, model: Any, data: Any, palm: Any, jaws: Sequence[Any], bodies: Bodies, period: float):
        self._binding, self._model, self._bodies = binding, model, bodies
        binding.mj_forward(model, data)
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
        self._stated: Optional[np.ndarray] = None
        self._known = self._servos()
        self._told = self._weighs = self._weights()

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
                armature = jaw.sweep.of_joints(self._model.dof_armature) / jaw.ratio**2 if i == 0 else 0
                curve = Curve(link=jaw.link + i, leader=jaw.link, armature=armature)
                for to, terms in zip(curve.terms, finger.terms):
                    to[:] = terms
                made.append(curve)
        return made

    def is_told(self, gravity: Optional[ArrayLike]) -> None:
        """The server knows it as it is now, with gravity as stated, m/s²; None: as the model has it."""
        self._stated = None if gravity is None else np.array(gravity, dtype=float)
        self._told = self._weights()

    def weigh(self) -> None:
        """The model has changed."""
        self._weighs, self._known = self._weights(), b""

    def gravity(self) -> np.ndarray:
        """What the hand feels of its weight, m/s²: nothing, where an arm carries it."""
        return self._bodies.gravity_on(self.body) if self._arm.is_free else np.zeros(3)

    def _weights(self) -> np.ndarray:
        """(links, 3), N."""
        gravity = self.gravity() if self._stated is None else self._stated
        return np.array([self._bodies.inertia(body)[0] * gravity for body in self.parts.links])

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

    def _servos(self) -> bytes:
        model = self._model
        return b"".join(np.asarray(each).tobytes() for each in (
            model.actuator_gainprm, model.actuator_biasprm, model.actuator_forcerange, model.actuator_ctrlrange))

    def _look_again(self) -> None:
        """At what drives the jaws, where the model has changed."""
        before, self._known = self._known, self._servos()
        if self._known == before:
            return
        at = self._binding.MjData(self._model)
        self._binding.mj_forward(self._model, at)
        for i, jaw in enumerate(self.jaws):
            try:
                self.jaws[i] = self._as_it_is(at, jaw)
            except haptic.HapticError:  # Neither servo nor motor any more: it does nothing.
                self.jaws[i] = jaw._replace(servo=jaw.servo._replace(most=0.0))

    def drives(self, is_ready: bool) -> list[Drive]:
        """Of the next update. Until the server is ready, jaws stay where they are: they would go through what is between them."""
        self._look_again()
        if not is_ready:
            return [jaw.drive(at, False) for jaw, at in zip(self.jaws, self._sent[0][7:])]
        target = self._by_button if self.target is None else self.target
        return [jaw.drive(jaw.closed + target * (jaw.open - jaw.closed), self.target is None) for jaw in self.jaws]

    @property
    def opening(self) -> float:
        """0 closed to 1 open, of the proxy."""
        return min(max(self._opening, 0.0), 1.0)

    def follow_error(self, data: Any) -> float:
        """How far the engine's palm is from where the hand has it, m."""
        return self._arm.error(data)

    def external_wrench(self, data: Any) -> np.ndarray:
        """On the palm, N and N m about its origin, world axes: what its weight has changed by."""
        wrench, more = np.zeros(6), self._weighs - self._told
        for body, force in zip(self.parts.links, more) if more.any() else ():
            arm = data.xpos[body] + np.reshape(data.xmat[body], (3, 3)) @ self._bodies.inertia(body)[1] - data.xpos[self.body]
            wrench += np.concatenate([force, np.cross(arm, force)])
        return wrench

    def _actuators(self, data: Any, jaws: Sequence[Any]) -> list[int]:
        binding, model = self._binding, self._model
        name = binding.mj_id2name(model, 1, self.body) or self.body
        found = actuators_of(binding, model, data, self.body)
        if isinstance(jaws, str) or not isinstance(jaws, Sequence):
            raise haptic.HapticError(f"jaws {_arguments.brief(jaws)} must be a list of actuators, by name or number")
        if len(jaws):
            named = [find_actuator(binding, model, jaw) for jaw in jaws]
            wrong = next((each for each in named if each not in found), None)
            if len(set(named)) < len(named):
                raise haptic.HapticError(f"jaws {_arguments.brief(list(jaws))} must be different actuators")
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
        """Actuators that move each other are one jaw, which the first leads."""
        jaws: list[Jaw] = []
        known: dict[int, int] = {}
        link = 1
        for actuator in actuators:
            led = sweep(self._binding, self._model, data, self.body, actuator)
            shared = next((known[finger.body] for finger in led.fingers if finger.body in known), None)
            if shared is not None:
                first = jaws[shared]
                if _gear(first.sweep, actuator) < _LEAST_GEAR or _gear(led, first.sweep.actuator) < _LEAST_GEAR:
                    names = [actuator_name(self._binding, self._model, each) for each in (first.sweep.actuator, actuator)]
                    raise haptic.HapticError(f"actuators {names[0]!r} and {names[1]!r} must not move one body, each on its own: what they "
                                             "move would need two coordinates")
                jaws[shared] = self._as_it_is(data, first._replace(actuators=(*first.actuators, actuator)))
                continue
            known.update((finger.body, len(jaws)) for finger in led.fingers)
            ratio = self._travel(led) / float(led.s[-1] - led.s[0])
            jaw = self._as_it_is(data, Jaw(led, ratio, link, (actuator,), 0.0, 0.0, led.servo, (0.0, 0.0), 0.0))
            lower, upper = (float(np.clip(each, led.s[0], led.s[-1])) for each in (led.servo.lower, led.servo.upper))
            ends = jaw.q(lower), jaw.q(upper)
            closed, open_ = ends if self._is_closed_first(data, led) else ends[::-1]
            jaws.append(jaw._replace(closed=closed, open=open_))
            link += len(led.fingers)
        if link > _MOST_LINKS:
            raise haptic.HapticError(f"the gripper has {link} bodies that move, and may have {_MOST_LINKS}")
        return jaws

    def _as_it_is(self, data: Any, jaw: Jaw) -> Jaw:
        """With servos, springs and damping as the model has them now."""
        model, led, servo = self._model, jaw.sweep, jaw.sweep.servo._replace(stiffness=0.0, damping=0.0, most=0.0)
        for actuator in jaw.actuators:
            one, gear = servo_of(self._binding, model, data, actuator), _gear(led, actuator)
            servo = servo._replace(stiffness=servo.stiffness + one.stiffness * gear**2, damping=servo.damping + one.damping * gear**2,
                                   most=servo.most + one.most * gear)
        return jaw._replace(servo=servo, spring=led.spring(model), damping=led.of_joints(model.dof_damping))

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
        """Whether the tips are closer together at the lower end of the actuator's length. Tips: geoms as far out as the farthest, about."""
        ends = [self._binding.MjData(self._model) for _ in range(2)]
        for at, row in zip(ends, (led.qpos[0], led.qpos[-1])):
            at.qpos[:] = row
            self._binding.mj_kinematics(self._model, at)
        of_geom = self._carriers_of_geoms()
        own = np.flatnonzero(np.isin(of_geom, self._around()))
        away = np.min([np.linalg.norm(np.asarray(at.geom_xpos)[own] - at.xpos[self.body], axis=1) for at in ends], axis=0)
        tips = {int(carrier): own[(of_geom[own] == carrier) & (away >= _AS_FAR_OUT * away.max(initial=0))] for carrier in of_geom[own]}
        gaps = []
        for at in ends:
            places = [np.asarray(at.geom_xpos)[geoms].mean(axis=0) for geoms in tips.values() if len(geoms)]
            if len(places) < 2:  # One jaw beside a palm without a tip.
                of_palm = np.asarray(at.geom_xpos)[own[of_geom[own] == self.body]]
                places.append(of_palm.mean(axis=0) if len(of_palm) else np.asarray(at.xpos)[self.body])
            gaps.append(np.mean([np.linalg.norm(one - other) for k, one in enumerate(places) for other in places[:k]]))
        return bool(gaps[0] <= gaps[1])

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
