"""The geoms of a MuJoCo model as shapes for the server."""

from __future__ import annotations

from typing import Any, Iterable, Optional

import numpy as np

import haptic_local_model as haptic
import haptic_local_model.shapes
from haptic_local_model._world import Gaps, quaternions

# For each mjtGeom: kind and sizes of haptic.shapes.
_SHAPES = {0: ("half_space", lambda size: ()), 2: ("sphere", lambda size: size[:1]),
           3: ("capsule", lambda size: (size[0], 2 * size[1])), 4: ("ellipsoid", lambda size: size),
           5: ("cylinder", lambda size: (size[0], 2 * size[1])), 6: ("box", lambda size: 2 * size),
           7: ("hull", lambda size: ())}
# The version from which on bodies of excluded pairs are counted from 0, before from 1.
_EXCLUDED_FROM_0 = (3, 0)


class Shapes:
    """The model's geoms. The index of a body is its own, or that of what it is welded to."""

    def __init__(self, model: Any, tool: int, version: tuple[int, ...]):
        self._model, self._version = model, version
        collides = (np.asarray(model.geom_contype) != 0) | (np.asarray(model.geom_conaffinity) != 0)
        has_shape = collides & np.isin(model.geom_type, list(_SHAPES))
        self._geoms = np.flatnonzero(has_shape)
        by_pair = np.zeros(model.ngeom, bool)
        by_pair[np.asarray(model.pair_geom1)] = by_pair[np.asarray(model.pair_geom2)] = True
        #: Of each geom whether MuJoCo finds its contacts: what has no shape here, or collides by <pair> alone.
        self.by_engine = (collides | by_pair) & ~has_shape
        own = np.asarray(model.geom_bodyid)[self._geoms]
        body = np.asarray(model.body_weldid)[own]
        owners = moving_bodies(model)[own]
        if tool not in owners:
            raise haptic.HapticError("no geom of the tool can be given as a shape: they must be meshes or basic shapes")
        self._tool, self._welded = tool, body
        self._shapes = [self._shape(int(geom), int(owner), tool) for geom, owner in zip(self._geoms, owners)]
        self._apart = self._excluded(own, body)
        #: Of each geom what it moves with: a mocap body moves by itself.
        self._carrier = np.where((owners == 0) & (np.asarray(model.body_mocapid)[body] >= 0), body, owners)
        self._gaps = Gaps(np.array(model.geom_rbound)[self._geoms], self._carrier, tool)
        self._mocap: dict[int, np.ndarray] = {}  # Pose of each in the frame before.

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
            if carrier != self._tool:
                self._shapes[i].side, self._shapes[i].index = haptic.MOVABLE_BODY, int(carrier)
        friction = np.asarray(self._model.geom_friction)[self._geoms, 0]
        _, priority = np.unique(np.asarray(self._model.geom_priority)[self._geoms], return_inverse=True)
        touch.offer(self._shapes, positions, quaternions(rotations), friction, "maximum",
                    np.minimum(priority, 255), self._apart, dynamics)

    def _places(self, data: Any) -> tuple[np.ndarray, np.ndarray]:
        """Of the geoms in the world: positions, and rotations as matrices."""
        return np.array(data.geom_xpos)[self._geoms], np.array(data.geom_xmat)[self._geoms].reshape(-1, 3, 3)

    def gaps(self, data: Any) -> dict[int, float]:
        """How far each body is from the tool at least, m, those nearest first; by balls around the geoms."""
        return self._gaps.find(np.asarray(data.geom_xpos)[self._geoms])

    def poses(self, data: Any, bodies: Iterable[int], period: float) -> np.ndarray:
        """Where bodies are, and how they move, after mj_forward(); period: since the frame before, s."""
        model, chosen = self._model, np.fromiter(bodies, int)[:haptic.MAX_POSES]
        found, position = haptic.poses(len(chosen)), np.asarray(data.xpos)[chosen]
        found["body"], found["position"], found["rotation"] = chosen, position, np.asarray(data.xquat)[chosen]
        # MuJoCo's twist is at the centre of mass of all that moves with the body, the angular part first.
        twist, arm = np.asarray(data.cvel)[chosen], position - np.asarray(data.subtree_com)[model.body_rootid[chosen]]
        found["velocity"][:, :3], found["velocity"][:, 3:] = twist[:, 3:] + np.cross(twist[:, :3], arm), twist[:, :3]
        for place in np.flatnonzero(np.asarray(model.body_mocapid)[chosen] >= 0):
            body = int(chosen[place])
            found["velocity"][place] = 0
            found["velocity"][place, :3] = (position[place] - self._mocap.get(body, position[place])) / period
            self._mocap[body] = position[place]
        return found

    def _shape(self, geom: int, owner: int, tool: int) -> haptic.shapes.Shape:
        model = self._model
        size = np.asarray(model.geom_size[geom])
        name, sizes = _SHAPES[int(model.geom_type[geom])]
        side = haptic.TOOL_LINK if owner == tool else haptic.WORLD if owner == 0 else haptic.MOVABLE_BODY
        return haptic.shapes.shape(
            name, sizes(size), side, 0 if owner == tool else owner, int(model.geom_contype[geom]),
            int(model.geom_conaffinity[geom]), self._vertices(geom) if name == "hull" else None)

    def _vertices(self, geom: int) -> np.ndarray:
        model = self._model
        mesh = int(model.geom_dataid[geom])
        first = int(model.mesh_vertadr[mesh])
        return np.asarray(model.mesh_vert)[first:first + int(model.mesh_vertnum[mesh])]

    def _excluded(self, own: np.ndarray, body: np.ndarray) -> list[tuple[int, int]]:
        """Bodies and their parents, and what the model excludes, which it names by the bodies before welding."""
        model = self._model
        parent = np.asarray(model.body_weldid)[np.asarray(model.body_parentid)[body]]
        first, second = np.divmod(np.asarray(model.exclude_signature, dtype=np.int64), 1 << 16)
        base = 0 if self._version >= _EXCLUDED_FROM_0 else 1
        named = {(int(p) - base, int(q) - base) for p, q in zip(first, second)}
        def apart(i: int, j: int) -> bool:
            related = body[i] != 0 and body[j] != 0 and (body[i] == parent[j] or body[j] == parent[i])
            return bool(related) or any((int(p), int(q)) in named
                                        for p, q in ((own[i], own[j]), (own[j], own[i])))
        return [(i, j) for i in range(len(body)) for j in range(i) if apart(i, j)]


def version_of(binding: Any) -> tuple[int, ...]:
    """Major and minor."""
    return tuple(map(int, binding.mj_versionString().split(".")[:2]))


def moving_bodies(model: Any) -> np.ndarray:
    """Of each body the one that it moves with by joints: 0, the world, where there are none, and so for a mocap body."""
    welded = np.asarray(model.body_weldid)
    return np.where(np.asarray(model.body_dofnum)[welded] == 0, 0, welded)
