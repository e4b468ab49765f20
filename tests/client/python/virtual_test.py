#!/usr/bin/python3
"""haptic.virtual: a session with a server in virtual time is exact, the same each time, and faster than real time.

Usage: virtual_test.py LIBHAPTIC PACKAGE_FOLDER [TEST …]
"""

import copy
import os
import pathlib
import sys
import unittest

LIBRARY, PACKAGE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
os.environ["HAPTIC_LIBRARY"] = str(LIBRARY)
sys.path[:0] = [str(PACKAGE), str(pathlib.Path(__file__).resolve().parents[2] / "support")]

import haptic_local_model as haptic  # noqa: E402
import numpy as np  # noqa: E402
import virtual_hand  # noqa: E402
from hand_session import STIFFNESS, mean, push, reach  # noqa: E402
from haptic_local_model import shapes  # noqa: E402

RATE = 60  # Hz
EDGE = 0.04  # m, of the tool
PRESS = reach(0.5, 0, 0.018) + push(5, 0, -2)  # N


def frames(server, touch, seconds):
    """A world in which there is a floor and the tool is where the proxy is."""
    while server.now < seconds:
        touch.poll()
        touch.sample(touch.q, touch.v, 1 / RATE)
        touch.send()


def press(seconds=3, options=(), hand=PRESS, **network):
    """All ticks."""
    with virtual_hand.server(hand, *options, **network) as server:
        with haptic.Session(tool=haptic.box(0.1, [EDGE] * 3), q=(0, 0, 0.03, 1, 0, 0, 0), rate=RATE, gravity=(0, 0, 0)) as touch:
            touch.offer([shapes.half_space(), shapes.box([EDGE] * 3, haptic.TOOL_LINK)], friction=[0.5, 0.5])
            frames(server, touch, seconds)
        return server.ticks


def with_force(ticks):
    return ticks[ticks["server_state"] == "active"]


class Exact(unittest.TestCase):
    def test_a_box_rests_at_the_depth_of_its_four_corners(self):
        for stiffness in (4000, 50000):
            ticks = with_force(press(options=("--stiffness", str(stiffness))))
            self.assertAlmostEqual(mean(ticks, "env_force_z_N", 2, 2.5)[0], 2, delta=1e-6)  # N
            self.assertAlmostEqual(EDGE / 2 - mean(ticks, "proxy_z_m", 2, 2.5)[0], 2 / (4 * stiffness), delta=1e-9)  # m

    def test_what_is_run_again_is_the_same_in_every_bit(self):
        network = {"delay": 0.03, "jitter": 0.02, "loss": 0.1}
        first = press(1.5, seed=7, **network)
        self.assertTrue((first == press(1.5, seed=7, **network)).all())
        self.assertFalse((first == press(1.5, seed=8, **network)).all())

    def test_a_tick_is_a_millisecond_and_a_frame_its_period(self):
        ticks = press(2)
        self.assertAlmostEqual(ticks["time_s"][-1], 2, delta=1.1 / RATE)
        np.testing.assert_allclose(np.diff(ticks["time_s"]), 1e-3, atol=1e-12)
        taken = ticks["time_s"][ticks["adopted"] > 0][10:]
        np.testing.assert_allclose(np.diff(taken), 1 / RATE, atol=1.1e-3)


class Network(unittest.TestCase):
    def test_what_is_sent_comes_after_its_delay(self):
        for delay in (0, 0.05):
            with virtual_hand.server(PRESS, delay=delay) as server, haptic.Session(rate=1000) as touch:
                while not touch.connected:
                    touch.poll()
                self.assertAlmostEqual(server.now, 2 * delay, delta=3e-3)  # s

    def test_it_may_change(self):
        with virtual_hand.server(PRESS) as server, haptic.Session(rate=RATE) as touch:
            frames(server, touch, 1)
            self.assertTrue(touch.connected)
            server.set_network(loss=1)
            frames(server, touch, 4)
            self.assertFalse(touch.connected)
            server.set_network()
            frames(server, touch, 8)
            self.assertTrue(touch.connected)


class Time(unittest.TestCase):
    def test_it_passes_from_frame_to_frame_and_while_one_waits(self):
        with haptic.virtual.Server() as server, haptic.Session(rate=50) as touch:
            begins = []
            for pause in (0, 0, 0.3, 0, 0.01, 0):
                touch.poll()
                begins.append(touch.now)
                server.wait(pause)
            np.testing.assert_allclose(begins, (0, 0.02, 0.04, 0.34, 0.36, 0.38), atol=1e-12)
            server.set_frame(0.1)
            touch.poll()
            self.assertAlmostEqual(touch.now, 0.48, delta=1e-12)
            server.set_frame(0)
            touch.poll()
            self.assertAlmostEqual(touch.now, 0.48, delta=1e-12)
            server.set_frame(None)
            touch.poll()
            self.assertAlmostEqual(server.now, 0.5, delta=1e-12)

    def test_ticks_of_a_pause_are_there(self):
        with haptic.virtual.Server() as server:
            self.assertEqual(len(server.ticks), 0)
            server.wait(0.5)
            self.assertEqual(len(server.ticks), 501)
            self.assertEqual(len(server.ticks_since(500)), 1)
            self.assertEqual(len(server.ticks_since(502)), 0)
            self.assertEqual(set(server.ticks["server_state"]), {"off"})


class Hand(unittest.TestCase):
    def test_without_a_script_the_session_moves_it(self):
        with haptic.virtual.Server() as server, haptic.Session(rate=RATE, gravity=(0, 0, 0)) as touch:
            touch.hold((0.05, 0, 0))
            frames(server, touch, 3)
            self.assertAlmostEqual(touch.q[0], 0.05, delta=1e-4)

    def test_its_script_may_be_a_file(self):
        file = pathlib.Path(os.environ.get("TMPDIR", "/tmp")) / f"hand_{os.getpid()}.toml"
        file.write_text(reach(1, 0, 0.04))
        self.addCleanup(file.unlink)
        for given in (file, str(file)):
            with haptic.virtual.Server(hand=given) as server, haptic.Session(rate=RATE, gravity=(0, 0, 0)) as touch:
                frames(server, touch, 2)
                self.assertGreater(touch.q[2], 0.02)


class Beginning(unittest.TestCase):
    def test_a_tool_that_lies_on_the_floor_lies_there_from_the_start_however_late_the_network_is(self):
        """Its weight, 0.981 N, on four corners; the world stands still until the server has the shapes."""
        for delay in (0, 0.02, 0.1, 0.25, 0.5):
            with self.subTest(delay=delay), haptic.virtual.Server(delay=delay) as server:
                with haptic.Session(tool=haptic.box(0.1, [EDGE] * 3), q=(0, 0, EDGE / 2, 1, 0, 0, 0), rate=RATE,
                                    gravity=(0, 0, -9.81)) as touch:
                    touch.offer([shapes.half_space(), shapes.box([EDGE] * 3, haptic.TOOL_LINK)], friction=[0.5, 0.5])
                    while server.now < 2 + 8 * delay:
                        touch.poll()
                        if touch.steps(1 / 480) > 0:
                            touch.sample(touch.q, touch.v, 1 / RATE)
                            touch.send()
                ticks = server.ticks
                begun = ticks[ticks["server_state"] != "off"]
                depth = 0.1 * 9.81 / (4 * 4000)
                self.assertAlmostEqual(begun["proxy_z_m"][-1], EDGE / 2 - depth, delta=1e-9)
                self.assertGreater(begun["proxy_z_m"].min(), EDGE / 2 - 1.1 * depth)
                self.assertLess(np.abs(np.diff(ticks["command_force_z_N"])).max(), 0.02)  # N
                counts = np.argmax(begun["active_contacts"] > 0)
                self.assertEqual(set(begun["server_state"][:counts]), {"arming"})


    def test_a_hand_of_hold_waits_for_the_shapes(self):
        """It draws the tool 10 mm into the floor from the first frame on."""
        for delay in (0, 0.1, 0.25):
            with self.subTest(delay=delay), haptic.virtual.Server(delay=delay) as server:
                with haptic.Session(tool=haptic.box(0.1, [EDGE] * 3), q=(0, 0, EDGE / 2, 1, 0, 0, 0), rate=RATE) as touch:
                    touch.offer([shapes.half_space(), shapes.box([EDGE] * 3, haptic.TOOL_LINK)], friction=[0.5, 0.5])
                    while server.now < 2 + 8 * delay:
                        touch.poll()
                        touch.hold((0, 0, EDGE / 2 - 0.01))
                        if touch.steps(1 / 480) > 0:
                            touch.sample(touch.q, touch.v, 1 / RATE)
                            touch.send()
                due = 0.01 * 200 * 16000 / (200 + 16000)
                self.assertAlmostEqual(server.ticks["command_force_z_N"][-1], due, delta=1e-3)  # N


class Servers(unittest.TestCase):
    def test_several_have_times_of_their_own(self):
        with haptic.virtual.Server() as one, haptic.virtual.Server() as other:
            self.assertNotEqual(one.address, other.address)
            with haptic.Session(one.address, rate=10) as touch:
                touch.poll(), touch.poll()
            self.assertAlmostEqual(one.now, 0.1, delta=1e-12)
            self.assertEqual(other.now, 0)

    def test_after_it_sessions_have_the_server_from_before(self):
        before = os.environ.get("HAPTIC_SERVER")
        with haptic.virtual.Server() as server:
            self.assertEqual(os.environ["HAPTIC_SERVER"], server.address)
        self.assertEqual(os.environ.get("HAPTIC_SERVER"), before)
        self.assertRaisesRegex(haptic.HapticError, 'server "virtual:.*" must be one that is open', haptic.Session, server.address)

    def test_in_whatever_order_they_end(self):
        before = os.environ.get("HAPTIC_SERVER")
        for order in ((0, 1, 2), (1, 2, 0), (2, 1, 0)):
            servers = [haptic.virtual.Server() for _ in range(3)]
            for place in order:
                servers[place].close()
            self.assertEqual(os.environ.get("HAPTIC_SERVER"), before)

    def test_one_that_nobody_has_any_more_is_closed(self):
        """As where a cell of a notebook is run twice."""
        before = os.environ.get("HAPTIC_SERVER")
        server = haptic.virtual.Server()
        first, server = server.address, haptic.virtual.Server()
        self.assertRaisesRegex(haptic.HapticError, "must be one that is open", haptic.Session, first)
        server.close()
        self.assertEqual(os.environ.get("HAPTIC_SERVER"), before)

    def test_none_can_be_copied(self):
        with haptic.virtual.Server() as server, haptic.Session() as touch:
            for each in (server, touch):
                self.assertRaisesRegex(TypeError, "cannot be copied", copy.copy, each)

    def test_a_session_outlives_its_server(self):
        server = haptic.virtual.Server()
        with haptic.Session(server.address, rate=RATE) as touch:
            frames(server, touch, 0.2)
            server.close()
            touch.poll()
            self.assertTrue(touch.connected)

    def test_one_that_ends_says_so(self):
        with haptic.virtual.Server() as server, haptic.Session(rate=RATE) as touch:
            frames(server, touch, 0.5)
            count = len(server.ticks)
            server.stop()
            frames(server, touch, 0.6)
            self.assertFalse(touch.connected)
            self.assertEqual(len(server.ticks), count)


class Refused(unittest.TestCase):
    def test_what_cannot_be_used_is_named(self):
        for text, arguments, options in (
                ("--stiffness -1 .*must be", ("--stiffness", "-1"), {}), ("--speed", ("--speed", "1"), {}),
                ("--help, .* are for haptic_server itself", ("--help", "--stiffness", "16000"), {}), ("hand 3", (), {"hand": 3}),
                ("--device haply must be simulated: no other", ("--device", "haply"), {}),
                ("nowhere.toml", (), {"hand": "nowhere.toml"}), ("delay -1 s must be 0 to", (), {"delay": -1}),
                ("loss 2 must be 0 to 1", (), {"loss": 2}), ("jitter nan", (), {"jitter": float("nan")}),
                ("seed -1 must be", (), {"seed": -1}), ("delay must be a number", (), {"delay": "long"})):
            with self.subTest(text), self.assertRaisesRegex(haptic.HapticError, text):
                haptic.virtual.Server(*arguments, **options)

    def test_a_network_or_a_time_that_cannot_be_is_named(self):
        with haptic.virtual.Server() as server:
            self.assertRaisesRegex(haptic.HapticError, "loss 7", server.set_network, loss=7)
            self.assertRaisesRegex(haptic.HapticError, "seconds -1", server.wait, -1)
            self.assertRaisesRegex(haptic.HapticError, "seconds inf", server.wait, float("inf"))
            self.assertRaisesRegex(haptic.HapticError, "seconds nan must be 0 to", server.set_frame, float("nan"))
        self.assertRaisesRegex(haptic.HapticError, "closed", server.wait, 1)

    def test_stiffness_that_the_device_does_not_bear_is_lowered_with_a_word(self):
        with self.assertWarnsRegex(UserWarning, "stiffness"):
            haptic.virtual.Server("--rate", "500", "--stiffness", "64000", "--device-option", "delay=4").close()


class Worlds(unittest.TestCase):
    def test_what_is_offered_next_replaces_what_was(self):
        with virtual_hand.server(PRESS), haptic.Session(tool=haptic.box(0.1, [EDGE] * 3), q=(0, 0, 0.03, 1, 0, 0, 0), rate=RATE) as touch:
            for floor in (0, -0.002):  # m
                touch.offer([shapes.half_space(), shapes.box([EDGE] * 3, haptic.TOOL_LINK)], positions=[[0, 0, floor], [0, 0, 0]])
                end = touch.now + 2.5
                while touch.now < end:
                    touch.poll()
                    touch.sample(touch.q, touch.v, 1 / RATE)
                    touch.send()
                self.assertAlmostEqual(floor + EDGE / 2 - touch.q[2], touch.force[2] / (4 * 4000), delta=1e-6)
                self.assertGreater(touch.force[2], 1)  # N

    def test_a_body_gets_the_impulse_of_the_push_on_it(self):
        """A block of 2 kg that floats, of which the server has no mass, moves off by what the hand's spring has pushed."""
        body, gained, mass = haptic.bodies(1), np.zeros(3), 2.0
        body["id"] = 7
        body["inverse_inertia"][0][:3, :3] = np.eye(3) / mass
        with virtual_hand.server(PRESS) as server:
            with haptic.Session(tool=haptic.box(0.1, [EDGE] * 3), q=(0, 0, 0.03, 1, 0, 0, 0), rate=RATE, gravity=(0, 0, 0)) as touch:
                while server.now < 2:
                    touch.poll()
                    for number, impulse in touch.impulses(1 / RATE).items():
                        self.assertEqual(number, 7)
                        gained += impulse[:3]
                        body["velocity"][0][:3] += impulse[:3] / mass
                    body["centre"][0] += body["velocity"][0][:3] / RATE
                    touch.sample(touch.q, touch.v, 1 / RATE)
                    found = haptic.contacts(1)
                    found["point"], found["normal"] = (*touch.q[:2], body["centre"][0][2]), (0, 0, 1)
                    found["separation"] = touch.q[2] - EDGE / 2 - body["centre"][0][2]
                    found["b_kind"], found["b_index"] = haptic.MOVABLE_BODY, 7
                    touch.send(touch.track(found, body), body)
            pushed = with_force(server.ticks)["env_force_z_N"].sum() / 1000  # N s
        self.assertLess(gained[2], -0.5)
        self.assertAlmostEqual(gained[2], -pushed, delta=0.1)
        np.testing.assert_allclose(gained[:2], 0, atol=0.01)


class Feel(unittest.TestCase):
    def test_the_hand_s_spring_bears_what_the_floor_gives(self):
        ticks = with_force(press(hand=reach(0.5, 0, 0.015)))
        due = STIFFNESS * 4 * 4000 / (STIFFNESS + 4 * 4000) * (EDGE / 2 - 0.015)
        self.assertAlmostEqual(mean(ticks, "command_force_z_N", 2, 2.5)[0], due, delta=1e-4 * due)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
