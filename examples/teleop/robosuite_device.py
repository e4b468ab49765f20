"""A device of robosuite with the output that its devices lack: a force, through a haptic server.

    with haptic.Session(tool=haptic.box(mass=0.3, size=(0.04, 0.04, 0.04)), rate=20) as touch:
        device = HapticDevice(env, touch)
        device.start_control()
        while (action := device.input2action()) is not None:
            ...                                 # robosuite's own: from action to vector, and env.step()
            device.feel(force)                  # of the end effector's sensor, N, world axes

For arms under OSC_POSE with its default scales. The session's world has robosuite's axes, with its origin where the hand
is when control starts. Button 0 closes the gripper, button 1 resets.
"""

import numpy as np
from robosuite.devices import Device

# OSC_POSE at its default scales moves so far in a step when the action is 1.
STEP, TURN = 0.05, 0.5  # m, rad
DOWN = np.diag([-1.0, 1.0, -1.0])  # How robosuite's grippers point when control starts.
GRASP, RESET = 1, 2  # Masks of the buttons


class HapticDevice(Device):
    def __init__(self, env, touch):
        super().__init__(env)
        self._touch = touch
        self._reset_internal_state()

    def _reset_internal_state(self):
        super()._reset_internal_state()
        self._touch.poll()
        self._place, self._turn = self._touch.q[:3].copy(), _matrix(self._touch.q[3:])

    def start_control(self):
        self._reset_internal_state()

    def get_controller_state(self):
        """How far the hand has moved since the call before; what a step has no room for comes with the next ones."""
        self._touch.poll()
        R = _matrix(self._touch.q[3:])
        dpos = _at_most(self._touch.q[:3] - self._place, STEP)
        turn = _at_most(_rotation_vector(R @ self._turn.T), TURN)  # rad, world axes
        self._place = self._place + dpos
        self._turn = _matrix_of_vector(turn) @ self._turn
        buttons = self._touch.state.buttons
        return {"dpos": dpos, "rotation": R @ DOWN,
                # input2action() swaps the first two and turns the third round.
                "raw_drotation": np.array([turn[1], turn[0], -turn[2]]),
                "grasp": int(bool(buttons & GRASP)), "reset": int(bool(buttons & RESET)),
                "base_mode": int(self.base_mode)}

    def _postprocess_device_outputs(self, dpos, drotation):
        return np.clip(dpos / STEP, -1, 1), np.clip(drotation / TURN, -1, 1)

    def feel(self, force, period=1 / 20):
        """After env.step(): the world's force on the end effector, N, world axes. period: of the steps, s."""
        self._touch.sample(self._touch.q, self._touch.v, period)
        self._touch.external_wrench([*force, 0, 0, 0])
        self._touch.send()


def _at_most(vector, length):
    return vector * min(1, length / max(np.linalg.norm(vector), 1e-12))


def _matrix(quaternion):
    w, x, y, z = quaternion
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def _matrix_of_vector(turn):
    angle = np.linalg.norm(turn)
    axis = turn / max(angle, 1e-12)
    return _matrix([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])


def _rotation_vector(R):
    """Of turns up to a little less than pi."""
    sine = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    length = np.linalg.norm(sine)
    return sine * (np.arctan2(length, 0.5 * (np.trace(R) - 1)) / length if length > 1e-12 else 1)
