"""A MuJoCo world in the hand.

    with haptic.mujoco.Session(model, data, tool="peg") as touch:
        while touch.running:
            for _ in range(touch.drive(data)):  # proxy pose onto the tool, impulses onto bodies
                mujoco.mj_step(model, data)
            touch.send(data)                    # where bodies are, and what the tool can push

drive() returns how many steps bring MuJoCo's time up to the hand's, so the loop may run at any rate and come late; it
returns 0 where less than a step has passed.

`model` and `data` are those of the official binding. The tool is a body with a free joint. While the server
answers, its geoms make no force of their own: the tool is where the proxy is, and bodies are pushed by
the impulses that the hand felt. Any body with degrees of freedom can be pushed; what its joints leave of
its mobility is computed at the present pose, without the centripetal part of its acceleration. From drive() to send()
these pushes are a part of data.xfrc_applied; a force of your own there stays: set it before drive().

With data.mocap_pos and data.mocap_quat of a mocap body given to hold() in each frame, the mouse in MuJoCo's viewer is the hand.

The hand also feels what else pushes the tool: equalities (weld, connect), tendons, actuators, springs, fluids, and what you
put into qfrc_applied and xfrc_applied.

What you change in the model while it is felt (sizes, places, masks, friction, masses, gravity, equalities, the time step) is
felt within half a second: the shapes are offered again. A body that stood still and is moved pushes the tool, as a mocap body
does. A shape that appears or grows inside the tool is felt once the hand has moved away from it: it does no work.
After close() the model is as it was.

    python3 -m haptic_local_model.mujoco check MODEL.xml [--tool NAME]

says what of a model is approximated or ignored, and which bodies the server holds; so do check() and Session.check().
"""

from __future__ import annotations

import importlib
import os
import sys
import warnings
from typing import Any, Callable, Optional, Sequence

import numpy as np

import haptic_local_model as haptic
from haptic_local_model import _arguments, _mujoco_check
from haptic_local_model._mujoco_bodies import Bodies
from haptic_local_model._mujoco_changes import Changes, Pushes
from haptic_local_model._mujoco_check import Finding, check
from haptic_local_model._mujoco_listing import Listing
from haptic_local_model._mujoco_shapes import Parts, Shapes, moving_bodies, version_of
from haptic_local_model._mujoco_tool import Tool, find_tool
from haptic_local_model._mujoco_gripper import Gripper
from haptic_local_model._mujoco_watch import Watch
from haptic_local_model._world import EngineSession, Frames, NearBodies

_BODY = 1  # mjOBJ_BODY
_SPHERE, _REVOLVES = 2, (2, 3, 5)  # mjGEOM_SPHERE; and mjGEOM_CAPSULE, mjGEOM_CYLINDER
_OFF_AXIS = 1e-6  # m: an axis through the centre of mass passes it no farther away
_OF_JOINT, _AFFINE = 0, 1  # mjTRN_JOINT, mjBIAS_AFFINE
_ELLIPTIC = 1  # mjCONE_ELLIPTIC


def _warn_of_sparse(binding: Any, model: Any) -> None:
    if binding.mj_versionString() == "4.0.0" and binding.mj_isSparse(model):
        warnings.warn("MuJoCo 4.0.0 has wrong accelerations where its Jacobian is sparse, as this model's is, and the hand would "
                      "feel them: use 4.0.1 or 3.17.0, or write <option jacobian=\"dense\"/>", stacklevel=3)


class Session(EngineSession):
    """A client for one model.

    tool: name or number of a body with a free joint; what is welded to it is a part of it. period: about that of your frames, s. After a
    silence of four and a half of them the server lets go of the tool and of bodies. binding: the module `mujoco`, or one with its
    functions. Other arguments are those of haptic.Session. Raises haptic.HapticError where the model has no such tool.

    contacts: "shapes" gives the server the geoms once and their poses in each frame, and it finds the contacts at every step
    of the hand, exact and however late a frame comes. "engine" takes MuJoCo's own. Default: shapes, or with a warning MuJoCo's
    own where the tool has none or the server takes none. With shapes, too, the contacts of a geom that is none (an SDF, a
    height field) are MuJoCo's own; a warning names it.

    MuJoCo's own contacts change the model: those geoms are listed `epsilon` before they touch, and have their force where they
    had it. Before MuJoCo 3.12 boxes that do not touch can have deep contacts: take "shapes". A flex is not felt, nor is a geom's
    adhesion. A mocap body is a wall, with those contacts one without a velocity.
    """

    def __init__(self, model: Any, data: Any, tool: Optional[str | int] = None, *, gripper: Optional[str | int] = None,
                 jaws: Sequence[str | int] = (), epsilon: float = 0.005,
                 period: float = 1 / 60, contacts: Optional[str] = None,
                 binding: Any = None, **options: Any):
        binding = _binding(binding)
        _require_data_of(model, data)
        if contacts not in (None, "engine", "shapes"):
            raise haptic.HapticError(f"contacts {contacts!r} must be 'engine' or 'shapes'")
        epsilon = _arguments.number(epsilon, "epsilon", 0, 1, "m")
        period = _arguments.number(period, "period", 1e-5, 100, "s")
        self._binding, self._model, self._version = binding, model, version_of(binding)
        if (tool is None) == (gripper is None):
            raise haptic.HapticError("a session must have either a tool or a gripper")
        if gripper is not None and contacts == "engine":
            raise haptic.HapticError("contacts 'engine' must be 'shapes' with a gripper: MuJoCo's own contacts of jaws are not felt")
        self._begin = 0.0  # s: MuJoCo's time when the present frame began, and
        self._ended = -np.inf  # when the one before ended.
        self._was_reset = False  # in between
        self._taken: set[int] = set()  # bodies that the hand held, and the user has put elsewhere
        self._warned, self._warned_of_shapes, self._follow_error = False, False, 0.0
        self._epsilon, self._changes, self._pushes, self._near_bodies = epsilon, Changes(model), Pushes(), NearBodies()
        self._placed = Bodies(binding, model, (), self._changes)
        self._tool: Tool | Gripper = (Tool(binding, model, find_tool(binding, model, tool), self._placed) if gripper is None else
                                      Gripper(binding, model, data, gripper, jaws, self._placed, period))
        self._placed.tool = {*self._tool.parts.links, *self._tool.parts.ghosts}
        self._tool.warn()
        self._listing = Listing(model, self._changes, self._version, epsilon, self._tool.geoms)
        self._shapes = None if contacts == "engine" else self._usable_shapes(needs_them=contacts == "shapes" or self._tool.is_ghost)
        _warn_of_sparse(binding, model)
        self._bodies_of_geoms = moving_bodies(model)[model.geom_bodyid]
        parents, moves = np.asarray(model.body_weldid)[model.body_parentid], np.asarray(model.body_dofnum) > 0
        self._hanging = np.column_stack([np.flatnonzero(moves & moves[parents]), parents[moves & moves[parents]]])
        self._round = self._round_geoms()
        defaults = {"length": self._tool.size, "gravity": self._tool.gravity(), "rate": 1 / period}
        self.touch = haptic.Session(tool=self._tool.links(), curves=self._tool.curves(), q=self._tool.configuration(data), epsilon=epsilon, **{**defaults, **options})
        try:
            self._begin_with(data, period, options.get("gravity"))
        except BaseException:
            self.close()
            raise

    def _begin_with(self, data: Any, period: float, gravity: Any) -> None:
        model = self._model
        self._tool.is_told(gravity)
        for body in self._tool.kept:
            self._placed.keep(body)
        self._listing.list_early(np.ones(model.ngeom, bool) if self._shapes is None else self._shapes.by_engine)
        self._binding.mj_forward(model, data)
        self._frames = Frames(self.touch, period, self._tool.arm(data), has_shapes=self._shapes is not None)
        self._watch = Watch(model, data)
        self._offer(data)

    def close(self) -> None:
        """Says goodbye, and ends a server that the session started. The model is as it was before, and so is xfrc_applied."""
        super().close()
        self._pushes.take_back()
        self._changes.give_all_back()
        if self._changes.was_computed_from:
            self._binding.mj_setConst(self._model, self._binding.MjData(self._model))
            self._changes.was_computed_from = False

    @property
    def has_gripper(self) -> bool:
        """Whether the tool is one."""
        return isinstance(self._tool, Gripper)

    @property
    def opening(self) -> float:
        """Of a gripper: 0 closed to 1 open."""
        return self._gripper().opening

    def move_jaws(self, opening: Optional[float]) -> None:
        """Of a gripper: sends its servo there, 0 closed to 1 open, from the next send() on. None, as from the beginning: the device's
        gripper leads, or where it has none its first button, which closes and opens."""
        gripper = self._gripper()
        gripper.target = None if opening is None else _arguments.number(opening, "opening", 0, 1)

    @property
    def grip(self) -> float:
        """Of a gripper: the force of contacts that opens the jaws, N along the way of the jaw that goes farthest; of all jaws."""
        self._gripper()
        return float(self.touch.state.grip)

    @property
    def follow_error(self) -> float:
        """Of a gripper: how far MuJoCo's palm was from the hand's at the latest send(), m."""
        self._gripper()
        return self._follow_error

    def _gripper(self) -> Gripper:
        if not isinstance(self._tool, Gripper):
            raise haptic.HapticError("the session's tool must be a gripper")
        return self._tool

    def episode(self, task: str, folder: str | os.PathLike[str] = "demonstrations", **options: Any) -> haptic.Episode:
        """As haptic.Session.episode(); it also knows the names of the model's bodies."""
        names = {body: self._binding.mj_id2name(self._model, _BODY, body) or f"body {body}" for body in range(1, self._model.nbody)}
        episode = super().episode(task, folder, **options)
        episode.bodies = names
        return episode

    def check(self) -> list[Finding]:
        """What of the model is approximated or ignored, and which bodies the server can hold; as check()."""
        return _mujoco_check.findings(self._binding, self._model, self._tool.parts, self._changes)

    def drive(self, data: Any) -> int:
        """Before a frame: the tool where the proxy is, and the tool's impulses on bodies, as wrenches for all of its
        steps. Returns how many steps to take."""
        self._pushes.take_back()  # of a frame that was not sent
        steps = self._frames.begin(self._model.opt.timestep)
        self._listing.set_force(self.touch.tool_pushes and not self._tool.is_ghost)
        self._tool.place(data, self.touch.q, self.touch.v)
        self._place_held(data)
        self._begin, frame = data.time, self._frames.length
        if steps > 0:
            self._pushes.put(data, {body: impulse / frame for body, impulse in self.touch.impulses(frame).items()})
        return steps

    def send(self, data: Any) -> None:
        """After a frame: what is near the tool, at the pose that the steps led to."""
        self._warn_of_steps(data)
        self._send(data)

    def _send(self, data: Any) -> None:
        self._was_reset, self._ended = self._was_reset or data.time < self._begin, data.time
        self._taken.update(self._placed.leave(data, min(max(data.time - self._begin, 0), self._frames.length)))
        if self._frames.length == 0:
            return
        by_shapes = self._shapes is not None and (self.touch.has_scene or self._frames.waits())
        if not by_shapes and self._tool.is_ghost and not self._warned_of_shapes:
            self._warned_of_shapes = True
            warnings.warn(f"nothing is felt: {self.touch.message}", stacklevel=4)
        if not by_shapes and not self._tool.is_ghost and not self._listing.early.all():
            warnings.warn(f"MuJoCo's own contacts, with epsilon {self._epsilon} m, as the server finds none: "
                          f"{self.touch.message}", stacklevel=2)
            self._listing.list_early(~self._listing.early)
        self._binding.mj_forward(self._model, data)
        self._follow_changes(data)
        if isinstance(self._tool, Gripper):
            self._tool.press(self.touch.state.buttons)
            self._follow_error = self._tool.follow_error(data)
        q, v = self._tool.sample(data)
        self.touch.sample(q, v, self._frames.length)
        self.touch.external_wrench(self._tool.external_wrench(data))
        self.touch.drive_joints(self._tool.drives(not self._frames.waits()))
        if by_shapes and self._shapes is not None:
            self._send_poses(data, v[:6], self._shapes)
        else:
            self._send_contacts(data)

    def _offer(self, data: Any) -> None:
        """Gives the server the shapes, and the bodies that it can move."""
        if self._shapes is not None:
            whole = not self._shapes.by_engine.any()
            dynamics = self._placed.dynamics(data, self._shapes.bodies if whole else (), self._shapes.carriers)
            self._told = set(dynamics["body"].tolist())
            self._shapes.offer(self.touch, data, dynamics)

    def _follow_changes(self, data: Any) -> None:
        """Of the model, which the server learns by the next offer; a weight at once."""
        if self._watch.is_new(data):
            self._tool.weigh()
            self._round = self._round_geoms()
        if self._shapes is None or not self._watch.is_due(self.touch.now):
            return
        begin = self.touch.now
        self._shapes = Shapes(self._binding, self._model, self._tool.parts, self._shapes)
        self._listing.list_early(self._shapes.by_engine)
        self._offer(data)
        self._watch.offered(data, self._shapes.was_moved, begin, self.touch.now)

    def _place_held(self, data: Any) -> None:
        """The bodies that the hand holds where the server has them. What was reset or put elsewhere is let go of."""
        self._was_reset = self._was_reset or data.time < self._ended
        rows: list[Any] = self._frames.held.tolist()
        for body, let_go, position, turn, velocity, *joint in rows:
            if self._was_reset or self._placed.was_moved(data, body):
                self._taken.add(body)
            if let_go or body in self._taken:
                self._placed.let_go(body)
            else:
                self._placed.keep(body)
            if body not in self._taken:
                self._placed.place(data, body, np.array([*position, *turn]), np.array(velocity), (joint[0], joint[1]))
            elif let_go:
                self._taken.discard(body)

    def _usable_shapes(self, needs_them: bool) -> Optional[Shapes]:
        try:
            shapes = Shapes(self._binding, self._model, self._tool.parts)
        except haptic.HapticError as error:
            if needs_them:
                raise
            warnings.warn(f"MuJoCo's own contacts, with epsilon {self._epsilon} m, as {error}", stacklevel=3)
            return None
        if not shapes.tool_touches:
            warnings.warn("nothing of the tool collides, by contype, conaffinity or <pair>: nothing but its weight is felt until "
                          "that changes", stacklevel=3)
        others = np.flatnonzero(shapes.by_engine).tolist()
        if others:
            if self._tool.is_ghost:
                warnings.warn(f"a gripper does not feel {len(others)} geom{'s' * (len(others) > 1)} that can be given no shape, the first "
                              f"of them geom {others[0]} of type {int(self._model.geom_type[others[0]])}", stacklevel=3)
                return shapes
            warnings.warn(f"MuJoCo's own contacts, with epsilon {self._epsilon} m, of {len(others)} geom{'s' * (len(others) > 1)} "
                          f"that can be given no shape, the first of them geom {others[0]} of type "
                          f"{int(self._model.geom_type[others[0]])}", stacklevel=3)
        return shapes

    def _send_poses(self, data: Any, v: np.ndarray, shapes: Shapes) -> None:
        """Bodies that the tool may push before the next frame's are there, or those after it if these get lost."""
        reach = self._frames.reach(v)
        gaps = dict(list(shapes.gaps(data).items())[:haptic.MAX_POSES])  # A body needs a pose, too.
        if self._was_reset:
            shapes.forget_motion()
        poses = shapes.poses(data, gaps, self.touch.now, self._frames.length)
        poses["kept"] = self._was_reset | np.isin(poses["body"], [*self._taken])
        self._was_reset = False
        near = self._near_bodies.find({body: gap for body, gap in gaps.items() if self._model.body_dofnum[body] > 0}, reach,
                                      lambda: self._touching(data), self._told if self.touch.holds else ())
        bodies = self._bodies(data, near[:haptic.MAX_BODIES])
        contacts = self._contacts(data, shapes.by_engine) if shapes.by_engine.any() else None
        self._pushes.take_back()
        if contacts is not None:
            self._set_velocities(contacts, bodies)
            self.touch.track(contacts, bodies)
        self.touch.send(contacts, bodies, poses)

    def _send_contacts(self, data: Any) -> None:
        contacts = self._contacts(data, self._listing.early)
        # Those first that the tool touches, the nearest before the others: the server moves eight.
        first = np.argsort(contacts["a_kind"] != haptic.TOOL_LINK, kind="stable")
        sides = [(each[side + "_kind"], int(each[side + "_index"])) for each in contacts[first] for side in "ba"]
        near = dict.fromkeys(index for kind, index in sides if kind == haptic.MOVABLE_BODY)
        bodies = self._bodies(data, list(near)[:haptic.MAX_BODIES])
        self._pushes.take_back()
        self._set_velocities(contacts, bodies)
        self.touch.track(contacts, bodies)
        self.touch.send(contacts, bodies)

    def _warn_of_steps(self, data: Any) -> None:
        """Once, where MuJoCo's time is not the hand's. It may stand still, and begin again."""
        step = self._model.opt.timestep
        due, taken = round(self._frames.length / step), round((data.time - self._begin) / step)
        if taken > 0 and taken != due and not self._warned:
            self._warned = True
            warnings.warn(f"drive() returned {due} steps, and {taken} were taken: bodies move as if time went at "
                          "another rate. Take as many as it returns", stacklevel=3)

    def _touching(self, data: Any) -> np.ndarray:
        """Bodies that touch each other or hang on each other, in pairs."""
        listed, n = data.contact, data.ncon
        geoms = np.column_stack([listed.geom1, listed.geom2])[:n]
        return np.concatenate([self._bodies_of_geoms[geoms[(geoms >= 0).all(axis=1)]],  # -1: a flex
                               self._hanging])

    def _contacts(self, data: Any, geoms: np.ndarray) -> np.ndarray:
        """geoms: of each whether its contacts are meant."""
        model, tool, n = self._model, self._tool.body, data.ncon
        found, listed = haptic.contacts(n), data.contact
        geom1, geom2 = np.asarray(listed.geom1)[:n], np.asarray(listed.geom2)[:n]
        body1, body2 = self._bodies_of_geoms[geom1], self._bodies_of_geoms[geom2]
        # Side a, to which the normal points, is the tool, else a body that moves.
        first = (body1 == tool) | ((body2 != tool) & (body2 == 0))
        a, b = np.where(first, body1, body2), np.where(first, body2, body1)
        normal = np.asarray(listed.frame)[:n].reshape(n, 9)[:, :3] * np.where(first, -1, 1)[:, None]
        distance = np.asarray(listed.dist)[:n]
        found["pair"] = geom1 * model.ngeom + geom2
        for side, body in (("a", a), ("b", b)):
            found[side + "_kind"] = np.where(body == tool, haptic.TOOL_LINK,
                                             np.where(body == 0, haptic.WORLD, haptic.MOVABLE_BODY))
            found[side + "_index"] = np.where(body == tool, 0, body)
        found["normal"] = normal
        found["point"] = np.asarray(listed.pos)[:n] - 0.5 * distance[:, None] * normal
        found["separation"] = distance
        found["friction"] = np.where(np.asarray(listed.dim)[:n] > 1, np.asarray(listed.friction)[:n].reshape(n, 5)[:, 0], 0)
        found["load"] = self._loads(data)
        found["load"][a == tool] = 0
        found = found[(found["a_kind"] != haptic.WORLD) & (a != b) & (geom1 >= 0) & (geom2 >= 0)  # -1: a flex
                      & (geoms[geom1] | geoms[geom2])]
        return np.ascontiguousarray(self._near(found))

    @staticmethod
    def _near(found: np.ndarray) -> np.ndarray:
        """Contacts of the tool, and of the bodies that it is near or that these touch."""
        of_tool = found["a_kind"] == haptic.TOOL_LINK
        near = set(found["b_index"][of_tool & (found["b_kind"] == haptic.MOVABLE_BODY)])
        between = found["b_kind"] == haptic.MOVABLE_BODY
        for _ in range(2):
            touching = between & (np.isin(found["a_index"], list(near)) | np.isin(found["b_index"], list(near)))
            near |= set(found["a_index"][touching & ~of_tool]) | set(found["b_index"][touching])
        kept = found[of_tool | np.isin(found["a_index"], list(near))]
        order = np.argsort(kept["separation"], kind="stable")
        return kept[order[:haptic.MAX_CONTACTS]]

    def _loads(self, data: Any) -> np.ndarray:
        """Normal forces of all contacts of MuJoCo, N."""
        n, listed = data.ncon, data.contact
        first, dimension = np.asarray(listed.efc_address)[:n], np.asarray(listed.dim)[:n]
        edges = self._model.opt.cone != _ELLIPTIC  # of the friction pyramid
        rows = np.where(edges & (dimension > 1), 2 * (dimension - 1), 1)
        sums = np.concatenate([[0], np.cumsum(data.efc_force)])
        force = sums[np.where(first < 0, 0, first + rows)] - sums[np.maximum(first, 0)]
        return np.where(first < 0, 0, np.maximum(force, 0))

    def _bodies(self, data: Any, chosen: list[int]) -> np.ndarray:
        found = haptic.bodies(len(chosen))
        nv = self._model.nv
        J, solved = np.zeros((6, nv)), np.zeros((6, nv))
        if not chosen:
            return found
        slowed = self._damping(data)
        for to, body in zip(found, chosen):
            self._binding.mj_jacBodyCom(self._model, data, J[:3], J[3:], body)
            self._binding.mj_solveM(self._model, data, solved, J)
            W = J @ slowed(solved).T
            to["id"] = body
            to["centre"] = data.xipos[body]
            to["velocity"] = J @ data.qvel
            to["inverse_inertia"] = 0.5 * (W + W.T)
            to["acceleration"] = J @ slowed(data.qacc_smooth) - W @ self._pushes.on(body)
            to["round"], to["axis"] = self._roundness(data, body)
        return found

    def _damping(self, data: Any) -> Callable[[np.ndarray], np.ndarray]:
        """Of rows of accelerations, M⁻¹ f, makes (M + h D)⁻¹ f: an implicit step over the delay h. Where damping D, of
        joints and of servos on them, acts faster than that, a body that the server thinks free would chatter."""
        model = self._model
        damping = np.array(model.dof_damping)
        if model.nu > 0:
            servo = np.flatnonzero((np.asarray(model.actuator_trntype) == _OF_JOINT)
                                   & (np.asarray(model.actuator_biastype) == _AFFINE))
            joints = np.asarray(model.actuator_trnid)[servo, 0]
            # Since 3.11 an actuator may have several outputs, each with its gear.
            output = np.asarray(model.actuator_outadr)[servo] if hasattr(model, "actuator_outadr") else servo
            gear, gain = np.asarray(model.actuator_gear)[output, 0], -np.asarray(model.actuator_biasprm)[servo, 2]
            np.add.at(damping, np.asarray(model.jnt_dofadr)[joints], gear**2 * np.maximum(gain, 0))
        damped = np.flatnonzero(damping)
        if len(damped) == 0:
            return lambda rows: rows
        unit, solved = np.zeros((len(damped), model.nv)), np.zeros((len(damped), model.nv))
        unit[np.arange(len(damped)), damped] = 1
        self._binding.mj_solveM(model, data, solved, unit)
        slowing = np.linalg.solve(np.diag(1 / (self._frames.delay() * damping[damped])) + solved[:, damped], solved)
        return lambda rows: rows - rows[..., damped] @ slowing

    def _round_geoms(self) -> dict[int, int]:
        """Of each body with one geom that collides, and that revolves, this geom."""
        model = self._model
        collides = (np.asarray(model.geom_contype) != 0) | (np.asarray(model.geom_conaffinity) != 0)
        collides[model.pair_geom1] = collides[model.pair_geom2] = True
        bodies = self._bodies_of_geoms
        limited = model.body_weldid[np.asarray(model.jnt_bodyid)[np.asarray(model.jnt_limited) != 0]]
        found = {}
        for body in set(bodies[collides].tolist()) - {0} - set(limited.tolist()):
            geoms = np.flatnonzero(collides & (bodies == body))
            if len(geoms) == 1 and model.geom_type[geoms[0]] in _REVOLVES:
                found[body] = int(geoms[0])
        return found

    def _roundness(self, data: Any, body: int) -> tuple[int, Any]:
        geom = self._round.get(body)
        if geom is None:
            return haptic.NOT_ROUND, 0
        offset = data.geom_xpos[geom] - data.xipos[body]
        axis = np.reshape(data.geom_xmat[geom], (3, 3))[:, 2]
        if self._model.geom_type[geom] == _SPHERE and np.linalg.norm(offset) < _OFF_AXIS:
            return haptic.SPHERE, 0
        if self._model.geom_type[geom] != _SPHERE and np.linalg.norm(np.cross(axis, offset)) < _OFF_AXIS:
            return haptic.ROUND_ABOUT_AXIS, axis
        return haptic.NOT_ROUND, 0

    @staticmethod
    def _set_velocities(contacts: np.ndarray, bodies: np.ndarray) -> None:
        """Of the points of bodies: that of one that the server does not move is all that it knows."""
        for body in bodies:
            of_body = (contacts["b_kind"] == haptic.MOVABLE_BODY) & (contacts["b_index"] == body["id"])
            arms = contacts["point"][of_body] - body["centre"]
            contacts["velocity"][of_body] = body["velocity"][:3] + np.cross(body["velocity"][3:], arms)


def from_mujoco(model: Any, tool: int, binding: Any = None) -> Shapes:
    """tool: number of the body that the hand holds. binding: as of Session. Raises haptic.HapticError at a geom that cannot
    be used."""
    return Shapes(_binding(binding), model, Parts({tool: 0}))


def _require_data_of(model: Any, data: Any) -> None:
    for rows, count in (("qpos", "nq"), ("qvel", "nv"), ("xpos", "nbody"), ("geom_xpos", "ngeom")):
        found, due = len(getattr(data, rows, ())), getattr(model, count)
        if found != due:
            raise haptic.HapticError(f"data must be of this model: it has {found} rows in {rows}, not the model's {count}, {due}")


def _binding(given: Any) -> Any:
    """MuJoCo's official one, unless another is given."""
    return importlib.import_module("mujoco") if given is None else given


if __name__ == "__main__":
    sys.exit(_mujoco_check.main())
