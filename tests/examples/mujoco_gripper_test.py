#!/usr/bin/python3
"""haptic.mujoco with a gripper in the hand: how its jaws are found, what they hold and bear, and the arm that follows.

Usage: mujoco_gripper_test.py LIBHAPTIC PACKAGE_FOLDER [TEST …], as mujoco_python_test.py
"""

import itertools
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import mujoco_python_test as session  # noqa: E402  (finds the library and the package)
import haptic_local_model as haptic  # noqa: E402
import mujoco  # noqa: E402
import numpy as np  # noqa: E402
import virtual_hand  # noqa: E402
from haptic_local_model._mujoco_sweep import actuators_of, sweep  # noqa: E402
from haptic_local_model._world import rotation  # noqa: E402

G = 9.81  # m/s²
# Two slides with a servo each: robosuite's Panda in its shape.
SLIDES = """
  <body name="left"><joint name="left" type="slide" axis="0 1 0" range="0 0.04" {joint}/>
    <geom type="box" size=".01 .005 .025" pos="0 .005 -.1" mass=".02" friction="{friction}"/></body>
  <body name="right"><joint name="right" type="slide" axis="0 -1 0" range="0 0.04" {joint}/>
    <geom type="box" size=".01 .005 .025" pos="0 -.005 -.1" mass=".02" friction="{friction}"/></body>"""
SERVOS = """<actuator><position name="left" joint="left" kp="1000" ctrlrange="0 .04" forcerange="-20 20"/>
  <position name="right" joint="right" kp="1000" ctrlrange="0 .04" forcerange="-20 20"/></actuator>"""
# One slide that an equality follows: the menagerie's Panda in its shape.
COUPLED = """<equality><joint joint1="left" joint2="right" solref="0.005 1"/></equality>
  <tendon><fixed name="split"><joint joint="left" coef="0.5"/><joint joint="right" coef="0.5"/></fixed></tendon>
  <actuator><general name="split" tendon="split" ctrlrange="0 255" forcerange="-100 100" biastype="affine" gainprm="0.0157 0 0"
    biasprm="0 -100 -10"/></actuator>"""
# A crank and a rocker that a `connect` closes, twice: the 2F-85 in its shape.
LINKAGE = "".join(f"""
  <body name="{name}_crank" pos="0 {side * 0.03} -.05" quat="{quat}"><joint name="{name}" axis="-1 0 0" range="0 0.8" armature="0.005" damping="0.1"/>
    <geom type="capsule" fromto="0 0 0 0 .0315 -.0041" size=".004" mass=".01" contype="0" conaffinity="0"/>
    <body name="{name}_coupler" pos="0 .0315 -.0041"><joint axis="-1 0 0"/>
      <geom type="capsule" fromto="0 0 0 0 .008 -.03" size=".004" mass=".01" contype="0" conaffinity="0"/></body></body>
  <body name="{name}_rocker" pos="0 {side * 0.0125} -.061" quat="{quat}"><joint axis="-1 0 0"/>
    <geom type="capsule" fromto="0 0 0 0 .027 -.033" size=".004" mass=".02" contype="0" conaffinity="0"/>
    <body name="{name}_tip" pos="0 .0305 -.0335"><joint axis="-1 0 0" stiffness="0.05" springref="0"/>
      <geom type="box" size=".01 .004 .02" pos="0 -.012 -.03" mass=".01" friction="1"/></body></body>"""
                  for name, side, quat in (("left", 1, "1 0 0 0"), ("right", -1, "0 0 0 1")))
LINKAGE_ENDS = """<equality>
  <connect body1="left_coupler" body2="left_tip" anchor="0 .0045 -.0305" solref="0.005 1"/>
  <connect body1="right_coupler" body2="right_tip" anchor="0 .0045 -.0305" solref="0.005 1"/>
  <joint joint1="left" joint2="right" solref="0.005 1"/></equality>
  <tendon><fixed name="split"><joint joint="left" coef="0.5"/><joint joint="right" coef="0.5"/></fixed></tendon>
  <actuator><general name="split" tendon="split" ctrlrange="0 255" forcerange="-5 5" biastype="affine" gainprm="0.3137255 0 0"
    biasprm="0 -100 -10"/></actuator>"""
# One jaw on a hinge beside a fixed one: SO-101 in its shape.
HINGE = """
  <geom name="fixed" type="box" size=".01 .003 .04" pos="0 -.012 -.08" friction="1"/>
  <body name="jaw" pos="0 .015 -.03"><joint name="jaw" axis="1 0 0" range="-.1 1.7" armature=".028" damping=".6" frictionloss=".05"/>
    <geom type="box" size=".01 .003 .04" pos="0 -.012 -.05" mass=".03" friction="1"/></body>"""
HINGE_ENDS = '<actuator><position name="jaw" joint="jaw" kp="17.8" ctrlrange="-.1 1.7" forcerange="-3.35 3.35"/></actuator>'
FREE = "<freejoint/>"
SCENE = """<mujoco><compiler autolimits="true" angle="radian"/><option timestep="{step}"/>
 <worldbody>
  <geom name="floor" type="plane" size="2 2 .1" friction="{friction}"/>
  <body name="cube" pos="0 0 .02"><freejoint/><geom name="cube" type="box" size=".02 .02 .02" mass=".3" friction="{friction}"/></body>
  {extra}{before}<body name="hand" pos="{place}">{root}
   <geom name="palm" type="box" size=".03 .08 .02" pos="0 0 .02" mass=".1"/>{jaws}</body>{after}
 </worldbody>{ends}</mujoco>"""
# Four hinges and two more with servos or motors, above the table.
ARM = """<body name="base" pos="-.5 0 .55"><joint name="a1" axis="0 0 1" range="-3 3" {joint}/><geom type="capsule" size=".03 .05" mass="2"/>
 <body name="upper" pos="0 0 .1"><joint name="a2" axis="0 1 0" range="-2 2" {joint}/><geom type="capsule" fromto="0 0 0 .25 0 0" size=".03" mass="1.5"/>
 <body name="fore" pos=".25 0 0"><joint name="a3" axis="0 1 0" range="-2.5 2.5" {joint}/><geom type="capsule" fromto="0 0 0 .25 0 -.1" size=".03" mass="1"/>
 <body name="wrist" pos=".25 0 -.1"><joint name="a4" axis="0 1 0" range="-2.5 2.5" {joint}/><geom type="sphere" size=".03" mass=".3"/>
 <body name="wrist2"><joint name="a5" axis="1 0 0" range="-2.5 2.5" {joint}/><geom type="sphere" size=".03" mass=".3"/>
 <body name="wrist3"><joint name="a6" axis="0 0 1" range="-2.5 2.5" {joint}/><geom type="sphere" size=".02" mass=".3"/>"""
# Seven hinges with the lengths and limits of a Franka Emika Robot (its manual): position, turn about x in quarters, range.
SEVEN = "".join(f'<body pos="{p}" quat="1 {turn} 0 0"><joint name="a{i}" range="{limits}"/><geom type="sphere" size=".03" mass="1"/>'
                for i, (p, turn, limits) in enumerate((
                    ("-.5 0 .333", 0, "-2.9 2.9"), ("0 0 0", -1, "-1.76 1.76"), ("0 -.316 0", 1, "-2.9 2.9"), (".0825 0 0", 1, "-3.07 -.07"),
                    ("-.0825 .384 0", -1, "-2.9 2.9"), ("0 0 0", 1, "-.017 3.75"), (".088 0 0", 1, "-2.9 2.9")), 1))
BELOW = "0 0 .14"


def scene(jaws=SLIDES, ends=SERVOS, root=FREE, before="", after="", place=BELOW, step=0.002, friction=1.0, joint="", extra=""):
    text = SCENE.format(jaws=jaws.format(joint=joint, friction=friction) if jaws is SLIDES else jaws, ends=ends, root=root, before=before,
                        after=after, place=place, step=step, friction=friction, extra=extra)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    for name in ("left", "right"):
        if jaws is SLIDES:
            data.qpos[model.jnt_qposadr[mujoco.mj_name2id(model, 3, name)]] = 0.035
    mujoco.mj_forward(model, data)
    return model, data


def hand(path, seconds):
    """A hand that takes its target along (t, x, y, z), m and s, and stays."""
    return "".join(f"[[segment]]\nduration = {t}\nmove_to = {{ position = [{x}, {y}, {z}], rotation = [0, 0, 0] }}\n"
                   for t, x, y, z in path) + f"[[segment]]\nduration = {seconds}\nmove_to = {{ position = [{x_of(path)}], rotation = [0, 0, 0] }}\n"


def x_of(path):
    return ", ".join(str(each) for each in path[-1][1:])


class Played:
    """A session with a scripted hand: its ticks, and what each frame found."""

    def __init__(self, model, data, script, jaws, seconds, rate=60, each=None, options=(), gripper="hand", **network):
        self.frames = []
        with virtual_hand.server(script, *options, **network) as server:
            with haptic.mujoco.Session(model, data, gripper=gripper, binding=mujoco, period=1 / rate) as touch:
                while server.now < seconds:
                    for _ in range(touch.drive(data)):
                        mujoco.mj_step(model, data)
                    touch.move_jaws(jaws(server.now))
                    touch.send(data)
                    cube = np.array(data.xpos[mujoco.mj_name2id(model, 1, "cube")])
                    self.frames.append((server.now, touch.opening, touch.grip, *cube, *touch.touch.q[:3], touch.follow_error))
                    if each:
                        each(server.now, touch, model, data)
                self.message = touch.touch.message
                self.held = touch.touch.holds
            self.ticks = virtual_hand.active(server)

    def at(self, t, column):
        return next(frame[column] for frame in self.frames if frame[0] >= t)

    def force(self, begin, end, axis="z"):
        """On the hand by contacts, between two times of the session, s."""
        ticks = self.ticks
        chosen = (ticks["time_s"] >= begin) & (ticks["time_s"] < end)
        return ticks[f"env_force_{axis}_N"][chosen]


OPENING, GRIP, CUBE, PALM, ERROR = 1, 2, slice(3, 6), slice(6, 9), 9


def closes_at(t):
    return lambda now: 1.0 if now < t else 0.0


class Swept(unittest.TestCase):
    SHAPES = {"slides": (SLIDES, SERVOS), "coupled": (SLIDES, COUPLED), "linkage": (LINKAGE, LINKAGE_ENDS), "hinge": (HINGE, HINGE_ENDS)}

    def test_fingers_go_along_their_curves_within_0_3_mm_and_half_a_degree(self):
        for name, (jaws, ends) in self.SHAPES.items():
            with self.subTest(name):
                model, data = scene(jaws, ends, joint='damping="10"')
                for actuator in actuators_of(mujoco, model, data, mujoco.mj_name2id(model, 1, "hand")):
                    swept = sweep(mujoco, model, data, mujoco.mj_name2id(model, 1, "hand"), actuator)
                    self.assertLess(swept.error[0], 3e-4)  # m
                    self.assertLess(np.degrees(swept.error[1]), 0.5)

    def test_springs_and_dampers_leave_it_the_whole_way(self):
        for joint in ('stiffness="5000"', 'stiffness="5000" springref="0.04"', 'damping="10000"', 'damping="10" frictionloss="20"', 'margin="0.01"'):
            with self.subTest(joint):
                model, data = scene(joint=joint)
                swept = sweep(mujoco, model, data, mujoco.mj_name2id(model, 1, "hand"), 0)
                self.assertAlmostEqual(swept.s[0], 0, delta=1e-4)  # m
                self.assertAlmostEqual(swept.s[-1], 0.04, delta=1e-4)

    def test_the_model_is_as_it_was(self):
        model, data = scene(LINKAGE, LINKAGE_ENDS)
        before = [np.asarray(each).tobytes() for each in (data.qpos, data.qvel, model.dof_armature, model.actuator_gainprm)]
        sweep(mujoco, model, data, mujoco.mj_name2id(model, 1, "hand"), 0)
        self.assertEqual(before, [np.asarray(each).tobytes() for each in (data.qpos, data.qvel, model.dof_armature, model.actuator_gainprm)])

    def test_which_end_is_closed(self):
        lower = {"slides": True, "coupled": True, "linkage": False, "hinge": True}
        for name, (jaws, ends) in self.SHAPES.items():
            with self.subTest(name):
                with haptic.mujoco.Session(*scene(jaws, ends), gripper="hand", binding=mujoco, server="127.0.0.1:9") as touch:
                    for jaw in touch._tool.jaws:
                        self.assertEqual(jaw.closed < jaw.open, lower[name])


class Held(unittest.TestCase):
    WEIGHT = (0.3 + 0.14) * G  # N: cube, palm and jaws

    def lift(self, **options):
        model, data = scene()
        script = hand([(1.0, 0, 0, .14), (1.0, 0, 0, .14), (1.0, 0, 0, .2)], 3)
        return Played(model, data, script, closes_at(1), 4.5, **options)

    def test_what_is_lifted_weighs_what_it_weighs_at_any_rate_delay_and_stiffness(self):
        for rate, delay, stiffness in itertools.product((30, 60, 500), (0, 0.02, 0.1), (4000, 256000)):
            with self.subTest(rate=rate, delay=delay, stiffness=stiffness):
                played = self.lift(rate=rate, delay=delay, options=("--stiffness", str(stiffness), "--keep-stiffness"))
                force = played.force(4.2, 4.5)
                self.assertAlmostEqual(-force.mean() / self.WEIGHT, 1, delta=1e-3)
                self.assertLess(np.abs(np.diff(played.force(1.5, 4.5))).max(), 0.3)  # N
                self.assertGreater(played.at(4.4, CUBE)[2], 0.06)  # m
                self.assertEqual(played.message, "")

    def test_the_grip_is_what_the_servos_press_with(self):
        played = self.lift()
        # Each spring of 1000 N/m is 20 mm and what the contact gives way from its target, and at most 20 N.
        due = sum(1000 * (0.04 * played.at(1.9, OPENING)) for _ in range(2))
        self.assertAlmostEqual(played.at(1.9, GRIP) / due, 1, delta=0.05)
        self.assertGreater(played.at(1.9, GRIP), 30)

    def test_the_jaws_own_springs_press_along(self):
        model, data = scene(joint='damping="10" stiffness="500" springref="0.04"')
        played = Played(model, data, hand([(1.0, 0, 0, .14)], 3), closes_at(1), 2.5)
        s = 0.04 * played.at(2.4, OPENING)  # m
        self.assertAlmostEqual(played.at(2.4, GRIP) / (2 * (1000 * s - 500 * (0.04 - s))), 1, delta=0.05)

    def test_jaws_wait_until_the_server_knows_what_is_between_them(self):
        model, data = scene()
        for name in ("left", "right"):
            data.qpos[model.jnt_qposadr[mujoco.mj_name2id(model, 3, name)]] = 0.022
        played = Played(model, data, hand([(1.0, 0, 0, .14)], 1), lambda t: 0.0, 1.5)
        self.assertGreater(played.at(1.4, OPENING), 0.4)
        self.assertGreater(played.at(1.4, GRIP), 30)  # N

    def test_a_servo_that_becomes_weak_or_is_switched_off_lets_it_fall(self):
        def becomes_weak(now, touch, model, data):
            if now > 4:
                model.actuator_forcerange[:] = (-1, 1)

        def is_off(now, touch, model, data):
            if now > 4:
                model.actuator_gainprm[:] = model.actuator_biasprm[:] = 0

        for each in (becomes_weak, is_off):
            self.assertLess(self.lift(each=each).at(4.4, CUBE)[2], 0.04)  # m

    def test_its_weight_is_that_of_the_model_as_it_is(self):
        def each(now, touch, model, data):
            if now > 1:
                model.opt.gravity[2] = -G / 2

        played = Played(*scene(place="0 0 .3"), hand([(0.5, 0, 0, .3), (1, 0, 0, .35), (1, 0, 0, .3)], 3), lambda t: 1.0, 4, each=each)
        self.assertAlmostEqual(-played.force(0.4, 0.5).mean(), 0.14 * G, delta=0.01)  # N
        self.assertAlmostEqual(-played.force(3.5, 4).mean(), 0.14 * G / 2, delta=0.01)

    def test_the_jaws_of_mujoco_are_where_those_of_the_hand_are(self):
        for ends in (SERVOS, COUPLED):
            off = []

            def each(now, touch, model, data, off=off):
                left = data.qpos[model.jnt_qposadr[mujoco.mj_name2id(model, 3, "left")]]
                off.append(abs(left - touch.touch.q[7]) * (now > 0.5))

            model, data = scene(ends=ends, joint='damping="10"')
            Played(model, data, hand([(1, 0, 0, .16)], 3), lambda t: 1.0 if t < 1.5 else 0.5, 3, each=each)
            self.assertLess(np.sort(off)[int(0.95 * len(off))], 5e-4)  # m: but in the frames in which they move

    def test_carried_at_half_a_metre_a_second_it_stays_in_the_jaws(self):
        for axis in range(3):
            with self.subTest(axis=axis):
                model, data = scene()
                places = [[0, 0, .2], [0, 0, .2]]
                places[1][axis] += 0.25
                script = hand([(1, 0, 0, .14), (1, 0, 0, .14), (1, *places[0]), (0.5, *places[1]), (0.5, *places[0])], 2)
                played = Played(model, data, script, closes_at(1), 5.5, delay=0.05)
                before, after = (played.at(t, CUBE) for t in (2.9, 5.4))
                at_palm = [np.array(c) - np.array(played.at(t, PALM)) for t, c in ((2.9, before), (5.4, after))]
                self.assertLess(np.abs(at_palm[1] - at_palm[0]).max(), 1e-3)  # m
                self.assertAlmostEqual(-played.force(5.2, 5.5).mean() / self.WEIGHT, 1, delta=1e-3)

    def test_it_falls_where_the_jaws_open(self):
        model, data = scene()
        script = hand([(1, 0, 0, .14), (1, 0, 0, .14), (1, 0, 0, .2)], 3)
        played = Played(model, data, script, lambda t: 1.0 if t < 1 or t > 3.5 else 0.0, 5)
        self.assertLess(played.at(4.9, CUBE)[2], 0.0205)
        self.assertAlmostEqual(-played.force(4.8, 5).mean() / (0.14 * G), 1, delta=1e-3)

    def test_it_slips_where_friction_bears_less_than_its_weight(self):
        # Both jaws press with N each; friction bears 2 mu N.
        pressed = 2 * 1000 * 0.0175  # N, the sum over both jaws, about
        for share in (0.95, 1.05):
            with self.subTest(share=share):
                mu = 0.3 * G / pressed * share
                model, data = scene(friction=mu)
                script = hand([(1, 0, 0, .14), (1, 0, 0, .14), (1, 0, 0, .2)], 3)
                played = Played(model, data, script, closes_at(1), 4.5)
                true = 2 * mu * played.at(1.9, GRIP) / 2 / (0.3 * G)
                slipped = played.at(4.4, CUBE)[2] < 0.05
                self.assertEqual(slipped, true < 1, f"friction bears {true:.3f} of the weight")
                self.assertLess(abs(true - share), 0.15)

    def test_pressed_on_a_wall_the_held_cube_bears_the_hand(self):
        model, data = scene(extra='<geom name="wall" type="box" size=".02 .2 .3" pos=".16 0 .3"/>')
        script = hand([(1, 0, 0, .14), (1, 0, 0, .14), (1, 0, 0, .25), (1, .12, 0, .25)], 3)
        for delay in (0, 0.1):
            with self.subTest(delay=delay):
                played = Played(model, data, script, closes_at(1), 6, delay=delay)
                force = played.force(5.7, 6, "x")
                # The hand's spring of 400 N/m: what its target is behind the palm.
                due = -400 * (0.12 - played.at(5.8, PALM)[0])
                self.assertLess(due, -1)  # N
                self.assertAlmostEqual(force.mean() / due, 1, delta=2e-3)
                self.assertLess(force.std(), 0.01)


class Examples(unittest.TestCase):
    FOLDER = pathlib.Path(__file__).resolve().parents[2] / "examples/mujoco_gripper"

    def test_each_lifts_its_cube(self):
        for name, delay in itertools.product(("linkage", "hinge", "weld"), (0, 0.05)):
            with self.subTest(name, delay=delay), haptic.virtual.Server(delay=delay) as server:
                model = mujoco.MjModel.from_xml_path(str(self.FOLDER / f"{name}.xml"))
                data = mujoco.MjData(model)
                mujoco.mj_resetDataKeyframe(model, data, 0)
                mujoco.mj_forward(model, data)
                ids = {each: mujoco.mj_name2id(model, kind, each) for each, kind in (("palm", 1), ("cube", 1), ("pinch", 6))}
                begin, turn = np.array(data.xpos[ids["palm"]]), np.array(data.xquat[ids["palm"]])
                around = begin + data.xpos[ids["cube"]] - data.site_xpos[ids["pinch"]]
                with haptic.mujoco.Session(model, data, gripper="palm", binding=mujoco) as touch:
                    while server.now < 6:
                        t = server.now
                        up = 0.06 * np.clip((t - 3) / 2, 0, 1)
                        touch.hold(begin + np.clip(t / 2, 0, 1) * (around - begin) + (0, 0, up), turn)
                        touch.move_jaws(1.0 if t < 2 else 0.0)
                        for _ in range(touch.drive(data)):
                            mujoco.mj_step(model, data)
                        touch.send(data)
                        error = touch.follow_error
                self.assertAlmostEqual(-server.ticks["env_force_z_N"][-200:].mean() / (model.body_mass[ids["cube"]] * G), 1, delta=1e-3)
                self.assertGreater(data.xpos[ids["cube"]][2], 0.04)
                self.assertLess(error, 2e-3)


class Followed(unittest.TestCase):
    def play(self, joint, ends, arm=ARM, out=(0, .05, 0), **options):
        place = "0 0 -.08"
        model, data = scene(root="", before=arm.format(joint=joint), after="</body>" * 6, place=place, ends=ends + SERVOS)
        data.qpos[model.jnt_qposadr[mujoco.mj_name2id(model, 3, "a3")]] = 0.9
        data.qpos[model.jnt_qposadr[mujoco.mj_name2id(model, 3, "a4")]] = -0.9
        mujoco.mj_forward(model, data)
        begin = np.array(data.xpos[mujoco.mj_name2id(model, 1, "hand")])
        script = hand([(0.5, *begin), (1.0, *(begin + out)), (1.0, *begin)], 2)
        return Played(model, data, script, lambda t: 1.0, 3.5, **options)

    SERVOS = '<actuator>' + "".join(f'<position joint="a{i}" kp="2000"/>' for i in range(1, 7)) + "</actuator>"
    MOTORS = '<actuator>' + "".join(f'<motor joint="a{i}"/>' for i in range(1, 7)) + "</actuator>"

    def check(self, played, most):
        self.assertLess(max(frame[ERROR] for frame in played.frames if frame[0] > 0.5), most)  # m
        at_rest, moving = played.force(0.3, 0.5), played.force(0.6, 2.4)
        for axis in "xyz":
            self.assertLess(np.abs(played.force(0.3, 0.5, axis)).max(), 0.05)  # N
            self.assertLess(np.abs(played.force(0.6, 2.4, axis)).max(), 0.3)  # N, at 50 mm/s
        self.assertTrue(len(at_rest) and len(moving))

    def test_an_arm_of_servos_follows_and_is_not_felt(self):
        self.check(self.play('damping="100" armature="0.1"', self.SERVOS), 3e-3)

    def test_an_arm_of_motors_follows_and_is_not_felt(self):
        self.check(self.play('damping="0.5" armature="0.05"', self.MOTORS), 8e-3)

    def test_velocity_servos_and_motors_that_bear_the_weight_themselves_follow(self):
        self.check(self.play('damping="5" armature="0.1"', self.MOTORS.replace("motor", "velocity").replace("/>", ' kv="100"/>')), 8e-3)
        if not hasattr(mujoco.MjModel, "jnt_actgravcomp"):
            return
        bears = ARM.replace("<body ", '<body gravcomp="1" ')
        self.check(self.play('damping="0.5" armature="0.05" actuatorgravcomp="true"', self.MOTORS, bears), 8e-3)

    def test_it_comes_back_from_beyond_its_reach_and_does_not_whip(self):
        speeds = []
        for out in ((.8, 0, 0), (0, 0, .8), (.5, .5, .2)):
            played = self.play('damping="100" armature="0.1"', self.SERVOS, out=out,
                               each=lambda now, touch, model, data: speeds.append(np.abs(data.qvel).max()))
            self.assertGreater(max(frame[ERROR] for frame in played.frames), 0.1)  # m
            self.assertLess(played.at(3.4, ERROR), 3e-3)
        self.assertLess(max(speeds), 12)  # rad/s

    def test_joints_at_their_limits_leave_the_rest_to_the_others(self):
        for out in (.4, .6):
            model, data = scene(root="", before=SEVEN, after="</body>" * 7, place="0 0 .1")
            for i, q in enumerate((0, 0, 0, -1.57, 0, 1.57, -.785), 1):
                data.qpos[model.jnt_qposadr[mujoco.mj_name2id(model, 3, f"a{i}")]] = q
            mujoco.mj_forward(model, data)
            begin = np.array(data.xpos[mujoco.mj_name2id(model, 1, "hand")])
            up, far = begin + (0, 0, .2), begin + (out, 0, .2)
            script = hand([(1, *up), (4 * out, *far), (1, *far), (4 * out, *up), (1, *begin)], 1)
            self.assertLess(Played(model, data, script, lambda t: 1.0, 3.9 + 8 * out).frames[-1][ERROR], 3e-3)  # m

    def test_with_five_joints_the_place_counts_more_than_the_turn(self):
        arm = ARM.replace('<body name="wrist3"><joint name="a6" axis="0 0 1" range="-2.5 2.5" {joint}/>', '<body name="wrist3">')
        ends = self.SERVOS.replace('<position joint="a6" kp="2000"/>', "")
        played = self.play('damping="100" armature="0.1"', ends, arm, (0, 0.02, 0))
        self.assertLess(max(frame[ERROR] for frame in played.frames if frame[0] > 0.5), 3e-3)

    def test_an_arm_without_motors_is_put_in_its_place(self):
        self.check(self.play("", ""), 2e-3)

    def test_a_palm_that_is_welded_to_a_mocap_body_follows_it(self):
        extra = '<body name="mocap" mocap="true" pos="0 .1 .2"/>'
        weld = '<equality><weld body1="mocap" body2="hand" relpose="0 0 0 1 0 0 0" solref="0.01 1"/></equality>'
        model, data = scene(root="", before=extra + ARM.format(joint='damping="5"'), after="</body>" * 6, place="0 0 -.08", ends=weld + SERVOS)
        data.qpos[model.jnt_qposadr[mujoco.mj_name2id(model, 3, "a3")]] = 0.9
        data.qpos[model.jnt_qposadr[mujoco.mj_name2id(model, 3, "a4")]] = -0.9
        mujoco.mj_forward(model, data)
        begin = np.array(data.xpos[mujoco.mj_name2id(model, 1, "hand")])
        played = Played(model, data, hand([(0.5, *begin), (1, *(begin + (0, .05, 0)))], 2), lambda t: 1.0, 3)
        self.assertLess(max(frame[ERROR] for frame in played.frames if frame[0] > 0.5), 0.01)
        self.assertEqual(played.message, "")


class Wrong(unittest.TestCase):
    def refused(self, words, model, data, **options):
        with self.assertRaisesRegex(haptic.HapticError, words) as caught:
            haptic.mujoco.Session(model, data, binding=mujoco, server="127.0.0.1:9", **options)
        self.assertNotIn("\n", str(caught.exception))

    def test_each_is_one_line(self):
        model, data = scene()
        self.refused("gripper True must be the name of a body", model, data, gripper=True)
        self.refused("no body 'hnad'", model, data, gripper="hnad")
        self.refused("either a tool or a gripper", model, data)
        self.refused("either a tool or a gripper", model, data, tool="cube", gripper="hand")
        self.refused("'cube' must be the palm of a gripper: no actuator", model, data, gripper="cube")
        self.refused("no actuator 'mid'", model, data, gripper="hand", jaws=["mid"])
        self.refused("must move what hangs on 'left'", model, data, gripper="left", jaws=["right"])
        for jaws in ("left", None, 0, {"left"}):
            self.refused("jaws .* must be a list of actuators", model, data, gripper="hand", jaws=jaws)
        self.refused("must be different actuators", model, data, gripper="hand", jaws=["left", 0])
        self.refused("jaw True must be the name", model, data, gripper="hand", jaws=[True])
        by_velocity = SERVOS.replace("<position", '<intvelocity actrange="0 .04"')
        self.refused("'left' must be a motor or a position servo", *scene(ends=by_velocity), gripper="hand")
        muscles = Followed.MOTORS.replace("<motor", '<muscle lengthrange="-3 3"')
        jointed = ARM.format(joint="")
        self.refused("of the arm must be a motor", *scene(root="", before=jointed, after="</body>" * 6, ends=muscles + SERVOS), gripper="hand")
        two = HINGE.replace("</body>", """<body name="tip" pos="0 0 -.09"><joint name="tip" axis="1 0 0" range="-1 1"/>
            <geom type="box" size=".01 .003 .01" pos="0 0 -.02" mass=".01"/></body></body>""")
        ends = HINGE_ENDS.replace("</actuator>", '<position name="tip" joint="tip" kp="1" ctrlrange="-1 1" forcerange="-1 1"/></actuator>')
        self.refused("must not move one body, each on its own", *scene(two, ends), gripper="hand", jaws=["jaw", "tip"])
        self.refused("must be on something that moves", *scene(root=""), gripper="hand")
        endless = SERVOS.replace('ctrlrange="0 .04"', "")
        jaws = SLIDES.replace('range="0 0.04"', "")
        self.refused("'left' must have a range", *scene(jaws.format(joint="", friction=1), endless), gripper="hand")
        stuck = SLIDES.replace('range="0 0.04"', 'range="0.02 0.02001"')
        self.refused("'left' must move a jaw: its range is 0.02 to 0.02001", *scene(stuck.format(joint="", friction=1)), gripper="hand")
        with haptic.mujoco.Session(*scene(), gripper="hand", binding=mujoco, server="127.0.0.1:9") as touch:
            with self.assertRaisesRegex(haptic.HapticError, "opening"):
                touch.move_jaws(1.5)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
