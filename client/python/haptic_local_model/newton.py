"""A Newton world in the hand.

    model = builder.finalize()
    state, after = model.state(), model.state()
    with haptic.newton.Session(model, state, tool=tool, step=1 / 240) as touch:    # before the solver is made
        solver = newton.solvers.SolverXPBD(model)
        while touch.running:
            for _ in range(touch.drive(state)):     # proxy pose onto the tool
                state.clear_forces()
                touch.push(state)                   # impulses onto bodies
                pipeline.collide(state, contacts)
                solver.step(state, after, control, contacts, 1 / 240)
                state, after = after, state
            touch.send(state, contacts)             # where bodies are, and what the tool can push

drive() returns how many steps bring the engine's time up to the hand's, so the loop may run at any rate and come late. Every body
with mass can be pushed: what its joints leave of its mobility is computed at the present pose, without the centripetal part of its
acceleration. Motors, friction and limits of joints take no part: they are felt only as far as the engine moves the body.
"""

from __future__ import annotations

from typing import Any, Iterable, Optional

import newton
import numpy as np
from newton import GeoType, JointType

import haptic_local_model as haptic
from haptic_local_model._mobility import Freedom, Tree, free
from haptic_local_model._world import Placed, WorldSession, of_tool, rotation

_SHAPES = {GeoType.SPHERE: ("sphere", lambda size: size[:1]), GeoType.BOX: ("box", lambda size: 2 * size),
           GeoType.CAPSULE: ("capsule", lambda size: (size[0], 2 * size[1])), GeoType.ELLIPSOID: ("ellipsoid", lambda size: size),
           GeoType.CYLINDER: ("cylinder", lambda size: (size[0], 2 * size[1])), GeoType.PLANE: ("half_space", lambda size: ()),
           GeoType.CONVEX_MESH: ("hull", lambda size: ()), GeoType.MESH: ("mesh", lambda size: ())}
_NO_CONTACT = -1e3  # m: a gap within which nothing is. Flags and groups are read when the collision pipeline is made.


class Session(WorldSession):
    """A client for one model.

    tool: number of a body that no joint holds. From here on it is where the proxy is: in the model it has no mobility, and while
    the server answers it collides with nothing. step: of the solver, s. rule: what the solver makes of two coefficients of
    friction, one of haptic.FRICTION_RULES: SolverXPBD takes the average, SolverMuJoCo the maximum. The tool's own weight is felt:
    gravity=(0, 0, 0) takes it away. period: about that of your frames, s. Other arguments are those of haptic.Session.

    Call offer() where shapes have changed. Of collision groups only 0, which collides with nothing, is told. Raises
    haptic.HapticError where the tool or a shape cannot be used.
    """

    def __init__(self, model: Any, state: Any, tool: int, *, step: float, rule: str = "average", period: float = 1 / 60,
                 **options: Any):
        self._model, self._tool, self._step, self._state = model, tool, step, state
        self._mass, self._inertia_of, self._com = (array.numpy() for array in (model.body_mass, model.body_inertia, model.body_com))
        self._gravity = model.gravity.numpy().reshape(-1, 3)[0].astype(float)
        parents, children = model.joint_parent.numpy(), model.joint_child.numpy()
        holds = [joint for joint in np.flatnonzero(children == tool) if model.joint_type.numpy()[joint] != JointType.FREE]
        if not 0 <= tool < model.body_count or self._mass[tool] <= 0 or len(holds) > 0 or tool in parents:
            raise haptic.HapticError(f"body {tool} must be one with mass that no joint holds, as the tool moves freely in the hand")
        self._joints = {int(child): joint for joint, child in reversed(list(enumerate(children)))}
        self._moves = model.body_inv_mass.numpy() > 0
        link = haptic.box(float(self._mass[tool]), (0, 0, 0))
        link.centre[:], link.inertia[:] = self._com[tool], self._inertia_of[tool].ravel()
        for mobility in (model.body_inv_mass, model.body_inv_inertia):
            _put(mobility, tool, 0)
        self._of_tool = np.flatnonzero(model.shape_body.numpy() == tool)
        self._gaps_of_tool = model.shape_gap.numpy()[self._of_tool].copy()
        position, turn = self._frame(tool)
        super().__init__(link, np.array([*position, *turn]), self._gravity, rule, period, options)

    def drive(self, state: Any) -> int:
        """Before a frame. Returns how many steps to take."""
        self._state, self._steps = state, 0
        steps = self._begin_frame(self._step)
        _put(self._model.shape_gap, self._of_tool, self._gaps_of_tool if self.touch.tool_pushes else _NO_CONTACT)
        self._place_tool(state)
        return steps

    def push(self, state: Any) -> None:
        """Before each step, after state.clear_forces(): the tool where the proxy is, what the hand holds where that is, and the
        tool's impulses on bodies."""
        self._state = state
        self._place_tool(state)
        self._place_held(self._steps * self._step)
        self._steps += 1
        for number, wrench in self._pushes.items():
            _put(state.body_f, number - 1, state.body_f.numpy()[number - 1] + wrench)

    def send(self, state: Any, contacts: Any) -> None:
        """After a frame: what is near the tool, at the pose that the steps led to. contacts: of the latest step."""
        self._state, self._contacts = state, contacts
        self._trees: dict[int, Tree] = {}
        self._end_frame()

    def _place_tool(self, state: Any) -> None:
        self._place(self._tool + 1, self._q[:3], self._q[3:], self._v)

    def _place(self, number: int, position: np.ndarray, turn: np.ndarray, velocity: np.ndarray) -> None:
        body, spin = number - 1, velocity[3:]
        _put(self._state.body_q, body, [*position, *np.roll(turn, -1)])
        _put(self._state.body_qd, body, [*(velocity[:3] + np.cross(spin, rotation(turn) @ self._com[body])), *spin])

    def _inertia(self, number: int) -> Optional[tuple[float, Any, Any, float]]:
        body, model = number - 1, self._model
        joint = self._joints.get(body)
        if (joint is not None and model.joint_type.numpy()[joint] != JointType.FREE) or body in model.joint_parent.numpy():
            return None
        return float(self._mass[body]), self._com[body], self._inertia_of[body], 0.0

    def _shapes(self) -> Placed:
        model, placed, places = self._model, Placed(), {}
        bodies, kinds, sizes = model.shape_body.numpy(), model.shape_type.numpy(), model.shape_scale.numpy().astype(float)
        collides = (model.shape_flags.numpy() & newton.ShapeFlags.COLLIDE_SHAPES != 0) & (model.shape_collision_group.numpy() != 0)
        collides[self._of_tool] = True
        for shape in np.flatnonzero(collides):
            kind = GeoType(int(kinds[shape]))
            if kind not in _SHAPES or (kind == GeoType.PLANE and sizes[shape].any()):
                raise haptic.HapticError(f"shape {shape} is a {kind.name} of the size {sizes[shape]}; it must be one of "
                                         f"{', '.join(each.name for each in _SHAPES)}, a plane without ends")
            name, size = _SHAPES[kind]
            body = int(bodies[shape])
            pose = model.shape_transform.numpy()[shape].astype(float)
            source = model.shape_source[shape] if name in ("hull", "mesh") else None
            places[int(shape)] = len(placed.shapes)
            placed.add(of_tool() if body == self._tool else body + 1, name, size(sizes[shape]), pose[:3], np.roll(pose[3:], 1),
                       float(model.shape_material_mu.numpy()[shape]),
                       None if source is None else np.asarray(source.vertices) * sizes[shape],
                       np.reshape(source.indices, (-1, 3)) if source is not None and name == "mesh" else None)
        placed.excluded += [(places[i], places[j]) for i, j in map(tuple, model.shape_collision_filter_pairs)
                            if i in places and j in places and bodies[i] != bodies[j]]
        return placed

    def _frame(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        """Position and rotation (w, x, y, z)."""
        pose = self._state.body_q.numpy()[body].astype(float)
        return pose[:3], np.roll(pose[3:], 1) / np.linalg.norm(pose[3:])

    def _centre(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        """Of mass: its place, and the way there from the body's origin."""
        position, turn = self._frame(body)
        arm = rotation(turn) @ self._com[body]
        return position + arm, arm

    def _pose(self, number: int) -> tuple[Any, Any, Any]:
        position, turn = self._frame(number - 1)
        velocity = self._state.body_qd.numpy()[number - 1].astype(float)
        velocity[:3] -= np.cross(velocity[3:], self._centre(number - 1)[1])
        return position, turn, velocity

    def _can_be_pushed(self, number: int) -> bool:
        return bool(self._moves[number - 1])

    def _describe(self, number: int, to: np.ndarray) -> None:
        tree, place = self._tree(number - 1)
        to["centre"], to["velocity"] = self._centre(number - 1)[0], self._state.body_qd.numpy()[number - 1]
        to["inverse_inertia"], to["acceleration"] = tree.inverse_inertia(place), tree.acceleration(place)

    def _tree(self, body: int) -> tuple[Tree, int]:
        """Of a body and those that its joints connect with it, and its place there."""
        chain = [body]
        while (parent := self._parent(chain[0])) >= 0:
            chain.insert(0, parent)
        found = [chain[0]]
        for each in found:
            found += [other for other in self._joints if self._parent(other) == each and other not in found]
        if chain[0] not in self._trees:
            freedoms = [freedom for place, each in enumerate(found) for freedom in self._freedoms(place, each)]
            turns = [rotation(self._frame(each)[1]) for each in found]
            self._trees[chain[0]] = Tree(
                [found.index(self._parent(each)) if self._parent(each) >= 0 else -1 for each in found], self._mass[found],
                [R @ self._inertia_of[each] @ R.T for R, each in zip(turns, found)], [self._centre(each)[0] for each in found],
                freedoms, self._gravity)
        return self._trees[chain[0]], found.index(body)

    def _parent(self, body: int) -> int:
        return int(self._model.joint_parent.numpy()[self._joints[body]]) if body in self._joints else -1

    def _freedoms(self, place: int, body: int) -> list[Freedom]:
        model, joint = self._model, self._joints.get(body)
        if joint is None or model.joint_type.numpy()[joint] in (JointType.FREE, JointType.DISTANCE):
            return free(place, self._centre(body)[0])
        position, turn = self._frame(body)
        of_child, of_parent = (array.numpy()[joint].astype(float) for array in (model.joint_X_c, model.joint_X_p))
        R = rotation(np.roll(of_parent[3:], 1))
        if self._parent(body) >= 0:
            R = rotation(self._frame(self._parent(body))[1]) @ R
        linear, angular = model.joint_dof_dim.numpy()[joint]
        first, none = model.joint_qd_start.numpy()[joint], np.zeros(3)
        axes = [R @ axis for axis in model.joint_axis.numpy()[first:first + linear + angular].astype(float)]
        point = position + rotation(turn) @ of_child[:3]
        return [Freedom(place, axis if i < linear else none, none if i < linear else axis, point)
                for i, axis in enumerate(axes)]

    def _touching(self) -> Iterable[tuple[int, int]]:
        count = int(self._contacts.rigid_contact_count.numpy()[0])
        shapes = np.column_stack([array.numpy()[:count] for array in
                                  (self._contacts.rigid_contact_shape0, self._contacts.rigid_contact_shape1)])
        return np.unique(self._model.shape_body.numpy()[shapes[(shapes >= 0).all(axis=1)]] + 1, axis=0).tolist()


def _put(array: Any, place: Any, value: Any) -> None:
    """On any device."""
    values = array.numpy()
    values[place] = value
    array.assign(values)
