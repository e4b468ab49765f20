#!/usr/bin/python3
"""The MuJoCo example: a ball pressed on a table, then against a brick that gives way.

Usage: mujoco_test.py HAPTIC_SERVER EXAMPLE SCENE
"""

import pathlib
import re
import subprocess
import sys
import unittest

SERVER, EXAMPLE, SCENE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))

import hand_session  # noqa: E402
from hand_session import mean, reach  # noqa: E402

CONTACT_STIFFNESS = 4000  # N/m
FRICTION = 0.4 * 0.3 * 9.81  # N, of the brick on the table


def play(seconds, script):
    """Runs server and example. Returns the ticks with force on, and what the example printed."""
    with hand_session.server(SERVER, script) as server:
        printed = subprocess.run([EXAMPLE, SCENE, server.address, str(seconds)], stdout=subprocess.PIPE, text=True,
                                 check=True, timeout=60).stdout
        return server.ticks(), printed


class Touch(unittest.TestCase):
    def test_the_table_bears_the_push_of_the_hand_at_the_depth_of_its_spring(self):
        ticks, _ = play(3, reach(0.5, 0, 0.015))
        force, deviation = mean(ticks, "command_force_z_N", 1.5, 2.5)
        # Hand and contact are springs in a row, 5 mm together.
        due = 0.005 * hand_session.STIFFNESS * CONTACT_STIFFNESS / (hand_session.STIFFNESS + CONTACT_STIFFNESS)
        self.assertAlmostEqual(force, due, delta=0.01)  # N
        self.assertLess(deviation, 0.01)                # N
        proxy, _ = mean(ticks, "proxy_z_m", 1.5, 2.5)
        self.assertAlmostEqual(0.02 - proxy, due / CONTACT_STIFFNESS, delta=1e-5)  # m

    def test_the_brick_gives_way_at_its_friction(self):
        ticks, printed = play(6, reach(0.5, 0, 0.025) + reach(4, 0.15, 0.025))
        # MuJoCo's friction creeps below its limit, so the brick moves at less than that.
        force, deviation = mean(ticks, "command_force_x_N", 3, 4.2)
        self.assertGreater(-force, 0.75 * FRICTION)
        self.assertLess(-force, 1.1 * FRICTION)
        self.assertLess(deviation, 0.2)  # N
        last = re.search(r"brick (\S+) contacts \d+\n$", printed)
        self.assertAlmostEqual(float(last.group(1)), 0.15 + 0.02 + 0.02, delta=0.005)  # m


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:], verbosity=2)
