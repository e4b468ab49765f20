"""An engine of one page: what its tray carries weighs what it weighs.

Usage: own_engine_test.py HAPTIC_SERVER LIBHAPTIC PACKAGE_FOLDER EXAMPLE
"""

import os
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))

import hand_session  # noqa: E402

SERVER, LIBRARY, PACKAGE, EXAMPLE = sys.argv[1:5]
DUE = 2 * 0.3 * 9.81  # N


class OwnEngine(unittest.TestCase):
    def test_two_cubes_weigh_what_they_weigh(self):
        environment = {**os.environ, "HAPTIC_LIBRARY": LIBRARY, "PYTHONPATH": PACKAGE}
        hand = hand_session.reach(1.5, 0, 0.06) + hand_session.reach(2, 0, 0.15)
        with hand_session.server(SERVER, hand) as server:
            printed = hand_session.run([sys.executable, EXAMPLE, "6"], env={**environment, "HAPTIC_SERVER": server.address})
            ticks = server.ticks()
        weight, deviation = hand_session.mean(ticks, "env_force_z_N", 3.8, 4.8)
        self.assertAlmostEqual(-weight, DUE, delta=1e-3 * DUE, msg=printed)
        self.assertLess(deviation, 1e-3 * DUE)
        heights = [float(height) for height in printed.splitlines()[-1].split("[")[1].split("]")[0].split(",")]
        self.assertGreater(heights[0], 0.1)  # m
        self.assertAlmostEqual(heights[1] - heights[0], 0.04, delta=1e-3)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
