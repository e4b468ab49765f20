#!/usr/bin/python3
"""haptic.robosuite: what robosuite's own script records of a demonstration is what was felt.

Usage: robosuite_test.py HAPTIC_SERVER LIBHAPTIC [TEST …]
"""

import os
import pathlib
import tempfile
import time
import types
import unittest

from given import SERVER, main

os.environ.update(MUJOCO_GL="disable", PYNPUT_BACKEND="dummy")

import haptic_local_model as haptic  # noqa: E402
import haptic_local_model.robosuite  # noqa: E402
import numpy as np  # noqa: E402
import robosuite  # noqa: E402
from haptic_local_model._world import rotation  # noqa: E402
from hand_session import in_some_attempt, mean, reach, server  # noqa: E402
from robosuite.scripts.collect_human_demonstrations import collect_human_trajectory  # noqa: E402
from robosuite.wrappers import Wrapper  # noqa: E402

RATE = 20  # Hz


class Unseen(Wrapper):
    """robosuite's script shows each step; there is no screen here."""
    def render(self): ...


class Watched(haptic.robosuite.HapticDevice):
    """Ends as a press of its second button does, and keeps when it was on."""
    def __init__(self, seconds, *arguments):
        self.ends, self.times = time.monotonic() + seconds, []
        super().__init__(*arguments)

    def get_controller_state(self):
        return {**super().get_controller_state(), "reset": time.monotonic() > self.ends}

    def feel(self):
        self.times.append((time.monotonic(), self._touch.server_state))
        return super().feel()

    def since_force(self):
        return np.array([at for at, _ in self.times]) - next(at for at, state in self.times if state == "active")


def lift():
    env = robosuite.make("Lift", robots="Panda", has_renderer=False, has_offscreen_renderer=False, use_camera_obs=False,
                         control_freq=RATE, ignore_done=True, initialization_noise=None)
    env.reset()
    return Unseen(env)


class Device(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.env = lift()

    def session(self, hand):
        running = self.enterContext(server(SERVER, hand))
        return running, self.enterContext(haptic.Session(running.address, haptic.box(0.3, (0.04,) * 3), rate=RATE))

    def step(self, device):
        action = device.input2action()
        robot = self.env.robots[0]
        self.env.step(robot.create_action_vector({"right": action["right_delta"], "right_gripper": action["right_gripper"]}))

    def test_the_end_effector_goes_where_the_hand_goes_and_turns_as_it_turns(self):
        _, touch = self.session(reach(60, 0, 0))
        device = haptic.robosuite.HapticDevice(self.env, touch)
        device.start_control()
        begin, turn = device._end_effector()
        angle, axis = 0.4, np.array([1, 2, -2]) / 3  # rad
        due = rotation((np.cos(angle / 2), *(np.sin(angle / 2) * axis)))
        target = np.array((0.06, -0.05, 0.04))
        for _ in range(100):  # The session's own numbers, as no hand turns exactly.
            device._touch = types.SimpleNamespace(
                q=np.array([*target, np.cos(angle / 2), *(np.sin(angle / 2) * axis)]), v=touch.v, poll=touch.poll, state=touch.state)
            self.step(device)
        place, turned = device._end_effector()
        print("off by", np.round(1e3 * (place - begin - target), 2), "mm")
        np.testing.assert_allclose(place - begin, target, atol=1e-3)  # m
        np.testing.assert_allclose(turned @ turn.T, due, atol=0.02)

    def test_the_force_is_that_on_the_gripper_without_its_weight(self):
        _, touch = self.session(reach(60, 0, 0))
        device = haptic.robosuite.HapticDevice(self.env, touch)
        device.start_control()
        for _ in range(40):
            self.step(device)
        np.testing.assert_allclose(device._force_on_gripper(), 0, atol=0.05)  # N

    def test_buttons_grasp_and_reset(self):
        stand_in = types.SimpleNamespace(q=np.array([0, 0, 0, 1.0, 0, 0, 0]), v=np.zeros(6), poll=lambda: True,
                                         state=types.SimpleNamespace(buttons=0))
        device = haptic.robosuite.HapticDevice(self.env, stand_in)
        self.assertEqual(device.input2action()["right_gripper"], -1)
        stand_in.state.buttons = 1
        self.assertEqual(device.input2action()["right_gripper"], 1)
        stand_in.state.buttons = 2
        self.assertIsNone(device.input2action())


class Recording(unittest.TestCase):
    def test_the_force_in_a_recorded_demonstration_is_what_was_felt(self):
        in_some_attempt(self.records_what_is_felt)

    def records_what_is_felt(self):
        """robosuite's script; the hand draws the gripper to the table, and then farther."""
        hand = "".join(reach(seconds, 0.03, z) for seconds, z in ((2, -0.17), (2, -0.21), (3, -0.21), (1, -0.225), (60, -0.225)))
        with server(SERVER, hand) as running, tempfile.TemporaryDirectory() as folder:
            with haptic.Session(running.address, haptic.box(0.3, (0.04,) * 3), rate=RATE) as touch:
                env = lift()
                device = Watched(11.5, env, touch)
                env = haptic.robosuite.ForceCollectionWrapper(env, folder, device)
                collect_human_trajectory(env, device, "right", RATE, "target")
            ticks = running.ticks()
            files = sorted(pathlib.Path(folder).rglob("state_*.npz"))
            recorded = np.array([info["force"] for file in files for info in np.load(file, allow_pickle=True)["action_infos"]])
        # A step has the force that the hand was given when it began.
        times = device.since_force()[:len(recorded) - 1]
        for begin, end in ((5.5, 7), (9, 10.5)):
            felt = np.array([mean(ticks, f"env_force_{axis}_N", begin, end)[0] for axis in "xyz"])
            there = recorded[1:][(times > begin) & (times < end)].mean(axis=0)
            print(f"felt {np.round(felt, 3)} N, recorded {np.round(there, 3)} N, "
                  f"{100 * (there[2] / felt[2] - 1):+.2f} % of its largest part")
            self.assertGreater(felt[2], 1)
            np.testing.assert_allclose(there, felt, atol=0.02 * np.linalg.norm(felt))


if __name__ == "__main__":
    main()
