#!/usr/bin/python3
"""haptic.mujoco on MuJoCo's own library: held, pushed and pressed things have their weight, friction and stiffness.

Usage: mujoco_python_test.py HAPTIC_SERVER LIBHAPTIC PACKAGE_FOLDER
"""

import os
import pathlib
import sys
import tempfile
import time
import unittest

SERVER, LIBRARY, PACKAGE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
SUPPORT = pathlib.Path(__file__).resolve().parents[1] / "support"
os.environ["HAPTIC_LIBRARY"] = str(LIBRARY)
sys.path[:0] = [str(PACKAGE), str(SUPPORT)]

import haptic.mujoco  # noqa: E402
import hand_session  # noqa: E402
import mujoco_binding as mujoco  # noqa: E402
import numpy as np  # noqa: E402

RATE = 60  # Hz, of frames; each is eight steps of MuJoCo
GRAVITY = 9.81  # m/s²
STIFFNESS = 4000  # N/m, of a contact: the server's default

SCENE = """<mujoco>
  <option timestep="{step}"/>
  <worldbody>
    <geom name="table" type="plane" size="1 1 0.1"/>
    <body name="tool" pos="0 0 {height}"><freejoint/><geom {tool} mass="0.1"/></body>
    {bodies}
  </worldbody>
</mujoco>"""


def play(seconds, scene, hand, measure=lambda data: None, *options, rate=RATE, contacts="engine"):
    """Runs the loop of the module's first lines. Returns the ticks of the server, and all that was measured."""
    measured = []
    with tempfile.TemporaryDirectory() as folder, hand_session.server(SERVER, hand, *options) as server:
        path = pathlib.Path(folder) / "scene.xml"
        path.write_text(scene)
        model = mujoco.MjModel.from_xml_path(path)
        data = mujoco.MjData(model)
        substeps = round(1 / rate / model.opt.timestep)
        with haptic.mujoco.Session(model, data, tool="tool", period=1 / rate, binding=mujoco, contacts=contacts,
                                   server=server.address) as touch:
            start = time.monotonic()
            for frame in range(1, int(seconds * rate) + 1):
                touch.drive(data)
                for _ in range(substeps):
                    mujoco.mj_step(model, data)
                touch.send(data)
                measured.append(measure(data))
                time.sleep(max(0, start + frame / rate - time.monotonic()))
        return server.ticks(), measured


class Touch(unittest.TestCase):
    def test_a_ball_on_the_table_rests_where_its_spring_bears_the_push(self):
        scene = SCENE.format(step=1 / 480, height=0.03, tool='type="sphere" size="0.02"', bodies="")
        ticks, _ = play(2.5, scene, hand_session.reach(0.5, 0, 0.015))
        force, deviation = hand_session.mean(ticks, "command_force_z_N", 1.5, 2.4)
        # The table bears the hand's spring, 5 mm long at first, and the tool's weight.
        depth = (0.005 * hand_session.STIFFNESS + 0.1 * GRAVITY) / (hand_session.STIFFNESS + STIFFNESS)
        self.assertAlmostEqual(force, hand_session.STIFFNESS * (0.005 - depth), delta=0.01)  # N
        self.assertLess(deviation, 0.01)                                                     # N

    def test_a_brick_is_pushed_at_its_friction(self):
        brick = ('<body name="brick" pos="0.08 0 0.02"><freejoint/><geom type="box" size="0.02 0.04 0.02" mass="0.3"'
                 ' friction="0.4 0 0" priority="1"/></body>')
        scene = SCENE.format(step=1 / 480, height=0.03, tool='type="sphere" size="0.02"', bodies=brick)
        ticks, moved = play(5.5, scene, hand_session.reach(0.5, 0, 0.025) + hand_session.reach(4, 0.15, 0.025),
                            lambda data: np.array(data.xipos[2]))
        due = 0.4 * 0.3 * GRAVITY
        force, deviation = hand_session.mean(ticks, "command_force_x_N", 3, 4.2)
        self.assertGreater(-force, 0.75 * due)  # N; MuJoCo's friction creeps below its limit
        self.assertLess(-force, 1.1 * due)
        self.assertLess(deviation, 0.2)
        self.assertAlmostEqual(moved[-1][0], 0.19, delta=0.005)  # m

    def test_a_cube_on_a_tray_weighs_what_it_weighs(self):
        """The tool is a tray with a hand below it; the cube falls onto it and is lifted."""
        mass = 0.3
        cube = (f'<body name="cube" pos="0 0 0.0751"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="{mass}"'
                '/></body>')
        scene = SCENE.format(step=1 / 480, height=0.05, tool='type="box" size="0.05 0.05 0.005"', bodies=cube)
        ticks, moved = play(4, scene, hand_session.reach(1, 0, 0.06) + hand_session.reach(1.5, 0, 0.1),
                            lambda data: np.array(data.xipos[2]))
        weight, deviation = hand_session.mean(ticks, "command_force_z_N", 3, 3.9)
        tool = 0.1 * GRAVITY
        self.assertAlmostEqual(-weight - tool, mass * GRAVITY, delta=0.03 * mass * GRAVITY)  # N
        self.assertLess(deviation, 0.06 * mass * GRAVITY)
        self.assertGreater(moved[-1][2], 0.1)  # m: it was lifted


class Pairs(unittest.TestCase):
    """Geoms that collide by <pair> alone."""

    def session_on(self, geoms, pair):
        text = f"""<mujoco><worldbody>
            <geom name="table" type="plane" size="1 1 0.1"/>
            <body name="tool" pos="0 0 0.0215"><freejoint/><geom name="ball" type="sphere" size="0.02" contype="0"
                conaffinity="0"/></body>
            <body name="body" pos="0.2 0 0.02"><freejoint/>{geoms}</body>
          </worldbody><contact><pair geom1="{pair}" geom2="table"/></contact></mujoco>"""
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "scene.xml"
            path.write_text(text)
            self.model = mujoco.MjModel.from_xml_path(path)
        self.data = mujoco.MjData(self.model)
        session = haptic.mujoco.Session(self.model, self.data, tool="tool", binding=mujoco, server="127.0.0.1:9")
        self.addCleanup(session.close)
        return session

    def test_they_are_listed_before_they_touch(self):
        touch = self.session_on('<geom type="sphere" size="0.02"/>', "ball")
        found = touch._contacts(self.data)
        self.assertEqual(len(found), 1)
        self.assertAlmostEqual(found["separation"][0], 0.0015, delta=1e-9)  # m

    def test_a_body_is_as_round_as_all_that_collides(self):
        sphere = '<geom type="sphere" size="0.02"/>'
        block = '<geom name="block" type="box" size="0.02 0.02 0.01" contype="0" conaffinity="0"/>'
        self.assertIn(2, self.session_on(sphere, "ball")._round)
        self.assertNotIn(2, self.session_on(sphere + block, "block")._round)


class Mistakes(unittest.TestCase):
    def refused(self, text, **changes):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "scene.xml"
            path.write_text("<mujoco><worldbody><body name='arm'><joint/><geom size='0.1'/></body></worldbody></mujoco>")
            model = mujoco.MjModel.from_xml_path(path)
            with self.assertRaises(haptic.HapticError) as caught:
                haptic.mujoco.Session(model, mujoco.MjData(model), binding=mujoco, **changes)
        self.assertIn(text, str(caught.exception))

    def test_a_tool_that_is_not_there_is_named(self):
        self.refused("the model has no body 'peg'", tool="peg")

    def test_a_tool_that_cannot_move_freely_is_named(self):
        self.refused("body 'arm' must have a free joint", tool="arm")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:], verbosity=2)
