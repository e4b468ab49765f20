"""Which geoms of a MuJoCo model touch each other, and with which friction."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

import haptic_local_model as haptic

_EXCLUDED_FROM_0 = (3, 0)  # The version from which on bodies of excluded pairs are counted from 0, before from 1.
_TOOL = 2  # The rank of the tool's geoms, before that of what moves and of what does not.
_ALL_BITS = 2**32 - 1
_OF_PAIR = 255  # The priority of what a <pair> says; that of a geom is less.


class Shaped(NamedTuple):
    """What is offered of the geoms. One that a <pair> names is there once more, for what it touches by that pair: with the pair's
    friction, whatever masks, excludes and the geoms themselves say."""
    geoms: np.ndarray
    groups: np.ndarray
    masks: np.ndarray
    friction: np.ndarray
    priority: np.ndarray
    apart: list[tuple[int, int]]  #: places in `geoms`


class Pairs:
    """Of one model, as it is now. carrier: of each geom what moves it; 0: nothing."""

    def __init__(self, binding: Any, model: Any, carrier: np.ndarray, tool: int, version: tuple[int, ...]):
        self._binding, self._model, self._version = binding, model, version
        self._rank = np.where(carrier == tool, _TOOL, carrier != 0)
        touches = not (self.is_disabled("CONTACT") or self.is_disabled("CONSTRAINT"))
        groups, masks = (np.asarray(each).astype(np.int64) & _ALL_BITS for each in (model.geom_contype, model.geom_conaffinity))
        used = int(np.bitwise_or.reduce(groups, initial=0) & np.bitwise_or.reduce(masks, initial=0)) * touches
        self._groups, self._masks, self._used = groups & used, masks & used, used
        #: Of each geom whether it can touch something, by masks or by a <pair>.
        self.touches = (self._groups | self._masks) != 0
        friction = self._friction(model.pair_friction, model.pair_dim)
        self._listed = [pair for pair in zip(model.pair_geom1, model.pair_geom2, friction)
                        if touches and self._rank[list(pair[:2])].any()]
        for one, other, _ in self._listed:
            self.touches[[one, other]] = True

    def is_disabled(self, flag: str) -> bool:
        """By the model's flags. Which there are depends on MuJoCo's version."""
        return has_flag(self._binding.mjtDisableBit, "mjDSBL_" + flag, self._model.opt.disableflags)

    def shaped(self, chosen: np.ndarray) -> Shaped:
        """chosen: of each geom whether it has a shape."""
        model = self._model
        masks, copies, partners = self._masks.copy(), {}, set()
        bit = next((1 << bit for bit in range(32) if not self._used >> bit & 1), None)
        listed = [pair for pair in self._listed if chosen[list(pair[:2])].all()]
        if listed and bit is None:
            raise haptic.HapticError("contype and conaffinity must leave one of 32 bits for what <pair> says")
        for one, other, friction in listed:
            copied, partner = sorted((int(one), int(other)), key=lambda geom: -self._rank[geom])
            copies.setdefault((copied, float(friction)), set()).add(partner)
            masks[partner] |= bit
            partners.add(partner)
        kept, of_tool = chosen & ((self._groups | masks) != 0), chosen & (self._rank == _TOOL)
        if not kept[of_tool].any():
            kept |= of_tool  # It touches nothing, but a scene has a tool.
        own = np.flatnonzero(kept)
        place = {int(geom): i for i, geom in enumerate(own)}
        apart = self._excluded(own)
        apart |= {(place[int(a)], place[int(b)]) for a, b, _ in listed if int(a) in place and int(b) in place}
        apart |= {(len(own) + i, place[other]) for i, met in enumerate(copies.values()) for other in partners - met}
        geoms = np.concatenate([own, np.array([geom for geom, _ in copies], int)])
        n, of_pair = len(own), [friction for _, friction in copies]
        _, priority = np.unique(np.asarray(model.geom_priority)[own], return_inverse=True)
        return Shaped(
            geoms, np.append(self._groups[own], np.full(len(copies), bit or 0)), np.append(masks[own], np.zeros(len(copies), int)),
            np.append(self._friction(model.geom_friction, model.geom_condim)[own], of_pair),
            np.append(np.minimum(priority, _OF_PAIR - 1), np.full(len(geoms) - n, _OF_PAIR)),
            sorted((max(pair), min(pair)) for pair in apart))

    def _friction(self, coefficients: Any, dimensions: Any) -> np.ndarray:
        """Along the surface. None for a dimension of 1; the same for all where the model overrides it."""
        option, along = self._model.opt, np.asarray(coefficients)[:, 0]
        if has_flag(self._binding.mjtEnableBit, "mjENBL_OVERRIDE", option.enableflags):
            along = float(option.o_friction[0])
        return np.where(np.asarray(dimensions) > 1, along, 0)

    def _excluded(self, geoms: np.ndarray) -> set[tuple[int, int]]:
        """Bodies and their parents, and what the model excludes, which it names by the bodies before welding; places in
        `geoms`."""
        model, welded = self._model, np.asarray(self._model.body_weldid)
        own = np.asarray(model.geom_bodyid)[geoms]
        body = welded[own]
        moving = np.flatnonzero(body)
        parent = welded[np.asarray(model.body_parentid)[body]]
        children = np.argwhere(body[moving, None] == parent[None, moving])
        found = set() if self.is_disabled("FILTERPARENT") else {(int(moving[a]), int(moving[b])) for a, b in children}
        first, second = np.divmod(np.asarray(model.exclude_signature, dtype=np.int64), 1 << 16)
        base = 0 if self._version >= _EXCLUDED_FROM_0 else 1
        for p, q in zip(first - base, second - base):
            found |= {(int(i), int(j)) for i in np.flatnonzero(own == p) for j in np.flatnonzero(own == q)}
        return found


def has_flag(flags: Any, name: str, value: Any) -> bool:
    bit = getattr(flags, name, None)
    return bit is not None and bool(int(value) & int(bit))
