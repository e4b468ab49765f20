#!/usr/bin/python3
"""The MuJoCo example in C++: a ball presses on a table and pushes a brick, a tray carries a cube.

Usage: mujoco_cpp_test.py HAPTIC_SERVER EXAMPLE
"""

import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

SERVER, EXAMPLE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))

import hand_session  # noqa: E402
from hand_session import mean, reach  # noqa: E402

STIFFNESS = 4000  # N/m, of each contact: the server's default
GRAVITY = 9.81  # m/s²
MASS, TOOL_MASS = 0.3, 0.1  # kg
SCENE = """<mujoco>
  <option timestep="0.00208333333"/>
  <worldbody>
    <geom type="plane" size="1 1 0.1"/>
    <body name="tool" pos="0 0 {height}"><freejoint/><geom {tool} mass="0.1"/></body>
    {body}
  </worldbody>
  {held}
</mujoco>"""
BALL = 'type="sphere" size="0.02"'
BRICK = ('<body pos="0.08 0 0.02"><freejoint/><geom type="box" size="0.02 0.04 0.02" mass="0.3" friction="0.4 0 0"'
         ' priority="1"/></body>')
CUBE = '<body pos="0 0 0.0751"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.3"/></body>'


def play(seconds, hand, **scene):
    """Runs server and example. Returns the ticks with force on, and where the last body was at the end, m."""
    with tempfile.TemporaryDirectory() as folder, hand_session.server(SERVER, hand) as server:
        path = pathlib.Path(folder) / "scene.xml"
        path.write_text(SCENE.format(**{"held": "", **scene}))
        printed = subprocess.run([EXAMPLE, path, server.address, str(seconds)], stdout=subprocess.PIPE, text=True,
                                 check=True, timeout=60).stdout
        places = re.findall(r"body at \((\S+), (\S+), (\S+)\)", printed)
        return server.ticks(), [float(x) for x in places[-1]]


class Touch(unittest.TestCase):
    def test_a_ball_on_the_table_rests_where_its_spring_bears_the_push(self):
        ticks, _ = play(2.5, reach(0.5, 0, 0.015), height=0.03, tool=BALL, body="")
        force, deviation = mean(ticks, "command_force_z_N", 1.5, 2.4)
        # The table bears the hand's spring, 5 mm long at first, and the tool's weight.
        depth = (0.005 * hand_session.STIFFNESS + TOOL_MASS * GRAVITY) / (hand_session.STIFFNESS + STIFFNESS)
        self.assertAlmostEqual(force, hand_session.STIFFNESS * (0.005 - depth), delta=0.01)  # N
        self.assertLess(deviation, 0.01)                                                     # N

    def test_a_brick_is_pushed_at_its_friction(self):
        ticks, brick = play(5.5, reach(0.5, 0, 0.025) + reach(4, 0.15, 0.025), height=0.03, tool=BALL, body=BRICK)
        due = 0.4 * MASS * GRAVITY  # N
        force, deviation = mean(ticks, "command_force_x_N", 3, 4.2)
        self.assertGreater(-force, 0.75 * due)  # MuJoCo's friction creeps below its limit.
        self.assertLess(-force, 1.1 * due)
        self.assertLess(deviation, 0.2)               # N
        self.assertAlmostEqual(brick[0], 0.19, delta=0.005)  # m

    def test_a_cube_on_a_tray_weighs_what_it_weighs(self):
        ticks, cube = play(4, reach(1, 0, 0.06) + reach(1.5, 0, 0.1), height=0.05,
                           tool='type="box" size="0.05 0.05 0.005"', body=CUBE)
        weight, deviation = mean(ticks, "command_force_z_N", 3, 3.9)
        self.assertAlmostEqual(-weight - TOOL_MASS * GRAVITY, MASS * GRAVITY, delta=0.03 * MASS * GRAVITY)  # N
        self.assertLess(deviation, 0.06 * MASS * GRAVITY)
        self.assertGreater(cube[2], 0.1)  # m: it was lifted

    def test_a_cube_that_is_welded_to_the_tool_weighs_what_it_weighs(self):
        ticks, _ = play(3.5, reach(1, 0, 0.2), height=0.2, tool='type="box" size="0.02 0.02 0.02"',
                        body=CUBE.replace("<body", '<body name="cube"').replace("0 0 0.0751", "0 0 0.1"),
                        held='<equality><weld body1="tool" body2="cube"/></equality>')
        weight, deviation = mean(ticks, "command_force_z_N", 2.5, 3.4)
        self.assertAlmostEqual(-weight, (MASS + TOOL_MASS) * GRAVITY, delta=0.01 * MASS * GRAVITY)  # N
        self.assertLess(deviation, 0.01)


class Mistakes(unittest.TestCase):
    def refused(self, body, text):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "scene.xml"
            path.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
            done = subprocess.run([EXAMPLE, path, "127.0.0.1:9", "1"], stderr=subprocess.PIPE, text=True)
        self.assertEqual((done.returncode, done.stderr), (1, f"touch_mujoco: {text}\n"))

    def test_a_tool_that_cannot_be_one_is_named(self):
        ball = '<geom size="0.02"/>'
        self.refused(f'<body name="peg"><freejoint/>{ball}</body>', "the model has no body 'tool'")
        self.refused(f'<body name="tool"><joint/>{ball}</body>',
                     "body 'tool' must have a free joint, as the tool moves freely in the hand")
        self.refused(f'<body name="tool"><freejoint/>{ball}<body>{ball}</body></body>',
                     "body 'tool' has bodies without joints welded to it; put their geoms into it")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
