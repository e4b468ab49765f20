#!/usr/bin/python3
"""The Bullet example: a box presses, slides, pushes, lifts, enters a hole, and pushes what joints hold.

Usage: bullet_test.py HAPTIC_SERVER EXAMPLE
"""

import pathlib
import sys
import unittest

SERVER, EXAMPLE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))

import hand_session  # noqa: E402
from hand_session import mean, on_time, reach  # noqa: E402
from touch_tasks import GRAVITY, TouchTasks  # noqa: E402


def down(duration, z):
    """A segment of a hand over the left end of the seesaw."""
    return reach(duration, -0.15, z)


class Touch(TouchTasks, unittest.TestCase):
    @staticmethod
    def play(scene, seconds, hand, *options, rate=60, stall=0):
        return hand_session.play(SERVER, hand, options, lambda address: hand_session.run(
            [EXAMPLE, scene, address, str(seconds), str(rate)], stall))

    def test_one_end_of_a_seesaw_bears_what_lies_on_the_other(self):
        # The tool's inner edge is 145 mm from the hinge, the cube's centre 150.
        due = 0.3 * GRAVITY * 150 / 145  # N
        ticks, track = on_time(self.play, "seesaw", 4, down(0.5, 0.121) + down(2, 0.11))
        force, deviation = mean(ticks, "env_force_z_N", 2.7, 3.3)
        self.assertAlmostEqual(force, due, delta=0.05 * due)
        self.assertLess(deviation, 0.01)
        self.assertGreater(track[-1][2], 0.126)  # m: the cube has been lifted

    def test_a_drawer_on_a_slider_gains_the_momentum_that_the_hand_felt(self):
        self.gains_the_momentum_that_the_hand_felt("drawer", 0.03)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
