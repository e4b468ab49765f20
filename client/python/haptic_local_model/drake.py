"""A Drake world in the hand.

    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=1 / 240)    # and so on
    simulator = Simulator(builder.Build())
    with haptic.drake.Session(simulator, plant, scene_graph, tool="tool") as touch:
        while touch.running:
            steps = touch.drive()              # proxy pose onto the tool, impulses onto bodies
            simulator.AdvanceTo(simulator.get_context().get_time() + steps * plant.time_step())
            touch.send()                       # where bodies are, and what the tool can push

drive() returns how many steps bring Drake's time up to the hand's, so the loop may run at any rate and come late. Every body with
degrees of freedom can be pushed: what its joints leave of its mobility and its acceleration are computed by the plant, by weight
and inertia alone. Actuators, springs, damping, friction and limits of joints take no part: they are felt only as far as the engine
moves the body.
"""

from __future__ import annotations

from typing import Any, Iterable, Optional

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import (Box, Capsule, CollisionFilterDeclaration, Convex, Cylinder, Ellipsoid, GeometrySet, HalfSpace, Mesh,
                              Sphere)
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce, SpatialVelocity
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import JacobianWrtVariable, ModelInstanceIndex

import haptic_local_model as haptic
from haptic_local_model._world import Placed, WorldSession, of_tool

_SHAPES = {Sphere: ("sphere", lambda shape: (shape.radius(),)), Box: ("box", lambda shape: shape.size()),
           Capsule: ("capsule", lambda shape: (shape.radius(), shape.length())),
           Cylinder: ("cylinder", lambda shape: (shape.radius(), shape.length())),
           Ellipsoid: ("ellipsoid", lambda shape: (shape.a(), shape.b(), shape.c())), HalfSpace: ("half_space", lambda shape: ()),
           Convex: ("hull", lambda shape: ()), Mesh: ("hull", lambda shape: ())}
_LINEAR_FIRST = [3, 4, 5, 0, 1, 2]  # Drake has the angular part first.


class Session(WorldSession):
    """A client for one discrete plant.

    tool: name of a body that nothing holds. From here on it is put where the proxy is, and while the server
    answers it collides with nothing. The plant's input port of applied spatial forces is the session's. The tool's own weight is
    felt: gravity=(0, 0, 0) takes it away. period: about that of your frames, s. Other arguments are those of haptic.Session.

    A mesh is its convex hull. Of two coefficients of friction the smaller counts, where Drake takes 2 a b / (a + b): give both
    the same. Raises haptic.HapticError where the plant, the tool or a shape cannot be used.
    """

    def __init__(self, simulator: Any, plant: Any, scene_graph: Any, tool: str, *, period: float = 1 / 60, **options: Any):
        if plant.time_step() <= 0:
            raise haptic.HapticError("the plant must be a discrete one, with a time_step above 0")
        if not plant.HasBodyNamed(tool) or not plant.GetBodyByName(tool).is_floating_base_body():
            raise haptic.HapticError(f"body {tool!r} must be one of the plant's that nothing holds, as the tool moves freely in the "
                                     "hand")
        self._plant, self._scene_graph, self._tool = plant, scene_graph, plant.GetBodyByName(tool)
        root = simulator.get_mutable_context()
        self._context = plant.GetMyMutableContextFromRoot(root)
        self._filters = scene_graph.collision_filter_manager(scene_graph.GetMyMutableContextFromRoot(root))
        self._filter = None  # Drake's, while the tool collides with nothing
        inertia = self._tool.CalcSpatialInertiaInBodyFrame(self._context)
        link = haptic.box(inertia.get_mass(), (0, 0, 0))
        link.centre[:] = inertia.get_com()
        link.inertia[:] = inertia.Shift(inertia.get_com()).CalcRotationalInertia().CopyToFullMatrix3().ravel()
        position, turn = self._frame(self._tool)
        super().__init__(link, np.array([*position, *turn]), plant.gravity_field().gravity_vector(), "minimum", period, options)

    def drive(self) -> int:
        """Before a frame: the tool where the proxy is, and the tool's impulses on bodies, as forces for all of its steps. Returns
        how many steps to take."""
        steps = self._begin_frame(self._plant.time_step())
        if self.touch.tool_pushes != (self._filter is None):
            self._set_collides(self.touch.tool_pushes)
        self._place(int(self._tool.index()), self._q[:3], self._q[3:], self._v)
        wrenches = {int(self._tool.index()): self._weightless(self._tool), **self._pushes}
        for number in self._frames.held["body"][self._frames.held["let_go"] == 0].tolist():
            wrenches[number] = self._weightless(self._body(number))
        self._plant.get_applied_spatial_force_input_port().FixValue(self._context, [
            self._force(number, wrench) for number, wrench in wrenches.items()])
        return steps

    def close(self) -> None:
        """Says goodbye, and ends a server that the session started. Bodies have their weight again."""
        super().close()
        self._plant.get_applied_spatial_force_input_port().FixValue(self._context, [])

    def _weightless(self, body: Any) -> np.ndarray:
        """The wrench with which it does not fall."""
        return np.array([*(-body.get_mass(self._context) * self._gravity_W), 0, 0, 0])

    def send(self) -> None:
        """After a frame: what is near the tool, at the pose that the steps led to."""
        self._mobility: Optional[np.ndarray] = None
        self._end_frame()

    def _find_mobility(self) -> None:
        self._mobility = np.linalg.inv(self._plant.CalcMassMatrix(self._context))
        self._speedup = self._mobility @ (self._plant.CalcGravityGeneralizedForces(self._context)
                                          - self._plant.CalcBiasTerm(self._context))

    def _force(self, number: int, wrench: np.ndarray) -> Any:
        force, body = ExternallyAppliedSpatialForce(), self._body(number)
        force.body_index, force.p_BoBq_B = body.index(), body.CalcCenterOfMassInBodyFrame(self._context)
        force.F_Bq_W = SpatialForce(wrench[3:], wrench[:3])
        return force

    def _set_collides(self, collides: bool) -> None:
        if collides:
            self._filters.RemoveDeclaration(self._filter)
            self._filter = None
            return
        of_tool = self._plant.GetCollisionGeometriesForBody(self._tool)
        all_of_them = self._scene_graph.model_inspector().GetAllGeometryIds()
        self._filter = self._filters.ApplyTransient(
            CollisionFilterDeclaration().ExcludeBetween(GeometrySet(of_tool), GeometrySet(all_of_them)))

    def _shapes(self) -> Placed:
        inspector, placed, geometries = self._scene_graph.model_inspector(), Placed(), []
        still = {body.index() for body in self._plant.GetBodiesWeldedTo(self._plant.world_body())}
        for index in range(self._plant.num_bodies()):
            body = self._body(index)
            stands = body.index() in still
            for geometry in self._plant.GetCollisionGeometriesForBody(body):
                place = inspector.GetPoseInFrame(geometry)
                place = self._plant.EvalBodyPoseInWorld(self._context, body) @ place if stands else place
                self._add(placed, haptic.WORLD if stands else of_tool() if body is self._tool or body.index() == self._tool.index()
                          else index, geometry, place)
                geometries.append((index, geometry))
        placed.excluded += [(i, j) for i, (of_i, first) in enumerate(geometries) for j, (of_j, second) in enumerate(geometries[:i])
                            if of_i != of_j and inspector.CollisionFiltered(first, second)]
        return placed

    def _add(self, placed: Placed, carrier: int, geometry: Any, place: Any) -> None:
        inspector = self._scene_graph.model_inspector()
        shape = inspector.GetShape(geometry)
        if type(shape) not in _SHAPES:
            raise haptic.HapticError(f"{inspector.GetName(geometry)} is a {type(shape).__name__}; it must be one of "
                                     f"{', '.join(each.__name__ for each in _SHAPES)}")
        name, sizes = _SHAPES[type(shape)]
        hull = shape.GetConvexHull() if name == "hull" else None
        friction = inspector.GetProximityProperties(geometry).GetProperty("material", "coulomb_friction").dynamic_friction()
        placed.add(carrier, name, sizes(shape), place.translation(), place.rotation().ToQuaternion().wxyz(), friction,
                   None if hull is None else np.array([hull.vertex(i) for i in range(hull.num_vertices())]))

    def _body(self, number: int) -> Any:
        return self._plant.get_body(self._indices()[number])

    def _indices(self) -> list[Any]:
        """Of all bodies, that of the world first."""
        if not hasattr(self, "_all"):
            found = [index for instance in map(ModelInstanceIndex, range(self._plant.num_model_instances()))
                     for index in self._plant.GetBodyIndices(instance)]
            self._all = sorted(found, key=int)
        return self._all

    def _frame(self, body: Any) -> tuple[np.ndarray, np.ndarray]:
        """Position and rotation (w, x, y, z)."""
        place = self._plant.EvalBodyPoseInWorld(self._context, body)
        return place.translation(), place.rotation().ToQuaternion().wxyz()

    def _pose(self, number: int) -> tuple[Any, Any, Any]:
        velocity = self._plant.EvalBodySpatialVelocityInWorld(self._context, self._body(number)).get_coeffs()
        return (*self._frame(self._body(number)), velocity[_LINEAR_FIRST])

    def _place(self, number: int, position: np.ndarray, turn: np.ndarray, velocity: np.ndarray) -> None:
        plant, body = self._plant, self._body(number)
        plant.SetFreeBodyPose(self._context, body, RigidTransform(Quaternion(turn / np.linalg.norm(turn)), position))
        plant.SetFreeBodySpatialVelocity(context=self._context, body=body, V_JpJc=SpatialVelocity(velocity[3:], velocity[:3]))

    def _inertia(self, number: int) -> Optional[tuple[float, Any, Any, float]]:
        body = self._body(number)
        carries = any(self._plant.get_joint(joint).parent_body().index() == body.index() for joint in self._plant.GetJointIndices())
        if not body.is_floating_base_body() or carries or self._plant.num_constraints() > 0:
            return None
        inertia = body.CalcSpatialInertiaInBodyFrame(self._context)
        centre = inertia.get_com()
        return inertia.get_mass(), centre, inertia.Shift(centre).CalcRotationalInertia().CopyToFullMatrix3(), 0.0

    def _can_be_pushed(self, number: int) -> bool:
        return True

    def _describe(self, number: int, to: np.ndarray) -> None:
        plant, body = self._plant, self._body(number)
        if self._mobility is None:
            self._find_mobility()
        centre = body.CalcCenterOfMassInBodyFrame(self._context)
        at = (JacobianWrtVariable.kV, body.body_frame(), centre, plant.world_frame(), plant.world_frame())
        J = plant.CalcJacobianSpatialVelocity(self._context, *at)[_LINEAR_FIRST]
        bias = plant.CalcBiasSpatialAcceleration(self._context, *at).get_coeffs()[_LINEAR_FIRST]
        to["centre"] = plant.EvalBodyPoseInWorld(self._context, body) @ centre
        to["velocity"] = J @ plant.GetVelocities(self._context)
        to["inverse_inertia"], to["acceleration"] = J @ self._mobility @ J.T, J @ self._speedup + bias

    def _touching(self) -> Iterable[tuple[int, int]]:
        results, inspector = self._plant.get_contact_results_output_port().Eval(self._context), self._scene_graph.model_inspector()
        points = map(results.point_pair_contact_info, range(results.num_point_pair_contacts()))
        surfaces = map(results.hydroelastic_contact_info, range(results.num_hydroelastic_contacts()))
        found = [(int(each.bodyA_index()), int(each.bodyB_index())) for each in points]
        for surface in (each.contact_surface() for each in surfaces):
            one, other = (int(self._plant.GetBodyFromFrameId(inspector.GetFrameId(surface_id)).index())
                          for surface_id in (surface.id_M(), surface.id_N()))
            found.append((one, other))
        return found

