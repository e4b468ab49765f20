"""How bodies move that joints connect."""

from __future__ import annotations

from typing import NamedTuple, Sequence

import numpy as np
from numpy.typing import ArrayLike


class Freedom(NamedTuple):
    """A direction in which a body moves against its parent, and with it all that it carries: with the velocity `linear` +
    `angular` × (x - point) of a point x; world axes."""
    body: int
    linear: ArrayLike
    angular: ArrayLike
    point: ArrayLike
    damping: float = 0.0  # N s/m or N m s


class Tree:
    """Bodies at their present pose, parents before children, each with its parent's place or -1; all in world axes.

    Of all forces gravity alone is known. Its acceleration is without the centripetal part. Damping acts as an implicit step
    over `delay`, s, has it: faster than that it would chatter."""

    def __init__(self, parents: Sequence[int], masses: Sequence[float], inertias: Sequence[ArrayLike] | np.ndarray, centres: ArrayLike,
                 freedoms: Sequence[Freedom], gravity: ArrayLike, delay: float = 0.0):
        n, count = len(parents), len(freedoms)
        self._J = np.zeros((n, 6, count))
        centres = np.asarray(centres, dtype=float)
        carried = np.eye(n, dtype=bool)  # [a, b]: a carries b
        for body, parent in enumerate(parents):
            if parent >= 0:
                carried[:, body] |= carried[:, parent]
        for column, (body, linear, angular, point, _) in enumerate(freedoms):
            for other in np.flatnonzero(carried[body]):
                self._J[other, :3, column] = linear + np.cross(np.asarray(angular), centres[other] - point)
                self._J[other, 3:, column] = angular
        M = np.diag([delay * freedom.damping for freedom in freedoms]) if freedoms else np.zeros((0, 0))
        of_weight = np.zeros(count)
        for J, mass, inertia in zip(self._J, masses, inertias):
            M = M + mass * J[:3].T @ J[:3] + J[3:].T @ inertia @ J[3:]
            of_weight += mass * J[:3].T @ np.asarray(gravity)
        self._inverse = np.linalg.inv(M)
        self._acceleration = self._inverse @ of_weight

    def inverse_inertia(self, body: int) -> np.ndarray:
        """About its centre of mass, what the joints leave."""
        return self._J[body] @ self._inverse @ self._J[body].T

    def acceleration(self, body: int) -> np.ndarray:
        """Of its centre of mass, linear and angular, by all that is known."""
        return self._J[body] @ self._acceleration

    def velocity(self, body: int, speeds: ArrayLike) -> np.ndarray:
        """Of its centre of mass, linear and angular; speeds: along the freedoms."""
        return self._J[body] @ np.asarray(speeds, dtype=float)


def free(body: int, centre: ArrayLike) -> list[Freedom]:
    """The six directions of a body that nothing holds; their speeds are its velocity, linear and angular."""
    axes, none = np.eye(3), np.zeros(3)
    return [Freedom(body, axis, none, centre) for axis in axes] + [Freedom(body, none, axis, centre) for axis in axes]
