#!/usr/bin/python3
"""The Bullet example: a box presses, slides, pushes, lifts and enters a hole.

Usage: bullet_test.py HAPTIC_SERVER EXAMPLE
"""

import pathlib
import sys
import unittest

SERVER, EXAMPLE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))

import hand_session  # noqa: E402
from touch_tasks import TouchTasks  # noqa: E402


class Touch(TouchTasks, unittest.TestCase):
    @staticmethod
    def play(scene, seconds, hand, *options, rate=60, stall=0):
        return hand_session.play(SERVER, hand, options, lambda address: hand_session.run(
            [EXAMPLE, scene, address, str(seconds), str(rate)], stall))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
