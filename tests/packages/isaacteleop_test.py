#!/usr/bin/python3
"""haptic.isaacteleop: IsaacTeleop's HapticSink takes it, and the force that its graph hands over is felt.

Usage: isaacteleop_test.py HAPTIC_SERVER LIBHAPTIC [TEST …]
"""

import time
import unittest

from given import SERVER, main

import haptic_local_model as haptic
import haptic_local_model.isaacteleop
import numpy as np
from hand_session import push, server
from isaacteleop.haptic_devices import IHapticDevice
from isaacteleop.retargeting_engine.deviceio_source_nodes import HapticSink
from isaacteleop.retargeting_engine.interface import TensorGroup
from isaacteleop.retargeting_engine.interface.value_input import ValueInput
from isaacteleop.retargeting_engine.tensor_types import EndEffectorForce, TransformMatrix

FLOOR = 1000  # N/m, of the simulator's floor at z = 0


class Device(unittest.TestCase):
    def setUp(self):
        running = self.enterContext(server(SERVER, push(60, 0, 0)))
        self.touch = self.enterContext(haptic.Session(running.address, haptic.box(0.3, (0.04,) * 3)))
        self.device = haptic.isaacteleop.HapticDevice(self.touch)
        self.source = ValueInput("force", EndEffectorForce())
        self.sink = HapticSink("haptics", self.device)
        self.graph = self.sink.connect({"device": self.source.output("value")})

    def frames(self, seconds, world):
        """What TeleopSession does in each of its frames; world(position): N, and None is no force."""
        forces, end = [], time.monotonic() + seconds
        while time.monotonic() < end:
            force = world(self.device.position)
            if force is not None:
                given = TensorGroup(EndEffectorForce())
                given[0] = np.asarray(force, dtype=np.float32)
                self.graph.execute_pipeline({"force": {"value": given}})
                forces.append(force)
            self.sink.flush_to_device(None)
            time.sleep(1 / 60)
        return np.array(forces)

    def test_its_sink_takes_it_and_refuses_what_is_no_force(self):
        self.assertIsInstance(self.device, IHapticDevice)
        self.assertIsNone(self.sink.get_tracker())
        matrix = ValueInput("matrix", TransformMatrix())
        with self.assertRaises(ValueError):
            HapticSink("other", self.device).connect({"device": matrix.output("value")})

    def test_a_force_in_each_frame_is_felt_as_the_same_force(self):
        floor = lambda place: (0, 0, FLOOR * max(0, -place[2]))
        for depth in (0.008, 0.012, 0.02):  # m, of the target of the hand, which draws with 200 N/m
            self.touch.hold((0, 0, -depth))
            given = self.frames(4, floor)[-30:, 2].mean()
            felt = self.touch.state.contact_wrench[2]
            print(f"given {given:.4f} N, felt {felt:.4f} N, {100 * (given / felt - 1):+.2f} %")
            self.assertGreater(felt, 1)
            self.assertAlmostEqual(given, felt, delta=0.02 * felt)
        self.frames(1.5, lambda place: None)  # It is gone with its frame.
        self.assertAlmostEqual(self.touch.force[2], 0, delta=0.01)  # N

    def test_a_load_is_felt_as_a_load_and_a_stiff_wall_as_a_wall(self):
        for stiffness, load in ((0, 3), (2e4, 0), (2e4, 3)):  # N/m, N
            with self.subTest(stiffness=stiffness, load=load):
                self.touch.hold((0, 0, 0.02 if stiffness == 0 else -0.02))
                world = lambda place: (0, 0, -load + stiffness * max(0, -place[2]))
                self.frames(3, world)
                self.assertAlmostEqual(self.touch.force[2], world(self.device.position)[2], delta=0.02)  # N

    def test_an_endpoint_that_it_does_not_have_is_named(self):
        with self.assertRaisesRegex(ValueError, r"endpoint 'left' with the shape \(3,\) must be 'device'"):
            self.device.apply("left", np.zeros(3, np.float32))

    def test_a_flush_that_fails_is_logged_once(self):
        self.touch.close()
        with self.assertLogs("haptic.isaacteleop") as logged:
            self.device.flush(None)
            self.device.flush(None)
        self.assertEqual(len(logged.output), 1)
        self.assertIn("the session is closed", logged.output[0])


if __name__ == "__main__":
    main()
