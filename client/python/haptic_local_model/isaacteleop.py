"""The seat that IsaacTeleop has for a grounded force device, filled by a haptic server.

    with haptic.Session(tool=haptic.box(mass=0.3, size=(0.04, 0.04, 0.04))) as touch:
        sink = HapticSink("haptics", haptic.isaacteleop.HapticDevice(touch))    # HapticSink is IsaacTeleop's
        config = TeleopSessionConfig(..., sinks=[sink.connect({"device": force.output("value")})])

Takes IsaacTeleop's EndEffectorForce: fx, fy, fz, N. The device's frame is the world of the session. `position` and `rotation`
are where the simulator's tool belongs in the next frame, and the force is what it meets there. Call nothing else of the session:
flush() polls and sends.
"""

from __future__ import annotations

import logging
from typing import Any, Optional

import numpy as np
from isaacteleop.haptic_devices import IHapticDevice
from isaacteleop.retargeting_engine.tensor_types import EndEffectorForce

import haptic_local_model as haptic

__all__ = ["ENDPOINT", "HapticDevice"]

ENDPOINT = "device"  # IsaacTeleop's name for a single grounded one


class HapticDevice(IHapticDevice):
    """touch: a session of one link."""

    def __init__(self, touch: haptic.Session) -> None:
        self._touch = touch
        self._force = np.zeros(3)
        self._flushed_at = touch.now
        self._warned = False

    @property
    def position(self) -> np.ndarray:
        """m."""
        return self._touch.q[:3]

    @property
    def rotation(self) -> np.ndarray:
        """w, x, y, z."""
        return self._touch.q[3:]

    def accepted_type(self) -> Any:
        return EndEffectorForce()

    def endpoints(self) -> tuple[str, ...]:
        return (ENDPOINT,)

    def apply(self, endpoint: str, values: np.ndarray) -> None:
        if endpoint != ENDPOINT or np.shape(values) != (3,):
            raise ValueError(f"endpoint {endpoint!r} with the shape {np.shape(values)} must be {ENDPOINT!r} with (3,)")
        self._force = np.array(values, dtype=np.float64)

    def flush(self, deviceio_session: Any) -> None:
        """Never raises, as IsaacTeleop asks: what is wrong is logged, once."""
        try:
            now = self._touch.now
            period, self._flushed_at = max(now - self._flushed_at, 1e-4), now
            self._touch.sample(self._touch.q, self._touch.v, period)
            self._touch.external_wrench([*self._force, 0, 0, 0])
            self._touch.send()
            self._touch.poll()
        except haptic.HapticError as error:
            if not self._warned:
                logging.getLogger(__name__).warning("no force is sent to the haptic server: %s", error)
            self._warned = True
        self._force = np.zeros(3)  # Where none comes in the next frame, there is none.

    def get_tracker(self) -> Optional[Any]:
        return None
