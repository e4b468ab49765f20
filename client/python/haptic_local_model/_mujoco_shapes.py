"""The geoms of a MuJoCo model as shapes for the server."""

from __future__ import annotations

from typing import Any, Iterable, NamedTuple, Optional

import numpy as np

import haptic_local_model as haptic
import haptic_local_model.shapes
from haptic_local_model._mujoco_pairs import Pairs
from haptic_local_model._world import Gaps, quaternions, rotation, rotation_vector

# For each mjtGeom: kind and sizes of haptic.shapes.
_SHAPES = {0: ("half_space", lambda size: ()), 2: ("sphere", lambda size: size[:1]),
           3: ("capsule", lambda size: (size[0], 2 * size[1])), 4: ("ellipsoid", lambda size: size),
           5: ("cylinder", lambda size: (size[0], 2 * size[1])), 6: ("box", lambda size: 2 * size),
           7: ("hull", lambda size: ())}
_MOST_VERTICES = 4096  # of a hull, as a server takes them
_TAKING = 0.2  # s: that a server needs for usual shapes
_FASTEST = 10  # m/s: a body that was moved farther in a frame was put there


class Parts(NamedTuple):
    """What the hand has of a model."""
    links: dict[int, int]  #: Of each body that carries a link of the tool, its number; the first one is the root.
    ghosts: frozenset[int] = frozenset()  #: Bodies that carry the tool: they touch nothing.
    apart: frozenset[tuple[int, int]] = frozenset()  #: Geoms of links that never touch each other, the smaller number first.

    def own(self, model: Any) -> np.ndarray:
        """Of each body whether it carries a link, also where it is fixed to what carries it."""
        return np.isin(np.arange(model.nbody), [*self.links])


class Shapes:
    """The model's geoms, as they are now. The index of a body is its own, or that of what it is welded to."""

    def __init__(self, binding: Any, model: Any, tool: Parts, before: Optional["Shapes"] = None):
        """before: the shapes of this model that were offered last. What stood still and has been moved since goes on as a mocap
        body does, from where it was: at its new place it would be in the tool, and not push it."""
        self._model, self._links = model, tool.links
        self._places_in_parents = np.hstack([model.body_pos, model.body_quat])
        self._waiting: list[int] = []  # bodies that are told to be where they were until the server should have the shapes,
        self._waits_until = 0.0  # s
        #: Of each body whether it was moved though it cannot move.
        self.was_moved = np.zeros(model.nbody, bool)
        self._pose_before: dict[int, tuple[np.ndarray, np.ndarray]] = {}  # of bodies whose velocity MuJoCo does not know
        if before is not None:
            self._go_on_from(before)
        self._poses_offered: list[tuple[np.ndarray, np.ndarray]] = []  # by body
        #: Of each body what it moves with, as carriers().
        self.carriers = carriers(model, self.was_moved | tool.own(model))
        of_geom = self.carriers[model.geom_bodyid]
        of_tool = np.isin(of_geom, [*tool.links])
        pairs = Pairs(binding, model, of_geom, tool.links, version_of(binding))
        has_shape = have_shapes(model) & ~np.isin(of_geom, [*tool.ghosts])
        if not has_shape[of_tool].any():
            raise haptic.HapticError("no geom of the tool can be given as a shape: they must be meshes or basic shapes")
        #: Of each geom whether MuJoCo finds its contacts: what has no shape here.
        self.by_engine = pairs.touches & ~have_shapes(model)
        #: Whether the tool can touch anything at present.
        self.tool_touches = bool(pairs.touches[of_tool].any())
        shaped = pairs.shaped(has_shape)
        self._shaped = shaped._replace(apart=sorted({*shaped.apart, *_places_apart(shaped.geoms, tool.apart)}))
        self._geoms, self._carrier = self._shaped.geoms, of_geom[self._shaped.geoms]
        self._shapes = [self._shape(*each) for each in zip(self._geoms.tolist(), self._carrier.tolist(),
                                                           self._shaped.groups.tolist(), self._shaped.masks.tolist())]
        root = next(iter(tool.links))
        self._gaps = Gaps(np.array(model.geom_rbound)[self._geoms],
                          np.where(np.isin(self._carrier, [*tool.links]), root, self._carrier), root)

    def _go_on_from(self, before: "Shapes") -> None:
        is_moved = (self._places_in_parents != before._places_in_parents).any(axis=1) & (before.carriers == 0)
        is_moved &= ~np.isin(before.carriers, [*self._links])
        self.was_moved, self._pose_before = before.was_moved | is_moved, before._pose_before
        self._pose_before.update((int(body), before._poses_offered[body]) for body in np.flatnonzero(is_moved))
        self._waiting = np.flatnonzero(is_moved).tolist()

    @property
    def bodies(self) -> set[int]:
        """Those that have shapes."""
        return set(self._carrier.tolist())

    def offer(self, touch: haptic.Session, data: Any, dynamics: Optional[np.ndarray]) -> None:
        """Gives them to the server, at the poses that bodies have now."""
        positions, rotations = self._places(data)
        for i, carrier in enumerate(self._carrier):
            if carrier == 0:
                continue
            R = np.reshape(data.xmat[carrier], (3, 3))
            positions[i], rotations[i] = R.T @ (positions[i] - data.xpos[carrier]), R.T @ rotations[i]
        self._poses_offered = list(zip(np.array(data.xpos), np.array(data.xquat)))
        self._waits_until = touch.now + touch.state.round_trip + _TAKING
        shaped = self._shaped
        touch.offer(self._shapes, positions, quaternions(rotations), shaped.friction, "maximum", shaped.priority, shaped.apart,
                    dynamics)

    def _places(self, data: Any) -> tuple[np.ndarray, np.ndarray]:
        """Of the geoms in the world: positions, and rotations as matrices."""
        return np.array(data.geom_xpos)[self._geoms], np.array(data.geom_xmat)[self._geoms].reshape(-1, 3, 3)

    def gaps(self, data: Any) -> dict[int, float]:
        """How far each body is from the tool at least, m, those nearest first; by balls around the geoms."""
        return self._gaps.find(np.asarray(data.geom_xpos)[self._geoms])

    def poses(self, data: Any, bodies: Iterable[int], now: float, period: float) -> np.ndarray:
        """Where bodies are, and how they move, after mj_forward(). now: s; period: since the frame before, s."""
        model, chosen = self._model, np.fromiter(bodies, int)[:haptic.MAX_POSES]
        found, position = haptic.poses(len(chosen)), np.asarray(data.xpos)[chosen]
        found["body"], found["position"], found["rotation"] = chosen, position, np.asarray(data.xquat)[chosen]
        # MuJoCo's twist is at the centre of mass of all that moves with the body, the angular part first.
        twist, arm = np.asarray(data.cvel)[chosen], position - np.asarray(data.subtree_com)[model.body_rootid[chosen]]
        found["velocity"][:, :3], found["velocity"][:, 3:] = twist[:, 3:] + np.cross(twist[:, :3], arm), twist[:, :3]
        if self._waiting and now > self._waits_until:
            self._waiting = []
        for place in np.flatnonzero(np.asarray(model.body_dofnum)[chosen] == 0):
            body, pose = int(chosen[place]), (position[place], found["rotation"][place].copy())
            if body in self._waiting:
                found["position"][place], found["rotation"][place] = pose = self._pose_before[body]
            before = self._pose_before.get(body, pose)
            found["velocity"][place] = _velocity(before[0], before[1], pose[0], pose[1], period)
            self._pose_before[body] = pose
        return found

    def forget_motion(self) -> None:
        """Of walls that move: where they are now they were put."""
        self._waiting, self._pose_before = [], {}

    def _shape(self, geom: int, carrier: int, group: int, mask: int) -> haptic.shapes.Shape:
        name, sizes = _SHAPES[int(self._model.geom_type[geom])]
        side = haptic.TOOL_LINK if carrier in self._links else haptic.WORLD if carrier == 0 else haptic.MOVABLE_BODY
        size = sizes(np.asarray(self._model.geom_size[geom]))
        return haptic.shapes.shape(name, size, side, self._links.get(carrier, carrier), group, mask,
                                   self._vertices(geom) if name == "hull" else None)

    def _vertices(self, geom: int) -> np.ndarray:
        model = self._model
        mesh = int(model.geom_dataid[geom])
        first = int(model.mesh_vertadr[mesh])
        vertices = np.asarray(model.mesh_vert)[first:first + int(model.mesh_vertnum[mesh])]
        graph = int(model.mesh_graphadr[mesh])
        if graph < 0:
            return _thinned(vertices)
        # Of the hull that MuJoCo found: its number of vertices, of faces, an address of each vertex, and its place in the mesh.
        count = int(model.mesh_graph[graph])
        return _thinned(vertices[np.asarray(model.mesh_graph)[graph + 2 + count:graph + 2 + 2 * count]])


def _thinned(vertices: np.ndarray) -> np.ndarray:
    """As many as a hull may have: of those that are closer together than its size by so much, one."""
    grid = 1e-4 * float(np.ptp(vertices, axis=0).max(initial=0))
    while len(vertices) > _MOST_VERTICES:
        _, kept = np.unique(np.round(vertices / grid), axis=0, return_index=True)
        vertices, grid = vertices[kept], 2 * grid
    return vertices


def _places_apart(geoms: np.ndarray, apart: Iterable[tuple[int, int]]) -> Iterable[tuple[int, int]]:
    for one, other in apart:
        for i in np.flatnonzero(geoms == one).tolist():
            for j in np.flatnonzero(geoms == other).tolist():
                yield max(i, j), min(i, j)


def have_shapes(model: Any) -> np.ndarray:
    """Of each geom whether the server can be given its shape."""
    return np.isin(model.geom_type, list(_SHAPES))


def _velocity(position_before: np.ndarray, turn_before: np.ndarray, position: np.ndarray, turn: np.ndarray,
              period: float) -> np.ndarray:
    """Of a body that was there a period before."""
    linear = (position - position_before) / period
    if np.linalg.norm(linear) > _FASTEST:
        return np.zeros(6)
    turned = quaternions((rotation(turn) @ rotation(turn_before).T)[None])[0]
    return np.concatenate([linear, rotation_vector(turned) / period])


def version_of(binding: Any) -> tuple[int, ...]:
    """Major and minor."""
    return tuple(map(int, binding.mj_versionString().split(".")[:2]))


def carriers(model: Any, was_moved: Any = False) -> np.ndarray:
    """Of each body what it moves with: itself where joints or a mocap pose move it, or it was moved, else what its parent moves
    with; 0: nothing. Before 3.12 MuJoCo's body_weldid takes a mocap body for the world."""
    by_itself = (np.asarray(model.body_dofnum) > 0) | (np.asarray(model.body_mocapid) >= 0) | was_moved
    found = np.zeros(model.nbody, int)
    for body, parent in enumerate(np.asarray(model.body_parentid).tolist()):
        found[body] = body if by_itself[body] else found[parent]
    return found


def moving_bodies(model: Any) -> np.ndarray:
    """Of each body the one that it moves with by joints: 0, the world, where there are none, and so for a mocap body."""
    found = carriers(model)
    return np.where(np.asarray(model.body_dofnum)[found] == 0, 0, found)
