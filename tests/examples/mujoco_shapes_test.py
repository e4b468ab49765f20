#!/usr/bin/python3
"""haptic.mujoco with contacts="shapes": the same feel at every stiffness and frame rate.

Usage: mujoco_shapes_test.py LIBHAPTIC PACKAGE_FOLDER [TEST …], as mujoco_python_test.py
"""

import contextlib
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import mujoco_python_test as session  # noqa: E402  (finds the library and the package)
import haptic_local_model as haptic  # noqa: E402
import mujoco  # noqa: E402
import numpy as np  # noqa: E402
import virtual_hand  # noqa: E402
from hand_session import largest_jump, mean, push, reach  # noqa: E402
from placed_shapes import lowest  # noqa: E402

STIFFNESS = (4e3, 16e3, 50e3)  # N/m
RATES = (30, 60, 500)  # Hz
BOX = 'type="box" size="0.02 0.02 0.02" friction="0.5 0 0" priority="1"'
PRESS = session.SCENE.format(step=1 / 1500, height=0.022, tool=BOX, bodies="").replace(
    "<option ", '<option gravity="0 0 0" ')  # A tool without weight.
SLIDE = "[[segment]]\nduration = 1.5\nmove_to = { position = [0.08, 0, 0.015] }\n"


def play(seconds, scene, hand, stiffness, rate, measure=lambda data: None):
    return session.play(seconds, scene, hand, measure, "--stiffness", str(stiffness), rate=rate, contacts="shapes")


class Touch(unittest.TestCase):
    def test_a_pressed_box_rests_on_its_four_corners(self):
        for stiffness in STIFFNESS:
            for rate in RATES:
                with self.subTest(stiffness=stiffness, rate=rate):
                    ticks, _ = play(2.2, PRESS, reach(0.5, 0, 0.018) + push(3, 0, -2), stiffness, rate)
                    force, deviation = mean(ticks, "env_force_z_N", 1.1, 1.6)
                    self.assertAlmostEqual(force, 2, delta=0.01)  # N
                    self.assertLess(deviation, 0.01)
                    depth = 2 / (4 * stiffness)
                    self.assertAlmostEqual(0.02 - mean(ticks, "proxy_z_m", 1.1, 1.6)[0], depth, delta=0.02 * depth)
                    self.assertLess(largest_jump(ticks, 1.1, 1.6), 0.15)  # N

    def test_a_box_that_slides_feels_its_friction(self):
        for stiffness, rate in zip(STIFFNESS, RATES):
            with self.subTest(stiffness=stiffness, rate=rate):
                ticks, _ = play(3, PRESS, reach(0.4, 0, 0.018) + SLIDE, stiffness, rate)
                load, friction = (mean(ticks, f"env_force_{axis}_N", 1.2, 1.6)[0] for axis in "zx")
                self.assertGreater(load, 1)  # N
                self.assertAlmostEqual(-friction, 0.5 * load, delta=0.02 * load)
                self.assertLess(largest_jump(ticks, 1.2, 1.6), 0.15)  # N

    def test_a_brick_is_pushed_at_its_friction(self):
        brick = ('<body name="brick" pos="0.08 0 0.02"><freejoint/><geom type="box" size="0.02 0.04 0.02" mass="0.3"'
                 ' friction="0.4 0 0" priority="1"/></body>')
        ball = 'type="sphere" size="0.02" friction="0 0 0"'
        scene = session.SCENE.format(step=1 / 480, height=0.025, tool=ball, bodies=brick)
        due = 0.4 * 0.3 * session.GRAVITY  # N
        for stiffness, rate in zip(STIFFNESS, (30, 60, 60)):
            with self.subTest(stiffness=stiffness, rate=rate):
                ticks, moved = play(4, scene, reach(0.3, 0, 0.025) + reach(3, 0.15, 0.025), stiffness, rate,
                                    lambda data: np.array(data.xipos[2]))
                force, _ = mean(ticks, "command_force_x_N", 2, 3)
                self.assertAlmostEqual(-force, due, delta=0.25 * due)  # N; MuJoCo's friction creeps below its limit
                self.assertGreater(moved[-1][0], 0.15)  # m

    def test_one_end_of_a_seesaw_bears_what_lies_on_the_other(self):
        plank = ('<body pos="0.15 0 0.1"><joint axis="0 1 0"/><geom type="box" size="0.2 0.03 0.005" mass="0.4"/></body>'
                 '<geom type="box" size="0.01 0.03 0.0475" pos="0.34 0 0.0475"/>'
                 '<body pos="0.3 0 0.125"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.3"/></body>')
        scene = session.SCENE.format(step=1 / 960, height=0.13, tool='type="sphere" size="0.01"', bodies=plank)
        due = 0.3 * session.GRAVITY  # N, beside the tool's own weight
        ticks, moved = session.play(4, scene, reach(0.5, 0, 0.116) + reach(1.5, 0, 0.1),
                                    lambda data: np.array(data.xipos[3]), contacts="shapes")
        force, deviation = mean(ticks, "env_force_z_N", 2.7, 3.5)
        self.assertAlmostEqual(force + 0.1 * session.GRAVITY, due, delta=0.05 * due)
        self.assertLess(deviation, 0.05)
        self.assertGreater(moved[-1][2], 0.126)  # m: the cube was lifted

    def test_a_cube_on_a_tray_weighs_what_it_weighs_while_the_loop_stalls(self):
        mass = 0.3  # kg
        cube = (f'<body name="cube" pos="0 0 0.0751"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="{mass}"'
                '/></body>')
        arm = """<body pos="-0.2 0 0.16"><joint name="joint" axis="0 1 0" damping="1"/><geom type="capsule" fromto="0 0 0 0.12 0 0" size="0.01"
            mass="0.2"/></body>"""
        servo = """</worldbody><actuator><general joint="joint" biastype="affine" gainprm="20" biasprm="0 -20 0"/></actuator>"""
        plain, beside_arm = (session.SCENE.format(step=1 / 480, height=0.05, tool='type="box" size="0.05 0.05 0.005"',
                                                  bodies=cube + other) for other in ("", arm))
        for scene, stall in ((plain, 0), (plain, 0.1), (beside_arm.replace("</worldbody>", servo), 0)):
            with self.subTest(stall=stall):
                ticks, moved = session.play(4, scene, reach(1, 0, 0.06) + reach(1.5, 0, 0.1),
                                            lambda data: np.array(data.xipos[2]), contacts="shapes", stall=stall)
                weight, deviation = mean(ticks, "command_force_z_N", 3, 3.9)
                due = (mass + 0.1) * session.GRAVITY
                self.assertAlmostEqual(-weight, due, delta=0.03 * due)  # N
                self.assertLess(deviation, 0.1 if stall else 0.02)
                self.assertGreater(moved[-1][2], 0.1)  # m: it was lifted

    def test_a_cube_on_a_plate_that_a_servo_holds_is_pressed_without_chatter(self):
        """0.5 kg on 2000 N/m, a cube of 0.3 kg, a hand of 400 N/m that goes 20 mm down, 12 mm of it against the cube."""
        bodies = ('<body pos="0 0 0.1"><joint name="joint" type="slide" axis="0 0 1" damping="20"/><geom type="box" '
                  'size="0.06 0.06 0.01" mass="0.5"/></body><body pos="0 0 0.1301"><freejoint/><geom type="box" size="0.02 0.02 0.02" '
                  'mass="0.3"/></body>')
        servo = """</worldbody><actuator><general joint="joint" biastype="affine" gainprm="2000" biasprm="0 -2000 -40"/></actuator>"""
        scene = session.SCENE.format(step=1 / 480, height=0.18, tool='type="sphere" size="0.02"', bodies=bodies)
        ticks, _ = session.play(5, scene.replace("</worldbody>", servo), reach(1.2, 0, 0.18) + reach(1, 0, 0.16),
                                contacts="shapes")
        force, deviation = mean(ticks, "env_force_z_N", 3.5, 4.5)
        self.assertGreater(force, 1)  # N
        self.assertLess(deviation, 0.1)

    def test_a_platform_that_is_moved_by_hand_lifts_the_tool(self):
        """A mocap body rises by 20 mm at 40 mm/s under a tool of 0.1 kg."""
        scene = session.SCENE.format(
            step=1 / 480, height=0.041, tool='type="sphere" size="0.02"',
            bodies='<body name="platform" mocap="true" pos="0 0 0.01"><geom type="box" size="0.1 0.1 0.01"/></body>')
        model, data = session.loaded(scene)
        with virtual_hand.server(reach(0.5, 0, 0.041) + push(4, 0, -1)) as server, haptic.mujoco.Session(
                model, data, tool="tool", binding=mujoco, contacts="shapes") as touch:
            for frame in range(1, 180):
                if 90 < frame <= 120:
                    data.mocap_pos[0][2] += 0.02 / 30
                for _ in range(touch.drive(data)):
                    mujoco.mj_step(model, data)
                touch.send(data)
            self.assertTrue(touch.touch.has_scene)
            depth = (1 + 0.1 * session.GRAVITY) / session.STIFFNESS
            self.assertAlmostEqual(data.qpos[2], 0.06 - depth, delta=1e-4)  # m

    def test_what_is_no_contact_is_felt_too(self):
        """A cube that an equality ties to the tool, and a rope that a motor pulls."""
        cube = '<body name="cube" pos="0 0 0.1"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.3"/></body>'
        rope = ('<tendon><spatial name="rope"><site site="on"/><site site="up"/></spatial></tendon>'
                '<actuator><motor tendon="rope"/></actuator>')
        weight = 0.3 * session.GRAVITY
        for held, due in (('<equality><weld body1="tool" body2="cube"/></equality>', -weight),
                          ('<equality><connect body1="tool" body2="cube" anchor="0 0 -0.05"/></equality>', -weight),
                          (rope, 5)):
            with self.subTest(held=held):
                scene = session.SCENE.format(step=1 / 480, height=0.2, tool=BOX, bodies=(
                    cube if due < 0 else '<site name="up" pos="0 0 1"/>')).replace(
                        "<freejoint/>", '<freejoint/><site name="on"/>', 1).replace("</mujoco>", held + "</mujoco>")
                model, data = session.loaded(scene)
                if model.nu > 0:
                    data.ctrl[0] = -5
                with virtual_hand.server(reach(1, 0, 0.2)) as server:
                    with haptic.mujoco.Session(model, data, tool="tool", binding=mujoco, contacts="shapes") as touch:
                        for frame in range(1, 180):
                            for _ in range(touch.drive(data)):
                                mujoco.mj_step(model, data)
                            touch.send(data)
                    force, deviation = mean(virtual_hand.active(server), "command_force_z_N", 2.2, 2.9)
                self.assertAlmostEqual(force, due - 0.1 * session.GRAVITY, delta=0.03)  # N
                self.assertLess(deviation, 0.02)

    def test_a_server_that_takes_no_shapes_gets_contacts(self):
        scene = session.SCENE.format(step=1 / 480, height=0.023, tool='type="sphere" size="0.02"', bodies="")
        model, data = session.loaded(scene)
        with haptic.mujoco.Session(model, data, tool="tool", binding=mujoco, contacts="shapes",
                                   server="127.0.0.1:9") as touch:
            for message, expected in (("", 0), ("the server takes no scenes", 1)):
                sent = []
                touch.touch.send = lambda contacts=None, *_: sent.append(0 if contacts is None else len(contacts))
                touch.touch._state.connected, touch.touch._state.message = 1, message.encode()
                touch._frames.length = 1 / 60
                with self.assertWarnsRegex(UserWarning, message) if message else contextlib.nullcontext():
                    touch.send(data)
                self.assertEqual(sent, [expected])

    @unittest.skipIf(session.VERSION < (3, 17), "MuJoCo's own distance from a height field was wrong by up to 7.5 mm")
    def test_a_geom_without_a_shape_is_felt_by_mujoco_s_contacts_and_the_others_by_their_shapes(self):
        """A ball on a height field, flat and 20 mm high, and then on the plane beside it."""
        hills = '<geom type="hfield" hfield="hills" pos="0 0 0.02"/>'
        asset = '<asset><hfield name="hills" nrow="2" ncol="2" size="0.1 0.1 0.02 0.01"/></asset>'
        scene = session.SCENE.format(step=1 / 480, height=0.043, tool='type="sphere" size="0.02"', bodies=hills).replace(
            "<worldbody>", asset + "<worldbody>")
        model, data = session.loaded(scene)
        hand = reach(1, 0.04, 0.041) + push(1.5, 0, -1) + reach(0.5, 0.04, 0.06) + reach(1, 0.2, 0.06) + reach(1, 0.2, 0.021) + push(1.5, 0, -1)
        with virtual_hand.server(hand) as server:
            with self.assertWarnsRegex(UserWarning, "of 1 geom that can be given no shape, the first of them geom 1 of type 1"):
                touch = haptic.mujoco.Session(model, data, tool="tool", binding=mujoco)
            with touch:
                for frame in range(1, 390):
                    for _ in range(touch.drive(data)):
                        mujoco.mj_step(model, data)
                    touch.send(data)
                self.assertTrue(touch.touch.has_scene)
            for begin, end, height in ((1.6, 2.2, 0.04), (5.8, 6.2, 0.02)):
                force, deviation = mean(virtual_hand.active(server), "env_force_z_N", begin, end)
                self.assertAlmostEqual(force, 1, delta=0.01)  # N, with the tool's own weight
                self.assertLess(deviation, 0.02)
                self.assertAlmostEqual(mean(virtual_hand.active(server), "proxy_z_m", begin, end)[0], height, delta=1e-3)  # m


class Reset(unittest.TestCase):
    def test_what_is_held_is_where_the_reset_puts_it_and_the_hand_lets_go(self):
        """A reset, and a program that puts the cube elsewhere."""
        def put_back(model, data):
            data.qpos[7:10] = 0.3, 0, 0.0751
            data.qvel[6:] = 0
        for name, reset, place in (("mj_resetData", mujoco.mj_resetData, 0), ("qpos", put_back, 0.3)):
            with self.subTest(name):
                self.reset(reset, place)

    def reset(self, reset, place):
        cube = '<body pos="0 0 0.0751"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.3"/></body>'
        scene = session.SCENE.format(step=1 / 480, height=0.05, tool='type="box" size="0.05 0.05 0.005"', bodies=cube)
        model, data = session.loaded(scene)
        heights = []
        with virtual_hand.server(reach(1, 0, 0.06) + reach(1, 0, 0.2)) as server:
            with haptic.mujoco.Session(model, data, tool="tool", binding=mujoco, contacts="shapes") as touch:
                for frame in range(1, 4 * session.RATE + 1):
                    for _ in range(touch.drive(data)):
                        mujoco.mj_step(model, data)
                    touch.send(data)
                    heights.append(data.xpos[2][2])
                    if frame == 3 * session.RATE:
                        self.assertGreater(heights[-1], 0.2)  # m: it is held
                        reset(model, data)
            ticks = virtual_hand.active(server)
        after = heights[3 * session.RATE:]
        self.assertLess(max(after), 0.076)  # m: it does not come back to the hand
        self.assertAlmostEqual(after[-1], 0.02, delta=0.001)  # it has fallen onto the table
        self.assertAlmostEqual(data.xpos[2][0], place, delta=0.001)
        self.assertAlmostEqual(mean(ticks, "env_force_z_N", 3.2, 3.5)[0], -0.1 * session.GRAVITY, delta=0.01)
        np.testing.assert_array_equal(model.dof_armature, 0)


class Joints(unittest.TestCase):
    """What joints hold: the hand pushes down with 1.57 N on a box that turns about a line 0.1 m beside its middle, or slides."""

    PUSH, LEVER = 1.57, 0.1  # N, m
    HINGE, SLIDE = 'type="hinge" axis="0 1 0" pos="-0.1 0 0"', 'type="slide" axis="0 0 -1"'
    HELD = {
        "a lid at its stop": (f'{HINGE} limited="true" range="-90 0"', 0),
        "a door that is hard to turn": (f'{HINGE} frictionloss="0.5"', 0),
        "a lever on its spring": (f'{HINGE} stiffness="40" damping="2"', PUSH * LEVER**2 / 40),
        "a drawer at its stop": (f'{SLIDE} limited="true" range="-0.1 0"', 0),
        "a drawer that is hard to move": (f'{SLIDE} frictionloss="3"', 0),
        "a button of 300 N/m": (f'{SLIDE} stiffness="300" damping="2"', PUSH / 300),
        "a button of 1000 N/m": (f'{SLIDE} stiffness="1000" damping="2"', PUSH / 1000)}

    def push(self, joint, mass, rate=session.RATE):
        """Mean and deviation of the force, N, and how far the box yields, m."""
        box = (f'<body pos="0 0 0.1" gravcomp="1"><joint {joint}/><geom type="box" size="0.03 0.03 0.02" mass="{mass}"/></body>')
        scene = session.SCENE.format(step=1 / 960, height=0.141, tool='type="sphere" size="0.02"', bodies=box).replace(
            "<option ", '<option gravity="0 0 0" ')
        ticks, moved = session.play(3, scene, reach(0.3, 0, 0.141) + push(4, 0, -self.PUSH), lambda data: data.xipos[2][2],
                                    rate=rate, contacts="shapes")
        return *mean(ticks, "env_force_z_N", 1.8, 2.4), 0.1 - moved[-1]

    def test_they_bear_the_hand(self):
        for (name, (joint, yields)), mass in zip(self.HELD.items(), (0.05, 0.3, 5, 0.05, 5, 0.3, 0.05)):
            with self.subTest(name, mass=mass):
                force, deviation, moved = self.push(joint, mass)
                print(f"{name}, {mass} kg: {force:.4f} N, deviation {deviation:.4f} N, yields {1e3 * moved:.3f} mm")
                self.assertAlmostEqual(force, self.PUSH, delta=0.01 * self.PUSH)  # N
                self.assertLess(deviation, 0.01)
                self.assertAlmostEqual(moved, yields, delta=1e-4 + 0.03 * yields)  # m

    def test_a_rope_of_five_on_a_tray_weighs_what_it_weighs(self):
        rope = "".join(f'<body name="l{i}" pos="{0.024 if i else -0.048} 0 {0 if i else 0.0651}">' + (
            '<joint type="hinge" axis="0 0 1" pos="-0.012 0 0"/>' if i else "<freejoint/>") +
            '<geom type="capsule" fromto="-0.01 0 0 0.01 0 0" size="0.005" mass="0.02"/>' for i in range(5)) + "</body>" * 5
        scene = session.SCENE.format(step=1 / 960, height=0.05, tool='type="box" size="0.08 0.05 0.01"', bodies=rope)
        ticks, moved = session.play(4, scene, reach(1, 0, 0.06) + reach(1.5, 0, 0.1), lambda data: np.array(data.xipos[2:]),
                                    contacts="shapes")
        weight, deviation = mean(ticks, "env_force_z_N", 3, 3.9)
        due = (5 * 0.02 + 0.1) * session.GRAVITY
        print(f"a rope of five: {-weight:.4f} N, due {due:.4f} N, deviation {deviation:.4f} N")
        self.assertAlmostEqual(-weight, due, delta=0.01 * due)
        self.assertLess(deviation, 0.02)
        self.assertGreater(moved[-1][:, 2].min(), 0.1)  # m


class Geoms(unittest.TestCase):
    def test_every_kind_of_geom_is_found_where_it_is(self):
        """The lowest point of each kind, turned as it stands."""
        kinds = {'type="sphere" size="0.02"': 0.02, 'type="box" size="0.01 0.02 0.03"': 0.03,
                 'type="capsule" size="0.01 0.02"': 0.03, 'type="cylinder" size="0.01 0.02"': 0.02,
                 'type="ellipsoid" size="0.01 0.02 0.03"': 0.03, 'type="box" size="0.01 0.02 0.03" euler="0 90 0"': 0.01}
        for geom, below in kinds.items():
            with self.subTest(geom=geom):
                shapes, data = self.shapes(geom, 0.1)
                positions, rotations = shapes._places(data)
                self.assertAlmostEqual(lowest(shapes._shapes[1], positions[1], rotations[1]), 0.1 - below, delta=1e-9)  # m

    def test_a_mesh_is_its_convex_hull(self):
        shapes, _ = self.shapes('type="mesh" mesh="tent"', 0.1)
        self.assertEqual(shapes._shapes[1].kind, haptic.shapes.KINDS["hull"])
        self.assertEqual(shapes._shapes[1].vertex_count, 4)

    def test_a_tool_that_can_be_given_no_shape_is_named(self):
        hills = '<asset><hfield name="hills" nrow="2" ncol="2" size="0.1 0.1 0.02 0.01"/></asset>'
        model, data = session.loaded(self.TEXT.format(geom='type="hfield" hfield="hills"', height=0.1, world="", last="",
                                                      contact="").replace("<worldbody>", hills + "<worldbody>"))
        with self.assertRaisesRegex(haptic.HapticError, "no geom of the tool can be given as a shape"):
            haptic.mujoco.from_mujoco(model, 1, mujoco)

    def test_what_the_model_excludes_does_not_touch_though_it_is_welded(self):
        """A ball on a post that stands still: MuJoCo takes the post for the world."""
        post = '<body name="post" pos="0 0 0.06"><geom type="box" size="0.02 0.02 0.02"/></body>'
        ball = 'type="sphere" size="0.02"'
        self.assertEqual(self.shapes(ball, 0.101, world=post)[0]._shaped.apart, [])
        exclude = '<contact><exclude body1="post" body2="tool"/></contact>'
        for last in ("", '<body pos="1 0 1"><freejoint/><geom size="0.02"/></body>'):  # Versions count from 0 or from 1.
            self.assertEqual(self.shapes(ball, 0.101, world=post, last=last, contact=exclude)[0]._shaped.apart, [(2, 1)])

    TEXT = """<mujoco><asset><mesh name="tent" vertex="0 0 0  0.02 0 0  0 0.02 0  0 0 0.02"/></asset><worldbody>
        <geom type="plane" size="1 1 0.1"/>{world}<body name="tool" pos="0 0 {height}"><freejoint/>
        <inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/><geom {geom}/></body>{last}</worldbody>
        {contact}</mujoco>"""

    def shapes(self, geom, height, world="", last="", contact=""):
        model, data = session.loaded(self.TEXT.format(geom=geom, height=height, world=world, last=last, contact=contact))
        mujoco.mj_forward(model, data)
        return haptic.mujoco.from_mujoco(model, mujoco.mj_name2id(model, 1, "tool"), mujoco), data


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
