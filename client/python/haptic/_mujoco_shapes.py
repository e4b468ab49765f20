"""The geoms of a MuJoCo model for haptic.proximity."""

from __future__ import annotations

from typing import Any

import numpy as np

import haptic
import haptic.proximity

# For each mjtGeom: kind and sizes of haptic.proximity.
_SHAPES = {0: ("half_space", lambda size: ()), 2: ("sphere", lambda size: size[:1]),
           3: ("capsule", lambda size: (size[0], 2 * size[1])), 4: ("ellipsoid", lambda size: size),
           5: ("cylinder", lambda size: (size[0], 2 * size[1])), 6: ("box", lambda size: 2 * size),
           7: ("hull", lambda size: ())}
# The version from which on bodies of excluded pairs are counted from 0, before from 1.
_EXCLUDED_FROM_0 = (3, 0)


class Shapes:
    """The model's geoms as haptic.proximity has them. The index of a body is its own, or that of what it is
    welded to."""

    def __init__(self, model: Any, tool: int, version: tuple[int, ...]):
        self._model, self._version = model, version
        collides = (np.asarray(model.geom_contype) != 0) | (np.asarray(model.geom_conaffinity) != 0)
        self._geoms = np.flatnonzero(collides)
        own = np.asarray(model.geom_bodyid)[self._geoms]
        body = np.asarray(model.body_weldid)[own]
        by_pair = sorted({*np.asarray(model.pair_geom1).tolist(), *np.asarray(model.pair_geom2).tolist()}
                         - set(self._geoms.tolist()))
        if by_pair:
            raise haptic.HapticError(f"geom {by_pair[0]} collides by <pair> alone; use contacts='engine'")
        owners = moving_bodies(model)[own]
        shapes = [self._shape(int(geom), int(owner), tool) for geom, owner in zip(self._geoms, owners)]
        self._proximity = haptic.proximity.Proximity(shapes, self._excluded(own, body))

    def find(self, data: Any, epsilon: float) -> np.ndarray:
        """Contacts at the present poses, with the friction of their geoms."""
        rotations = _quaternions(np.asarray(data.geom_xmat)[self._geoms].reshape(-1, 3, 3))
        found = self._proximity.find(np.asarray(data.geom_xpos)[self._geoms], rotations, epsilon)
        friction, priority = np.asarray(self._model.geom_friction)[:, 0], np.asarray(self._model.geom_priority)
        a, b = self.geoms_of_contacts.T
        found["friction"] = np.where(priority[a] == priority[b], np.maximum(friction[a], friction[b]),
                                     np.where(priority[a] > priority[b], friction[a], friction[b]))
        return found

    @property
    def geoms_of_contacts(self) -> np.ndarray:
        """Geoms of side a and b of each contact of the latest find()."""
        return self._geoms[self._proximity.shapes]

    def _shape(self, geom: int, owner: int, tool: int) -> haptic.proximity.Shape:
        model = self._model
        kind, size = int(model.geom_type[geom]), np.asarray(model.geom_size[geom])
        if kind not in _SHAPES:
            raise haptic.HapticError(f"geom {geom} is of type {kind}, must be one of {sorted(_SHAPES)} "
                                     "(planes, meshes and basic shapes)")
        name, sizes = _SHAPES[kind]
        side = haptic.TOOL_LINK if owner == tool else haptic.WORLD if owner == 0 else haptic.MOVABLE_BODY
        return haptic.proximity.shape(
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


def _quaternions(matrices: np.ndarray) -> np.ndarray:
    """(w, x, y, z) of each: of four ways the one without a small divisor."""
    m = matrices
    d0, d1, d2 = m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]
    yz, zy, zx, xz, xy, yx = m[:, 2, 1], m[:, 1, 2], m[:, 0, 2], m[:, 2, 0], m[:, 1, 0], m[:, 0, 1]
    ways = np.array([[1 + d0 + d1 + d2, yz - zy, zx - xz, xy - yx],
                     [yz - zy, 1 + d0 - d1 - d2, xy + yx, zx + xz],
                     [zx - xz, xy + yx, 1 - d0 + d1 - d2, yz + zy],
                     [xy - yx, zx + xz, yz + zy, 1 - d0 - d1 + d2]])
    best = np.argmax([1 + d0 + d1 + d2, 1 + d0 - d1 - d2, 1 - d0 + d1 - d2, 1 - d0 - d1 + d2], axis=0)
    chosen = ways[best, :, np.arange(len(m))]
    return chosen / np.linalg.norm(chosen, axis=1, keepdims=True)
