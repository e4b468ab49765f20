"""A haptic device as a LeRobot teleoperator that is felt.

    lerobot-teleoperate --teleop.type=haptic --teleop.server=127.0.0.1:47800 --robot.type=...

LeRobot finds this package by its name. The action is where the hand belongs, as LeRobot's steps for end effectors take it:
ee.x, ee.y, ee.z (m), ee.wx, ee.wy, ee.wz (rotation vector, rad) and ee.gripper_pos. What the hand feels is the force
force.x, force.y, force.z (N, world axes) on the end effector, in each frame that has one.

LeRobot's own loops call send_feedback() for no robot (0.4.4), or for its unitree_g1 alone (0.6.1). FeelObservation does it for
any robot whose observation has the force, as a step of the pipeline that each of these loops takes:

    steps = RobotProcessorPipeline[tuple[RobotAction, RobotObservation], RobotAction](
        steps=[FeelObservation(teleop)], to_transition=robot_action_observation_to_transition,
        to_output=transition_to_robot_action)
    record_loop(robot=robot, teleop=teleop, teleop_action_processor=steps, ...)
"""

from __future__ import annotations

import dataclasses
from typing import Any, Optional, Sequence

import numpy as np
from lerobot.processor import RobotActionProcessorStep
from lerobot.processor.core import TransitionKey
from lerobot.teleoperators import Teleoperator, TeleoperatorConfig

import haptic_local_model as haptic
from haptic_local_model._world import rotation_vector

__all__ = ["FeelObservation", "HapticTeleoperator", "HapticTeleoperatorConfig"]

_POSE = ("ee.x", "ee.y", "ee.z", "ee.wx", "ee.wy", "ee.wz")
_GRIPPER = "ee.gripper_pos"
_FORCE = ("force.x", "force.y", "force.z")


@TeleoperatorConfig.register_subclass("haptic")
@dataclasses.dataclass(kw_only=True)
class HapticTeleoperatorConfig(TeleoperatorConfig):
    """server, key_file: as haptic.Session's. rate: of LeRobot's frames, Hz. mass, kg, and size, m: of the cube that the hand
    holds. start: where it is when the session begins, in the robot's frame, m. gripper: ee.gripper_pos of the closed and of the
    open gripper. grasp_button: of a device without a gripper, the number of the button that closes it."""
    server: Optional[str] = None
    key_file: Optional[str] = None
    rate: float = 30
    mass: float = 0.3
    size: float = 0.04
    start: tuple[float, float, float] = (0, 0, 0)
    gripper: tuple[float, float] = (0, 100)
    grasp_button: Optional[int] = None


class HapticTeleoperator(Teleoperator):
    config_class = HapticTeleoperatorConfig
    name = "haptic"

    def __init__(self, config: HapticTeleoperatorConfig):
        super().__init__(config)
        self.config = config
        self.touch: Optional[haptic.Session] = None  #: While it is connected.
        self._force: Optional[np.ndarray] = None     # of this frame, N
        self._sent_at = 0.0
        self._at = self._before = (np.zeros(7), np.zeros(6))  # pose and velocity of the action, and of that before

    @property
    def action_features(self) -> dict[str, type]:
        return dict.fromkeys((*_POSE, _GRIPPER), float)

    @property
    def feedback_features(self) -> dict[str, type]:
        return dict.fromkeys(_FORCE, float)

    @property
    def is_connected(self) -> bool:
        return self.touch is not None

    @property
    def is_calibrated(self) -> bool:
        return True

    def calibrate(self) -> None:
        """A haptic device is calibrated by its server."""

    def configure(self) -> None:
        """Nothing to do."""

    def connect(self, calibrate: bool = True) -> None:
        """Raises haptic.HapticError where the configuration cannot be used."""
        config = self.config
        self.touch = haptic.Session(config.server, haptic.box(config.mass, (config.size,) * 3), rate=config.rate,
                                    q=(*config.start, 1, 0, 0, 0), key_file=config.key_file)
        self._sent_at = self.touch.now
        self._at = self._before = (self.touch.q, self.touch.v)

    def get_action(self) -> dict[str, float]:
        touch = self._connected()
        if self._force is None:  # None came in the frame before: there is none.
            self._send(np.zeros(3), self._before[0][:3])
        self._force = None
        touch.poll()
        self._before, self._at = self._at, (touch.q, touch.v)
        button = self.config.grasp_button
        opening = touch.state.gripper if button is None else float(not touch.state.buttons >> button & 1)
        closed, opened = self.config.gripper
        pose = (*touch.q[:3], *rotation_vector(touch.q[3:]))
        return {**{name: float(value) for name, value in zip(_POSE, pose)}, _GRIPPER: closed + (opened - closed) * opening}

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Once in each frame, after get_action(). feedback: what feedback_features names, N, as observed before that call, where
        the action before had led the robot; where it has ee.x, ee.y and ee.z, too, m, it was observed there. Raises
        haptic.HapticError where a force is missing or not finite."""
        self._connected()
        missing = [name for name in _FORCE if name not in feedback]
        if missing:
            raise haptic.HapticError(f"feedback has no {missing[0]}; it must have {', '.join(_FORCE)}, N")
        self._force = np.array([feedback[name] for name in _FORCE], dtype=float)
        self._send(self._force, [feedback.get(name, value) for name, value in zip(_POSE[:3], self._before[0])])

    def disconnect(self) -> None:
        if self.touch is not None:
            self.touch.close()
        self.touch = None

    def _send(self, force: np.ndarray, place: Sequence[float]) -> None:
        touch = self._connected()
        now = touch.now
        period, self._sent_at = max(now - self._sent_at, 1e-4), now
        q, v = self._before
        touch.sample([*place, *q[3:]], v, period)
        touch.external_wrench([*force, 0, 0, 0])
        touch.send()

    def _connected(self) -> haptic.Session:
        if self.touch is None:
            raise haptic.HapticError("the teleoperator is not connected: call connect()")
        return self.touch


class FeelObservation(RobotActionProcessorStep):
    """Lets the hand feel the force in the robot's observation; the action passes as it is."""

    def __init__(self, teleop: HapticTeleoperator):
        self._teleop = teleop

    def action(self, action: dict[str, Any]) -> dict[str, Any]:
        self._teleop.send_feedback(self.transition[TransitionKey.OBSERVATION])
        return action

    def transform_features(self, features: Any) -> Any:
        return features
