"""The MuJoCo that a test is to run on."""

import importlib
import os


def mujoco_of(name):
    """What has the names of the official Python binding. name: "mujoco", Debian's library, or a package of mujoco_npm."""
    os.environ["HAPTIC_TEST_MUJOCO"] = name
    return importlib.import_module("mujoco_binding" if name == "mujoco" else "mujoco_npm")
