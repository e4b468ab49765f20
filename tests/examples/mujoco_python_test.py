#!/usr/bin/python3
"""haptic.mujoco on MuJoCo's official binding: held, pushed and pressed things have their weight, friction and stiffness.

Usage: mujoco_python_test.py LIBHAPTIC PACKAGE_FOLDER [TEST …], with the Python of an environment in .venv
"""

import itertools
import os
import pathlib
import statistics
import sys
import time
import types
import unittest
import warnings

LIBRARY, PACKAGE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
SUPPORT = pathlib.Path(__file__).resolve().parents[1] / "support"
os.environ["HAPTIC_LIBRARY"] = str(LIBRARY)
sys.path[:0] = [str(PACKAGE), str(SUPPORT)]

import haptic_local_model as haptic  # noqa: E402
import haptic_local_model.mujoco  # noqa: E402
import hand_session  # noqa: E402
import virtual_hand  # noqa: E402
import mujoco  # noqa: E402
import numpy as np  # noqa: E402

VERSION = tuple(map(int, mujoco.mj_versionString().split(".")[:2]))
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
BRICK = ('<body name="brick" pos="0.08 0 0.02"><freejoint/><geom type="box" size="0.02 0.04 0.02" mass="0.3"'
         ' friction="0.4 0 0" priority="1"/></body>')


def play(seconds, scene, hand, measure=lambda data: None, *options, rate=RATE, contacts="engine", stall=0):
    """Runs the loop of the module's first lines, which stands still for `stall` seconds now and then. Returns the ticks of
    the server, and all that was measured."""
    measured = []
    model, data = loaded(scene)
    with virtual_hand.server(hand, *options) as server:
        with haptic.mujoco.Session(model, data, tool="tool", period=1 / rate, binding=mujoco, contacts=contacts) as touch:
            frame = 0
            while server.now < seconds:
                for _ in range(touch.drive(data)):
                    mujoco.mj_step(model, data)
                touch.send(data)
                measured.append(measure(data))
                frame += 1
                if stall and frame % (rate // 2) == 0:
                    server.wait(stall)
        return virtual_hand.active(server), measured


def loaded(scene):
    """Model and data."""
    model = mujoco.MjModel.from_xml_string(scene)
    return model, mujoco.MjData(model)


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
        scene = SCENE.format(step=1 / 480, height=0.03, tool='type="sphere" size="0.02"', bodies=BRICK)
        ticks, moved = play(5.5, scene, hand_session.reach(0.5, 0, 0.025) + hand_session.reach(4, 0.15, 0.025),
                            lambda data: np.array(data.xipos[2]))
        due = 0.4 * 0.3 * GRAVITY
        force, deviation = hand_session.mean(ticks, "command_force_x_N", 3, 4.2)
        self.assertGreater(-force, 0.75 * due)  # N; MuJoCo's friction creeps below its limit
        self.assertLess(-force, 1.1 * due)
        self.assertLess(deviation, 0.2)
        self.assertAlmostEqual(moved[-1][0], 0.19, delta=0.005)  # m

    def test_a_force_of_the_user_s_own_on_a_pushed_brick_stays(self):
        """It bears a part of the brick's weight, so that there is less friction."""
        own, frames = (0, 0, 1.5, 0, 0, 0), []  # N

        def lift(data):
            if not frames:
                data.xfrc_applied[2] = own
            frames.append(np.array(data.xfrc_applied[2]))

        scene = SCENE.format(step=1 / 480, height=0.03, tool='type="sphere" size="0.02"', bodies=BRICK)
        ticks, _ = play(3.6, scene, hand_session.reach(0.5, 0, 0.025) + hand_session.reach(2.8, 0.105, 0.025), lift)
        np.testing.assert_allclose(frames, np.tile(own, (len(frames), 1)), atol=1e-9)
        due = 0.4 * (0.3 * GRAVITY - own[2])
        force, _ = hand_session.mean(ticks, "command_force_x_N", 2.2, 3.1)
        self.assertGreater(-force, 0.75 * due)  # N
        self.assertLess(-force, 1.1 * due)

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

    def test_an_arm_that_a_servo_holds_is_pushed_at_its_stiffness(self):
        """Damping, of its joint or of the servo, acts within a frame: 0.17 kg at the tip."""
        length, stiffness, damping, push = 0.2, 20, 1.5, 0.02  # m, N·m/rad, N·m·s/rad, m
        due = push / (1 / hand_session.STIFFNESS + length**2 / stiffness + 1 / STIFFNESS)
        for of_joint, of_servo, contacts in ((damping, 0, "engine"), (0, damping, "shapes")):
            with self.subTest(of_joint=of_joint, of_servo=of_servo):
                arm = f"""<body pos="-0.2 0 0.3"><joint name="joint" axis="0 1 0" damping="{of_joint}"/>
                    <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.01" mass="0.2"/>
                    <geom type="box" size="0.02 0.02 0.01" pos="0.2 0 0" mass="0.1"/></body>"""
                servo = f"""<actuator><general joint="joint" biastype="affine" gainprm="{stiffness}"
                    biasprm="0 -{stiffness} -{of_servo}"/></actuator>"""
                scene = SCENE.format(step=0.002, height=0.335, tool='type="sphere" size="0.02"', bodies=arm).replace(
                    "<option ", '<option gravity="0 0 0" ').replace("</worldbody>", "</worldbody>" + servo)
                ticks, _ = play(4, scene, hand_session.reach(1, 0, 0.335) + hand_session.reach(0.5, 0, 0.33 - push),
                                contacts=contacts)
                force, deviation = hand_session.mean(ticks, "command_force_z_N", 3, 3.9)
                self.assertAlmostEqual(force, due, delta=0.05 * due)  # N
                self.assertLess(deviation, 0.1)

    def test_when_the_server_ends_the_tray_bears_the_cube_by_itself(self):
        cube = '<body pos="0 0 0.0751"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.3"/></body>'
        model, data = loaded(SCENE.format(step=1 / 480, height=0.05, tool='type="box" size="0.05 0.05 0.005"', bodies=cube))
        with virtual_hand.server(hand_session.reach(1, 0, 0.06)) as server:
            with haptic.mujoco.Session(model, data, tool="tool", contacts="engine", binding=mujoco) as touch:
                ends = None  # The frame in which the server does, after two seconds and once MuJoCo gives no force.
                for frame in range(1, 5 * RATE + 1):
                    forces = np.asarray(data.contact.efc_address[:data.ncon]) != -1
                    if ends is None and frame >= 2 * RATE and len(forces) > 0 and not forces.any():
                        ends = frame
                        server.stop()
                    if ends is not None and frame == ends + RATE:
                        break
                    for _ in range(touch.drive(data)):
                        mujoco.mj_step(model, data)
                    touch.send(data)
        self.assertIsNotNone(ends, "MuJoCo gives the tool a force beside the server's")
        self.assertFalse(touch.touch.connected)
        self.assertAlmostEqual(data.xipos[2][2] - data.xipos[1][2], 0.025, delta=0.003)  # m


class Time(unittest.TestCase):
    """A cube of 0.3 kg on a tray is lifted by 40 mm and carried to the side, by a loop that is slow, late or both."""

    TOOL = 'type="box" size="0.05 0.05 0.005"'
    CUBE = '<body name="cube" pos="0 0 0.0751"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.3"/></body>'

    def lift(self, *, step, rate, stall=0):
        scene = SCENE.format(step=step, height=0.05, tool=self.TOOL, bodies=self.CUBE)
        hand = hand_session.reach(1, 0, 0.06) + hand_session.reach(1.5, 0, 0.1) + hand_session.reach(1, 0.03, 0.1)
        ticks, measured = play(4.4, scene, hand, lambda data: (data.time, data.xipos[2][2] - data.xipos[1][2] - 0.025),
                               rate=rate, stall=stall, contacts="shapes")
        self.is_carried(ticks, [gap for _, gap in measured[rate:]],
                        f"step {1e3 * step:g} ms, {rate} Hz, stalls of {1e3 * stall:g} ms")
        return measured[rate:]

    def is_carried(self, ticks, gaps, how):
        weight = (0.3 + 0.1) * GRAVITY  # N, of cube and tool
        least, most = hand_session.extremes(ticks, "env_force_z_N", 1.2, 3.9)
        jump = hand_session.largest_jump(ticks, 1.2, 3.9)
        print(f"{how}: cube {1e3 * min(gaps):.1f} to {1e3 * max(gaps):.1f} mm above the tray, at last "
              f"{1e3 * gaps[-1]:.1f} mm; force {-most:.2f} to {-least:.2f} N, at most {jump:.3f} N in an update")
        self.assertLess(-least, weight + 0.1)
        self.assertGreater(-most, weight - 0.1)
        self.assertLess(max(gaps), 0.0015)  # m
        self.assertGreater(min(gaps), -0.0015)
        self.assertLess(jump, 0.05)  # N

    def test_a_cube_is_carried_at_every_rate_of_the_user_s_loop(self):
        for step, rate in ((0.002, 15), (0.002, 25), (0.002, 50), (0.002, 60), (0.004, 144)):
            with self.subTest(step=step, rate=rate):
                simulated, _ = zip(*self.lift(step=step, rate=rate))
                self.assertAlmostEqual(simulated[-1] - simulated[0], 4.4 - 1, delta=0.1)  # s

    def test_a_cube_stays_on_the_tray_while_the_loop_stalls(self):
        for stall in (0.03, 0.1, 0.3):
            with self.subTest(stall=stall):
                self.lift(step=0.002, rate=RATE, stall=stall)

    def test_who_takes_other_steps_is_told_so(self):
        model, data = loaded(SCENE.format(step=0.002, height=0.03, tool='type="sphere" size="0.02"', bodies=""))
        with haptic.mujoco.Session(model, data, tool="tool", contacts="engine", binding=mujoco, server="127.0.0.1:9") as touch:
            self.assertEqual(touch.drive(data), 8)  # of a frame at 60 Hz
            mujoco.mj_step(model, data)
            with self.assertWarnsRegex(UserWarning, "returned 8 steps, and 1 were taken"):
                touch.send(data)


class Weight(unittest.TestCase):
    def test_a_tool_whose_weight_is_compensated_floats_from_the_start(self):
        for share, due in ((1, 0), (0.5, 0.05 * GRAVITY)):
            with self.subTest(share=share):
                scene = SCENE.format(step=0.002, height=0.3, tool='type="sphere" size="0.02"', bodies="").replace(
                    'name="tool"', f'name="tool" gravcomp="{share}"')
                ticks, moved = play(2, scene, hand_session.reach(2, 0, 0.3), lambda data: data.qpos[2], contacts="shapes")
                self.assertAlmostEqual(-hand_session.mean(ticks, "command_force_z_N", 1.5, 1.9)[0], due, delta=1e-3)  # N
                self.assertGreater(min(moved), 0.3 - 1.5 * due / hand_session.STIFFNESS - 1e-6)  # m


class Reach(unittest.TestCase):
    def test_what_is_far_from_the_origin_moves_faster_as_the_tool_turns(self):
        tool = 'type="sphere" size="0.02" pos="0.3 0 0"'
        model, data = loaded(SCENE.format(step=0.002, height=0.03, tool=tool, bodies=""))
        with haptic.mujoco.Session(model, data, tool="tool", binding=mujoco, server="127.0.0.1:9") as touch:
            self.assertAlmostEqual(touch._frames.speed(np.array((0, 0, 0, 0, 1, 0))), 0.32, delta=1e-9)  # m/s


class Hand(unittest.TestCase):
    """Of the simulated device, as the session moves it."""

    def test_it_presses_until_it_lets_go(self):
        model, data = loaded(SCENE.format(step=1 / 480, height=0.03, tool='type="sphere" size="0.02"', bodies=""))
        forces = []  # N
        with haptic.virtual.Server(), haptic.mujoco.Session(model, data, tool="tool", contacts="engine", binding=mujoco) as touch:
            for frame in range(1, 2 * RATE + 1):
                if frame == RATE:
                    touch.release()
                elif frame < RATE:
                    touch.hold((0, 0, 0.015))
                for _ in range(touch.drive(data)):
                    mujoco.mj_step(model, data)
                touch.send(data)
                forces.append(touch.touch.force[2])
        self.assertGreater(np.mean(forces[RATE - 10:RATE]), 0.8)      # its spring of 200 N/m, 4.8 mm long
        self.assertAlmostEqual(np.mean(forces[-10:]), 0, delta=0.02)  # the ball lies on the table


class Pairs(unittest.TestCase):
    """Geoms that collide by <pair> alone."""

    def session_on(self, geoms, pair):
        text = f"""<mujoco><worldbody>
            <geom name="table" type="plane" size="1 1 0.1"/>
            <body name="tool" pos="0 0 0.0215"><freejoint/><geom name="ball" type="sphere" size="0.02" contype="0"
                conaffinity="0"/></body>
            <body name="body" pos="0.2 0 0.02"><freejoint/>{geoms}</body>
          </worldbody><contact><pair geom1="{pair}" geom2="table"/></contact></mujoco>"""
        self.model, self.data = loaded(text)
        session = haptic.mujoco.Session(self.model, self.data, tool="tool", contacts="engine", binding=mujoco, server="127.0.0.1:9")
        self.addCleanup(session.close)
        return session

    def test_they_are_listed_before_they_touch(self):
        touch = self.session_on('<geom type="sphere" size="0.02"/>', "ball")
        found = touch._contacts(self.data, touch._listing.early)
        self.assertEqual(len(found), 1)
        self.assertAlmostEqual(found["separation"][0], 0.0015, delta=1e-9)  # m

    def test_a_body_is_as_round_as_all_that_collides(self):
        sphere = '<geom type="sphere" size="0.02"/>'
        block = '<geom name="block" type="box" size="0.02 0.02 0.01" contype="0" conaffinity="0"/>'
        self.assertIn(2, self.session_on(sphere, "ball")._round)
        self.assertNotIn(2, self.session_on(sphere + block, "block")._round)


def box_gap(one, other):
    """The largest gap between two boxes along an axis of theirs, each a position, a rotation and half its edges, m."""
    (at, R, half), (there, S, other_half) = one, other
    axes = np.vstack([R.T, S.T, np.cross(R.T[:, None], S.T).reshape(9, 3)])
    axes /= np.maximum(np.linalg.norm(axes, axis=1), 1e-9)[:, None]
    return (np.abs(axes @ (there - at)) - np.abs(axes @ R) @ half - np.abs(axes @ S) @ other_half).max()


class Listing(unittest.TestCase):
    """Contacts are known epsilon before they touch, and no earlier."""

    EPSILON = 0.005  # m
    # Each a tool whose lowest point is so far below its origin, m.
    TOOLS = {'type="sphere" size="0.02"': 0.02, 'type="box" size="0.01 0.02 0.03"': 0.03,
             'type="capsule" size="0.01 0.02"': 0.03, 'type="cylinder" size="0.01 0.02"': 0.02,
             'type="ellipsoid" size="0.01 0.02 0.03"': 0.03, 'type="mesh" mesh="block"': 0.03}
    BOX = '<geom type="box" size="0.1 0.1 0.1" pos="0 0 -0.1"/>'
    FAR = '<geom type="sphere" size="0.005" pos="0 0 0.3"/><geom type="sphere" size="0.005" pos="0 0 0.35"/>'
    BELOW = {"a plane": '<geom type="plane" size="1 1 0.1"/>', "a box": BOX, "two boxes": BOX + BOX.replace("-0.1", "-0.5"),
             "a body": f"<body><freejoint/>{BOX}</body>"}
    CORNERS = " ".join(f"{x} {y} {z}" for x in (-0.01, 0.01) for y in (-0.02, 0.02) for z in (-0.03, 0.03))

    def contacts(self, tool, below, height):
        model, data = loaded(f"""<mujoco><asset><mesh name="block" vertex="{self.CORNERS}"/></asset><worldbody>{below}
            <body name="tool" pos="0 0 {height}"><freejoint/><inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>
            {tool}</body><body pos="1 0 1"><freejoint/><geom size="0.01"/></body></worldbody></mujoco>""")
        with haptic.mujoco.Session(model, data, tool="tool", epsilon=self.EPSILON, contacts="engine", binding=mujoco,
                                   server="127.0.0.1:9") as touch:
            found = touch._contacts(data, touch._listing.early)
        return found[found["a_kind"] == haptic.TOOL_LINK]

    def test_whatever_touches_and_however_many_geoms_a_body_has(self):
        cases = itertools.product(self.TOOLS.items(), self.BELOW.items(), ("", self.FAR))
        for (geom, below_origin), (name, below), more in cases:
            with self.subTest(tool=geom, below=name, more=more):
                gap = 0.98 * self.EPSILON
                found = self.contacts(f"<geom {geom}/>{more}", below, below_origin + gap)
                self.assertGreater(len(found), 0)
                np.testing.assert_allclose(found["separation"], gap, atol=1e-6)  # m
                np.testing.assert_allclose(found["normal"][:, 2], 1, atol=1e-4)
                far = self.contacts(f"<geom {geom}/>{more}", below, below_origin + 1.02 * self.EPSILON)
                self.assertEqual(len(far), 0)

    @unittest.skipIf(VERSION < (3, 12), "between boxes contacts were deep that were none")
    def test_two_boxes_in_any_pose_are_as_far_apart_as_they_are(self):
        """But for one in ten at most that is listed late, edge to edge."""
        seed = time.time_ns() % 100000
        print("seed", seed)
        random = np.random.default_rng(seed)
        box = '<freejoint/><geom type="box" size="0.01 0.02 0.03"/>'
        model, data = loaded(f"""<mujoco><worldbody><body name="tool">{box}</body><body pos="0 0 1">{box}</body></worldbody>
            </mujoco>""")
        late, poses = 0, 200
        with haptic.mujoco.Session(model, data, tool="tool", epsilon=self.EPSILON, contacts="engine", binding=mujoco,
                                   server="127.0.0.1:9") as touch:
            for _ in range(poses):
                distance = np.inf
                while not 0 < distance < 0.95 * self.EPSILON:
                    data.qpos[:] = random.normal(size=14)
                    data.qpos[:3] = 0
                    data.qpos[7:10] *= random.uniform(0.02, 0.07) / np.linalg.norm(data.qpos[7:10])
                    for turned in (data.qpos[3:7], data.qpos[10:14]):
                        turned /= np.linalg.norm(turned)
                    mujoco.mj_forward(model, data)
                    distance = box_gap(*((data.geom_xpos[i], np.reshape(data.geom_xmat[i], (3, 3)), model.geom_size[i])
                                         for i in (0, 1)))
                listed = touch._contacts(data, touch._listing.early)["separation"].min(initial=np.inf)
                self.assertGreater(listed, distance - 1e-5)  # m
                late += listed > distance + 1e-5
        self.assertLess(late, poses / 10)

    def test_a_mocap_body_is_a_wall(self):
        below = f'<body name="pad" mocap="true">{self.BOX}</body>'
        found = self.contacts('<geom size="0.02"/>', below, 0.021)
        self.assertEqual(found["b_kind"].tolist(), [haptic.WORLD])

    @unittest.skipIf(VERSION < (3, 0), "flexes are since 3.0")
    def test_a_cloth_is_nobody_else(self):
        """It is no geom and is not felt."""
        cloth = ('<flexcomp name="cloth" type="grid" count="5 5 1" spacing="0.02 0.02 0.02" dim="2" radius="0.001" '
                 'mass="0.05"><contact selfcollide="none"/><edge equality="true"/></flexcomp>')
        self.assertEqual(len(self.contacts('<geom size="0.02"/>', cloth, 0.02)), 0)

    def test_the_motion_of_bodies_is_the_same(self):
        """That of a falling block with a ball to it, to the last bit."""
        block = ('<body pos="0.2 0 0.06" euler="20 30 0"><freejoint/><geom type="box" size="0.02 0.03 0.01"/>'
                 '<geom size="0.02" pos="0.04 0 0"/></body>')
        scene = SCENE.format(step=0.002, height=0.5, tool='type="sphere" size="0.02"', bodies=block)
        model, data = loaded(scene)
        watched_model, watched = loaded(scene)
        with haptic.mujoco.Session(watched_model, watched, tool="tool", contacts="engine", binding=mujoco, server="127.0.0.1:9"):
            early = False
            for _ in range(300):
                mujoco.mj_step(model, data)
                mujoco.mj_step(watched_model, watched)
                early = early or watched.ncon > data.ncon
                np.testing.assert_array_equal(watched.qpos[7:], data.qpos[7:])
        self.assertTrue(early)


@unittest.skipIf(VERSION < (3, 4), "bodies sleep since 3.4")
class Sleep(unittest.TestCase):
    """MuJoCo's own: what has been at rest is no longer computed."""

    @staticmethod
    def scene(**parts):
        options = '<option timestep="0.001" sleep_tolerance="0.001"><flag sleep="enable"/></option>'
        return SCENE.format(step=0.001, height=0.03, tool='type="sphere" size="0.02"', **parts).replace(
            '<option timestep="0.001"/>', options)

    def test_a_table_bears_a_tool_that_rests_on_it(self):
        for contacts in ("engine", "shapes"):
            with self.subTest(contacts=contacts):
                ticks, seen = play(3, self.scene(bodies=""), hand_session.reach(0.5, 0, 0.015),
                                   lambda data: int(data.body_awake[1]), contacts=contacts)
                depth = (0.005 * hand_session.STIFFNESS + 0.1 * GRAVITY) / (hand_session.STIFFNESS + STIFFNESS)
                force, deviation = hand_session.mean(ticks, "command_force_z_N", 1.5, 2.9)
                self.assertAlmostEqual(force, hand_session.STIFFNESS * (0.005 - depth), delta=0.01)  # N
                self.assertLess(deviation, 0.01)
                self.assertEqual(min(seen), 1)

    def test_a_brick_that_sleeps_is_pushed_at_its_friction(self):
        hand = hand_session.reach(1.5, 0, 0.025) + hand_session.reach(2.8, 0.105, 0.025)
        for contacts in ("engine", "shapes"):
            with self.subTest(contacts=contacts):
                ticks, seen = play(4.6, self.scene(bodies=BRICK), hand,
                                   lambda data: (int(data.body_awake[2]), data.xipos[2][0]), contacts=contacts)
                self.assertEqual(seen[RATE][0], 0)  # It sleeps.
                due = 0.4 * 0.3 * GRAVITY
                force, _ = hand_session.mean(ticks, "command_force_x_N", 3.4, 4.2)
                self.assertGreater(-force, 0.75 * due)  # N
                self.assertLess(-force, 1.1 * due)
                self.assertGreater(seen[-1][1], 0.13)  # m


class Versions(unittest.TestCase):
    """What models of other versions are told. From 3.5 on margins and gaps of two geoms add up, before the larger counts;
    from 3.9 on a gap lies beyond the margin."""

    def session(self, version, option=""):
        text = f"""<mujoco>{option}<worldbody><geom type="plane" size="1 1 0.1" margin="0.001"/>
            <body name="tool" pos="0 0 0.1"><freejoint/><geom size="0.02" margin="0.002" gap="0.001"/></body>
            <body pos="0.2 0 0.1"><freejoint/><geom size="0.02"/></body></worldbody></mujoco>"""
        model, data = loaded(text)
        binding = types.SimpleNamespace(**{**vars(mujoco), "mj_versionString": lambda: version})
        touch = haptic.mujoco.Session(model, data, tool="tool", contacts="engine", binding=binding, server="127.0.0.1:9")
        self.addCleanup(touch.close)
        return touch, model

    def assert_margins_and_gaps(self, model, margins, gaps):
        np.testing.assert_allclose(model.geom_margin, margins, atol=1e-12)
        np.testing.assert_allclose(model.geom_gap, gaps, atol=1e-12)

    def test_the_gap_that_lies_within_the_margin(self):
        """Listed below the margin, with force below margin minus gap."""
        for version, early in (("2.2.2", 0.005), ("3.4.0", 0.005), ("3.5.0", 0.0025), ("3.8.1", 0.0025)):
            touch, model = self.session(version)
            margins = (0.001 + early, 0.002 + early, early)
            self.assert_margins_and_gaps(model, margins, (early, 0.001 + early, early))
            touch._listing.set_force(False)
            self.assert_margins_and_gaps(model, margins, (early, 1e3, early))

    def test_the_gap_that_lies_beyond_the_margin(self):
        """Listed below margin plus gap, with force below the margin."""
        for version in ("3.9.0", "3.16.0", "4.0.0"):
            touch, model = self.session(version)
            self.assert_margins_and_gaps(model, (0.001, 0.002, 0), (0.0025, 0.0035, 0.0025))
            touch._listing.set_force(False)
            self.assert_margins_and_gaps(model, (0.001, -1e3, 0), (0.0025, 1e3 + 0.0055, 0.0025))
            touch._listing.set_force(True)
            self.assert_margins_and_gaps(model, (0.001, 0.002, 0), (0.0025, 0.0035, 0.0025))


    def test_the_version_whose_accelerations_are_wrong_is_named(self):
        with self.assertWarnsRegex(UserWarning, "4.0.0 has wrong accelerations .* use 4.0.1 or 3.17.0"):
            self.session("4.0.0", '<option jacobian="sparse"/>')
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            self.session("4.0.1", '<option jacobian="sparse"/>')
            self.session("4.0.0", '<option jacobian="dense"/>')


class Mistakes(unittest.TestCase):
    def refused(self, text, **changes):
        model, data = loaded("<mujoco><worldbody><body name='arm'><joint/><geom size='0.1'/></body></worldbody></mujoco>")
        with self.assertRaises(haptic.HapticError) as caught:
            haptic.mujoco.Session(model, data, binding=mujoco, **changes)
        self.assertIn(text, str(caught.exception))

    def test_a_tool_that_is_not_there_is_named(self):
        self.refused("the model has no body 'peg'", tool="peg")

    def test_a_tool_that_cannot_move_freely_is_named(self):
        self.refused("body 'arm' must have a free joint", tool="arm")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
