"""When MuJoCo lists contacts, and whether those of the tool have a force."""

from __future__ import annotations

from typing import Any, Optional

import numpy as np

from haptic_local_model._mujoco_changes import Changes

_NO_FORCE = 1e3  # m: a depth that none reaches
# Versions from which on margins and gaps of a pair's geoms add up, before the larger counts; and a gap lies beyond the
# margin, where contacts have no force, before within it.
_ADDED_UP, _GAP_BEYOND = (3, 5), (3, 9)


class Listing:
    """Of one model, whose margins and gaps it changes."""

    def __init__(self, model: Any, changes: Changes, version: tuple[int, ...], epsilon: float, tool_geoms: np.ndarray):
        """epsilon: how far before they touch, m. tool_geoms: the tool's."""
        self._model, self._changes, self._version, self._epsilon = model, changes, version, epsilon
        of_tool = np.flatnonzero(np.isin(model.pair_geom1, tool_geoms) | np.isin(model.pair_geom2, tool_geoms))
        self._of_tool = (("geom", tool_geoms), ("pair", of_tool))
        self._has_force: Optional[bool] = None
        self.early = np.zeros(model.ngeom, bool)  #: Of each geom whether its contacts are listed before they touch.

    def set_force(self, own: bool) -> None:
        """Whether the tool's contacts have MuJoCo's force; they are listed where they were."""
        if own == self._has_force:
            return
        self._has_force = own
        self._set()

    def list_early(self, geoms: np.ndarray) -> None:
        """geoms: of each whether it is meant. The force begins where it did, and the list of contacts epsilon before; where
        both geoms of a pair have a share in it, each has half."""
        self.early = self.early | geoms
        self._set()

    def _set(self) -> None:
        """Margins, gaps and what MuJoCo derives of them, all from what the model has by itself."""
        model, own = self._model, self._changes.own
        of_geom = self._epsilon / 2 if self.early.all() and self._version >= _ADDED_UP else self._epsilon
        pairs = self.early[model.pair_geom1] | self.early[model.pair_geom2]
        for (kind, of_tool), early in zip(self._of_tool, (self.early * of_geom, pairs * self._epsilon)):
            margin, gap = own(kind + "_margin"), own(kind + "_gap") + early
            if self._version < _GAP_BEYOND:
                margin = margin + early
            if kind == "geom":
                farthest = margin + gap
            if self._has_force is False and self._version >= _GAP_BEYOND:
                gap[of_tool] += margin[of_tool] + _NO_FORCE
                margin[of_tool] = -_NO_FORCE
            elif self._has_force is False:
                gap[of_tool] = _NO_FORCE
            self._changes.set(kind + "_margin", slice(None), margin)
            self._changes.set(kind + "_gap", slice(None), gap)
        # MuJoCo 3 looks at a pair of bodies with several geoms only within these, which its compiler found.
        if self.early.any() and hasattr(model, "body_margin"):
            widest = self._changes.own("body_margin")
            np.maximum.at(widest, model.geom_bodyid, farthest)
            self._changes.set("body_margin", slice(None), widest)
