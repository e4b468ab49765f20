"""An engine of one page: what its tray carries weighs what it weighs, however late the network is.

Usage: own_engine_test.py LIBHAPTIC PACKAGE_FOLDER EXAMPLE
"""

import contextlib
import io
import os
import pathlib
import runpy
import sys
import unittest
from unittest import mock

os.environ["HAPTIC_LIBRARY"], PACKAGE, EXAMPLE = sys.argv[1:4]
sys.path[:0] = [PACKAGE, str(pathlib.Path(__file__).resolve().parents[1] / "support")]

import hand_session  # noqa: E402
import virtual_hand  # noqa: E402

DUE = 2 * 0.3 * 9.81  # N


class OwnEngine(unittest.TestCase):
    def test_two_cubes_weigh_what_they_weigh(self):
        for network in ({}, {"delay": 0.1, "jitter": 0.03, "loss": 0.05}):
            with self.subTest(network):
                self.lifts_both(network)

    def lifts_both(self, network):
        printed = io.StringIO()
        with virtual_hand.server(hand_session.reach(1.5, 0, 0.06) + hand_session.reach(2, 0, 0.15), **network) as server:
            with mock.patch("time.sleep"), mock.patch("sys.argv", [EXAMPLE, "6"]), contextlib.redirect_stdout(printed):
                runpy.run_path(EXAMPLE, run_name="__main__")
            ticks = virtual_hand.active(server)
        weight, deviation = hand_session.mean(ticks, "env_force_z_N", 3.8, 4.8)
        self.assertAlmostEqual(-weight, DUE, delta=1e-3 * DUE, msg=printed.getvalue())
        self.assertLess(deviation, 1e-3 * DUE)
        heights = [float(height) for height in printed.getvalue().splitlines()[-1].split("[")[1].split("]")[0].split(",")]
        self.assertGreater(heights[0], 0.1)  # m
        self.assertAlmostEqual(heights[1] - heights[0], 0.04, delta=1e-3)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
