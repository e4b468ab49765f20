#!/usr/bin/python3
"""The devices of examples/teleop keep the contracts of IsaacTeleop and robosuite, and are felt.

The classes that they fill are here in shape alone, in our own words.

Usage: teleop_test.py HAPTIC_SERVER LIBHAPTIC PACKAGE_FOLDER EXAMPLE_FOLDER
"""

import abc
import collections
import os
import pathlib
import sys
import time
import types
import unittest

SERVER, LIBRARY, PACKAGE, EXAMPLE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:5])
os.environ["HAPTIC_LIBRARY"] = str(LIBRARY)
sys.path[:0] = [str(PACKAGE), str(EXAMPLE), str(pathlib.Path(__file__).resolve().parents[1] / "support")]

import haptic  # noqa: E402
import numpy as np  # noqa: E402
from hand_session import push, server  # noqa: E402

FLOOR = 1000  # N/m, of the simulators' floor at z = 0
HAND = 200  # N/m, of hold()
TARGET = -0.012  # z of the hand, m

TensorGroupType = collections.namedtuple("TensorGroupType", "name shape")


class IHapticDevice(abc.ABC):
    @abc.abstractmethod
    def accepted_type(self): ...
    @abc.abstractmethod
    def endpoints(self): ...
    @abc.abstractmethod
    def apply(self, endpoint, values): ...
    @abc.abstractmethod
    def flush(self, deviceio_session): ...
    @abc.abstractmethod
    def get_tracker(self): ...


class Device(abc.ABC):
    """Of robosuite, for one robot with one arm under OSC_POSE."""

    def __init__(self, env):
        self.env = env

    def _reset_internal_state(self):
        self.base_modes = [False]

    @property
    def base_mode(self):
        return self.base_modes[0]

    @abc.abstractmethod
    def start_control(self): ...
    @abc.abstractmethod
    def get_controller_state(self): ...

    def input2action(self):
        state = self.get_controller_state()
        if state["reset"]:
            return None
        turn = state["raw_drotation"][[1, 0, 2]] * (1, 1, -1)
        move, turn = self._postprocess_device_outputs(state["dpos"], turn)
        return {"right_delta": np.concatenate([move, turn]), "right_gripper": 1 if state["grasp"] else -1,
                "base_mode": state["base_mode"]}


def module(name, **contents):
    sys.modules[name] = types.ModuleType(name)
    vars(sys.modules[name]).update(contents)


module("isaacteleop")
module("isaacteleop.haptic_devices", IHapticDevice=IHapticDevice)
module("isaacteleop.retargeting_engine")
module("isaacteleop.retargeting_engine.tensor_types",
       EndEffectorForce=lambda: TensorGroupType("end_effector_force", (3,)))
module("robosuite")
module("robosuite.devices", Device=Device)

import isaac_teleop  # noqa: E402
import robosuite_device  # noqa: E402


def floor(q):
    """The force of the simulators' floor, N."""
    return np.array([0, 0, FLOOR * max(0, -q[2])])


class Case(unittest.TestCase):
    def setUp(self):
        running = self.enterContext(server(SERVER, push(60, 0, 0)))
        self.touch = self.enterContext(haptic.Session(running.address, haptic.box(0.3, (0.04,) * 3)))

    def assert_presses(self):
        """The hand's spring is felt, and it is the floor's."""
        self.assertAlmostEqual(self.touch.force[2], HAND * (self.touch.q[2] - TARGET), delta=0.01)  # N
        self.assertAlmostEqual(self.touch.force[2], floor(self.touch.q)[2], delta=0.01)             # N


class IsaacTeleop(Case):
    def play(self, device, seconds, applies=True):
        """What its session does with a device in each frame."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if applies:
                for endpoint in device.endpoints():
                    device.apply(endpoint, floor(device.position).astype(np.float32))
            device.flush(None)
            time.sleep(1 / 60)

    def test_a_force_in_each_frame_is_felt_as_the_same_force(self):
        device = isaac_teleop.ServerHapticDevice(self.touch)
        self.assertEqual(device.accepted_type(), TensorGroupType("end_effector_force", (3,)))
        self.assertIsNone(device.get_tracker())
        self.touch.hold((0, 0, TARGET))
        self.play(device, 4)
        self.assert_presses()
        self.play(device, 1.5, applies=False)  # It is gone with its frame.
        self.assertAlmostEqual(self.touch.force[2], 0, delta=0.01)  # N

    def test_a_load_is_felt_as_a_load_and_a_stiff_wall_as_a_wall(self):
        device = isaac_teleop.ServerHapticDevice(self.touch)
        self.touch.hold((0, 0, 0.02))
        for stiffness, load in ((0, 3), (2e4, 0), (2e4, 3)):  # N/m, N
            with self.subTest(stiffness=stiffness, load=load):
                world = lambda: np.array([0, 0, -load + stiffness * max(0, -device.position[2])])
                self.touch.hold((0, 0, 0.02 if stiffness == 0 else -0.02))
                end = time.monotonic() + 3
                while time.monotonic() < end:
                    device.apply("device", world())
                    device.flush(None)
                    time.sleep(1 / 60)
                self.assertAlmostEqual(self.touch.force[2], world()[2], delta=0.02)  # N
                if stiffness == 0:
                    self.assertAlmostEqual(self.touch.force[2], -load, delta=0.02)   # N
                else:
                    self.assertGreater(self.touch.force[2], 3 - load)                # N: the hand's spring
                    self.assertLess(abs(self.touch.q[2]), 0.5e-3)                    # m: at the wall

    def test_an_endpoint_that_it_does_not_have_is_named(self):
        device = isaac_teleop.ServerHapticDevice(self.touch)
        with self.assertRaisesRegex(ValueError, r"endpoint 'left' with the shape \(3,\) must be 'device'"):
            device.apply("left", np.zeros(3, np.float32))

    def test_a_flush_that_fails_is_logged_once(self):
        device = isaac_teleop.ServerHapticDevice(self.touch)
        self.touch.close()
        with self.assertLogs("isaac_teleop") as logged:
            device.flush(None)
            device.flush(None)
        self.assertEqual(len(logged.output), 1)
        self.assertIn("the session is closed", logged.output[0])


class Robosuite(Case):
    def test_the_actions_add_up_to_the_motion_of_the_hand(self):
        device = robosuite_device.HapticDevice(types.SimpleNamespace(), self.touch)
        device.start_control()
        angle, axis = 0.6, np.array([1, 2, -2]) / 3  # rad
        self.touch.hold((0.12, -0.03, 0.02), (np.cos(angle / 2), *(np.sin(angle / 2) * axis)))
        moved, turned = np.zeros(3), np.eye(3)
        end = time.monotonic() + 2
        while time.monotonic() < end:
            action = device.input2action()["right_delta"]
            self.assertLessEqual(np.abs(action).max(), 1)
            moved += robosuite_device.STEP * action[:3]
            turned = robosuite_device._matrix_of_vector(robosuite_device.TURN * action[3:]) @ turned
            device.feel(np.zeros(3), 1 / 60)
            time.sleep(1 / 60)
        np.testing.assert_allclose(moved, (0.12, -0.03, 0.02), atol=1e-3)             # m
        K = np.cross(np.eye(3), axis)  # Rodrigues' formula
        np.testing.assert_allclose(turned, np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K, atol=0.01)

    def test_what_a_step_has_no_room_for_comes_with_the_next(self):
        device = self.with_buttons(0)
        self.stand_in.q[:3] = 0.08, 0, 0  # m
        steps = [device.input2action()["right_delta"][0] for _ in range(3)]
        np.testing.assert_allclose(steps, (1, 0.6, 0), atol=1e-9)

    def test_its_force_is_felt(self):
        device = robosuite_device.HapticDevice(types.SimpleNamespace(), self.touch)
        device.start_control()
        self.touch.hold((0, 0, TARGET))
        end = time.monotonic() + 4
        while time.monotonic() < end:
            device.input2action()
            device.feel(floor(self.touch.q), 1 / 60)
            time.sleep(1 / 60)
        self.assert_presses()

    def test_buttons_grasp_and_reset(self):
        self.assertEqual(self.with_buttons(0).input2action()["right_gripper"], -1)
        self.assertEqual(self.with_buttons(1).input2action()["right_gripper"], 1)
        self.assertIsNone(self.with_buttons(2).input2action())

    def with_buttons(self, buttons):
        """On a session's shape: the simulated device has no buttons."""
        self.stand_in = types.SimpleNamespace(q=np.array([0, 0, 0, 1.0, 0, 0, 0]), poll=lambda: True,
                                              state=types.SimpleNamespace(buttons=buttons))
        return robosuite_device.HapticDevice(types.SimpleNamespace(), self.stand_in)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[5:], verbosity=2)
