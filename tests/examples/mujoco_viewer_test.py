#!/usr/bin/python3
"""examples/mujoco_python as it stands, with a viewer whose mouse is a script: the hand presses the cube on the table, then
pushes the brick.

Usage: mujoco_viewer_test.py LIBHAPTIC PACKAGE_FOLDER EXAMPLE, as mujoco_python_test.py
"""

import contextlib
import inspect
import io
import os
import pathlib
import runpy
import sys
import unittest
from unittest import mock

LIBRARY, PACKAGE, EXAMPLE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
os.environ["HAPTIC_LIBRARY"] = str(LIBRARY)
sys.path.insert(0, str(PACKAGE))

import haptic_local_model as haptic  # noqa: E402
import mujoco.viewer  # noqa: E402

RATE = 60  # Hz
HAND, CONTACTS = 200, 4 * 4000  # N/m: of the hand, and of the four contacts of a face
WEIGHT = 0.1 * 9.81  # N, of the tool
PRESSED = 0.012  # z of the hand, m: the cube's centre is at 0.02 on the table


class Viewer:
    """Drags the mocap body down in the first second and, from 3 s on, along the table."""

    frames = 6 * RATE

    def __init__(self, model, data):
        self._data, self._frame = data, 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.brick = float(self._data.xipos[2][0])
        Viewer.latest = self

    def is_running(self):
        return self._frame < self.frames

    def sync(self):
        self._frame += 1
        seconds = self._frame / RATE
        self._data.mocap_pos[0] = 0.1 * min(max(seconds - 3, 0), 1), 0, 0.04 + (PRESSED - 0.04) * min(seconds, 1)


class Example(unittest.TestCase):
    def test_the_mouse_presses_and_pushes(self):
        inspect.signature(mujoco.viewer.launch_passive).bind("model", "data")  # TypeError if it is called otherwise.
        for method in vars(Viewer).keys() - {"frames"}:
            self.assertTrue(hasattr(mujoco.viewer.Handle, method), method)
        mujoco.viewer.launch_passive = Viewer
        printed = io.StringIO()
        with haptic.virtual.Server(), mock.patch("time.sleep"), contextlib.redirect_stdout(printed):
            runpy.run_path(str(EXAMPLE), run_name="__main__")
        lines = [line.split(": ") for line in printed.getvalue().splitlines()]
        state, force = lines[5]  # at 3 s
        self.assertEqual(state, "active")
        pull = HAND * (0.02 - PRESSED)
        depth = (pull + WEIGHT) / (HAND + CONTACTS)
        self.assertAlmostEqual(float(force.split()[2]), pull - HAND * depth, delta=0.02)  # N
        self.assertGreater(Viewer.latest.brick, 0.11)                                     # m, from 0.08


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:], verbosity=2)
