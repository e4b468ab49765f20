"""A device of robosuite with the output that its devices lack: a force.

    env = robosuite.make("Lift", robots="Panda", ...)
    with haptic.Session(tool=haptic.box(mass=0.3, size=(0.04, 0.04, 0.04)), rate=env.control_freq) as touch:
        device = haptic.robosuite.HapticDevice(env, touch)
        env = haptic.robosuite.ForceCollectionWrapper(env, directory, device)   # robosuite's recorder, and the force
        collect_human_trajectory(env, device, arm="right", max_fr=20, goal_update_mode="target")  # of robosuite's scripts

robosuite 1.5.2 knows devices by a list of its own, in each script: there is no loader that would find another one. In a loop of
your own, without the wrapper, call device.feel() after env.step().

For arms under OSC_POSE. The session's world has the axes of robosuite's, with its origin where the hand is when control starts.
Button 0 closes the gripper, button 1 resets.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from robosuite.devices import Device
from robosuite.wrappers import DataCollectionWrapper

import haptic_local_model as haptic
from haptic_local_model._world import quaternions, rotation, rotation_vector

__all__ = ["ForceCollectionWrapper", "HapticDevice"]

_GRASP, _RESET = 1, 2  # masks of the buttons


class HapticDevice(Device):
    """env: with one robot or more, after its reset(). touch: a session of one link. force_scale: which part of the force the hand
    feels. An arm follows with a lag of its own, some 0.1 s, and presses with 2 kN/m or more where its target is in a wall: at 20
    steps a second a hand feels that to and fro by some newtons with all of the force, steadily with half of it, and with the
    quarter also where steps come late."""

    def __init__(self, env: Any, touch: haptic.Session, force_scale: float = 0.25):
        super().__init__(env)
        self._touch, self._scale = touch, force_scale
        self.force = np.zeros(3)  #: What the hand was given last, N, world axes.
        self._reset_internal_state()

    def _reset_internal_state(self) -> None:
        super()._reset_internal_state()
        self._touch.poll()
        self._hand, self._hand_turn = self._touch.q[:3].copy(), rotation(self._touch.q[3:])
        self._place, self._turn = map(np.array, self._end_effector())

    def start_control(self) -> None:
        """From here on the hand moves the arm."""
        self._reset_internal_state()

    def get_controller_state(self) -> dict[str, Any]:
        """How far the end effector is from where the hand belongs: OSC_POSE adds it to where the arm is, not to where it was
        to be. What a step has no room for comes with the next ones."""
        self._touch.poll()
        place, turn = self._end_effector()
        to_frame = self._controller.origin_ori.T if self._controller.input_ref_frame == "base" else np.eye(3)
        dpos = to_frame @ (self._place + self._touch.q[:3] - self._hand - place)
        R = rotation(self._touch.q[3:]) @ self._hand_turn.T @ self._turn
        drotation = to_frame @ rotation_vector(quaternions((R @ turn.T)[None])[0])  # rad
        buttons = self._touch.state.buttons
        # input2action() swaps the first two of the rotation and turns the third round.
        return {"dpos": dpos, "rotation": R, "raw_drotation": np.array([drotation[1], drotation[0], -drotation[2]]),
                "grasp": int(bool(buttons & _GRASP)), "reset": int(bool(buttons & _RESET)), "base_mode": int(self.base_mode)}

    def _postprocess_device_outputs(self, dpos: np.ndarray, drotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        largest = self._controller.output_max
        return _at_most(dpos / largest[:3]), _at_most(drotation / largest[3:])

    def feel(self) -> np.ndarray:
        """After env.step(): lets the hand feel the force on the end effector, and returns what it feels, N, world axes."""
        self.force = self._scale * self._force_on_gripper()
        self._touch.sample(self._touch.q, self._touch.v, 1 / self.env.control_freq)
        self._touch.external_wrench([*self.force, 0, 0, 0])
        self._touch.send()
        return self.force

    @property
    def _robot(self) -> Any:
        return self.env.robots[self.active_robot]

    @property
    def _controller(self) -> Any:
        return self._robot.part_controllers[self.active_arm]

    def _end_effector(self) -> tuple[np.ndarray, np.ndarray]:
        """Position and rotation of what OSC_POSE moves, in the world."""
        site, data = self._robot.eef_site_id[self.active_arm], self.env.sim.data
        return np.array(data.site_xpos[site]), np.array(data.site_xmat[site]).reshape(3, 3)

    def _force_on_gripper(self) -> np.ndarray:
        """Of all but its weight, N, world axes: its sensor reads with what the arm holds it."""
        sim, sensor = self.env.sim, self._robot.gripper[self.active_arm].important_sensors["force_ee"]
        site = sim.model.sensor_objid[sim.model.sensor_name2id(sensor)]
        held = np.array(sim.data.site_xmat[site]).reshape(3, 3) @ self._robot.ee_force[self.active_arm]
        return -held - sim.model.body_subtreemass[sim.model.site_bodyid[site]] * np.array(sim.model.opt.gravity)


class ForceCollectionWrapper(DataCollectionWrapper):
    """robosuite's recorder, with what the hand felt in each step: "force" among the action_infos, N, world axes."""

    def __init__(self, env: Any, directory: str, device: HapticDevice, **options: Any):
        super().__init__(env, directory, **options)
        self._device = device
        self._forces: list[np.ndarray] = []

    def step(self, action: np.ndarray) -> Any:
        # That of the step before: this one is written down, and perhaps to the disk, within the call.
        self._forces.append(np.array(self._device.force))
        result = super().step(action)
        self._device.feel()
        return result

    def _flush(self) -> None:
        kept = self._forces[self.collect_freq - 1::self.collect_freq]
        for info, force in zip(self.action_infos, kept):
            info["force"] = force
        self._forces = []
        super()._flush()


def _at_most(vector: np.ndarray) -> np.ndarray:
    """Of length 1 at most, in the same direction."""
    return vector / max(1, np.linalg.norm(vector))
