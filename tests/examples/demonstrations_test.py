#!/usr/bin/python3
"""The example of demonstrations makes a set in which the force on the brick is what its friction asks for.

Usage: demonstrations_test.py LIBHAPTIC PACKAGE_FOLDER HAPTIC_REPLAY EXAMPLE
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

import h5py
import numpy as np

LIBRARY, PACKAGE, REPLAY, EXAMPLE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:5])
FRICTION = 0.4 * 0.3 * 9.81  # N, of the brick on the table

with tempfile.TemporaryDirectory() as folder:
    made = pathlib.Path(folder) / "made"
    subprocess.run([sys.executable, EXAMPLE, made], check=True, env={
        **os.environ, "HAPTIC_LIBRARY": str(LIBRARY), "HAPTIC_PROGRAMS": str(REPLAY.parent), "PYTHONPATH": str(PACKAGE)})
    about = json.loads((made / "push.hdf5.json").read_text())
    outcomes = [each["outcome"] for each in about["episodes"]]
    assert outcomes.count("success") == 7 and outcomes.count("failure") == 3, outcomes
    brick = {each["id"] for each in about["contacts"] if each["b"] == "brick"}
    with h5py.File(made / "push.hdf5") as file:
        of_brick = []
        for name, demo in file["data"].items():
            is_brick = np.isin(demo["contact/id"][:], list(brick))
            force = np.where(is_brick[..., None], demo["contact/force"][:], 0).sum(axis=1)
            if demo.attrs["outcome"] == "success":
                of_brick.append(-force[-15:, 0].mean())  # N, along the push
    print("pushed with", np.round(of_brick, 3), "N; friction is", round(FRICTION, 3), "N")
    assert abs(np.median(of_brick) / FRICTION - 1) < 0.02, of_brick  # One is pushed at its side, and turns.
