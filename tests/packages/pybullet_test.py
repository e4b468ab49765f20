#!/usr/bin/python3
"""haptic.pybullet: a box presses, slides, pushes, lifts, enters a hole, and pushes what joints hold.

Usage: pybullet_test.py HAPTIC_SERVER LIBHAPTIC [TEST …]
"""

import pathlib
import re
import tempfile
import unittest

from given import last_line_of, main

import haptic_local_model as haptic
import haptic_local_model.pybullet
import haptic_local_model.shapes
import virtual_hand
import numpy as np
import pybullet
import pybullet_data
from hand_session import mean, on_time, reach
from placed_shapes import lowest
from scenes import GRAVITY, Box, play, scenes
from touch_tasks import TouchTasks

STEP = 1 / 480  # s


class World:
    def __init__(self, scene=None, step=STEP):
        self.client = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0, 0, -GRAVITY, physicsClientId=self.client)
        pybullet.setTimeStep(step, physicsClientId=self.client)
        if scene is not None:
            self.floor(scene.floor)
            self.tool = self.box(scene.tool)
            self.body = None if scene.body is None else self.box(scene.body)
            for wall in scene.walls:
                self.box(wall)

    def floor(self, friction=1):
        self.add(self.shape(pybullet.GEOM_PLANE), (0, 0, 0), 0, friction)

    def shape(self, kind, **options):
        return pybullet.createCollisionShape(kind, physicsClientId=self.client, **options)

    def add(self, shape, centre, mass=0.0, friction=0.7, **options):
        body = pybullet.createMultiBody(mass, shape, basePosition=centre, physicsClientId=self.client, **options)
        # PyBullet slows bodies by 4 % a second unless it is told otherwise, and does not tell.
        pybullet.changeDynamics(body, -1, lateralFriction=friction, linearDamping=0, angularDamping=0,
                                physicsClientId=self.client)
        return body

    def box(self, box):
        shape = self.shape(pybullet.GEOM_BOX, halfExtents=[edge / 2 for edge in box.size])
        return self.add(shape, box.centre, box.mass, box.friction)

    def place(self, body):
        return pybullet.getBasePositionAndOrientation(body, physicsClientId=self.client)[0]

    def play(self, server, seconds, rate, stall=0, body=None):
        """Returns where the body was."""
        with haptic.pybullet.Session(self.client, self.tool, period=1 / rate, gravity=(0, 0, 0)) as touch:
            def frame():
                for _ in range(touch.drive()):
                    touch.push()
                    pybullet.stepSimulation(physicsClientId=self.client)
                touch.send()
            return play(server, seconds, frame, body or (lambda: self.place(self.body) if self.body is not None else (0, 0, 0)),
                        stall)


def seesaw(rate):
    """A plank on a hinge; a cube on its right end, which lies on a post."""
    world = World(step=min(STEP, 1 / rate))
    plank = world.shape(pybullet.GEOM_BOX, halfExtents=(0.2, 0.03, 0.005))
    hinged = world.add(-1, (0, 0, 0.1), linkMasses=[0.4], linkCollisionShapeIndices=[plank], linkVisualShapeIndices=[-1],
                       linkPositions=[(0, 0, 0)], linkOrientations=[(0, 0, 0, 1)], linkInertialFramePositions=[(0, 0, 0)],
                       linkInertialFrameOrientations=[(0, 0, 0, 1)], linkParentIndices=[0],
                       linkJointTypes=[pybullet.JOINT_REVOLUTE], linkJointAxis=[(0, 1, 0)])
    # Every joint has a motor that holds it, unless it is told otherwise.
    pybullet.setJointMotorControl2(hinged, 0, pybullet.VELOCITY_CONTROL, force=0, physicsClientId=world.client)
    world.box(Box((0.02, 0.06, 0.09), (0.19, 0, 0.05)))
    world.tool = world.box(Box((0.01, 0.04, 0.03), (-0.15, 0, 0.13), 0.1, 0.5))
    world.body = world.box(Box((0.04, 0.04, 0.04), (0.15, 0, 0.125), 0.3))
    return world


class Touch(TouchTasks, unittest.TestCase):
    rates = (30, 60, 500)
    largest_jump_of_bodies = 0.3    # N
    largest_deviation_of_load = 0.03  # N

    @staticmethod
    def play(scene, seconds, hand, *options, rate=60, stall=0):
        world = World(scenes()[scene], min(STEP, 1 / rate))
        return virtual_hand.play(hand, options, lambda server: world.play(server, seconds, rate, stall))

    def test_one_end_of_a_seesaw_bears_what_lies_on_the_other(self):
        due = 0.3 * GRAVITY * 150 / 145  # N: the tool's inner edge is 145 mm from the hinge, the cube's centre 150
        for rate in self.rates:
            with self.subTest(rate=rate):
                ticks, track = on_time(
                    lambda rate: virtual_hand.play(reach(0.5, -0.15, 0.121) + reach(2, -0.15, 0.11), (),
                                                   lambda server: seesaw(rate).play(server, 4, rate)), rate=rate)
                force, deviation = mean(ticks, "env_force_z_N", 2.7, 3.3)
                self.tell(f"seesaw at {rate} Hz, N, deviation {deviation:.4f} N", force, due)
                self.assertAlmostEqual(force, due, delta=0.05 * due)
                self.assertLess(deviation, 0.05)
                self.assertGreater(track[-1][2], 0.126)  # m: the cube has been lifted


class Shapes(unittest.TestCase):
    def setUp(self):
        self.world = World()

    def session(self, tool):
        return self.enterContext(haptic.pybullet.Session(self.world.client, tool, server="127.0.0.1:9"))

    def test_every_kind_of_shape_is_where_it_is(self):
        """Each 2 mm above a plane."""
        corners = [(x, y, z) for x in (-0.01, 0.01) for y in (-0.02, 0.02) for z in (-0.03, 0.03)]
        for kind, options, height in ((pybullet.GEOM_SPHERE, {"radius": 0.02}, 0.02),
                                      (pybullet.GEOM_BOX, {"halfExtents": (0.01, 0.02, 0.03)}, 0.03),
                                      (pybullet.GEOM_CAPSULE, {"radius": 0.01, "height": 0.04}, 0.03),
                                      (pybullet.GEOM_CYLINDER, {"radius": 0.01, "height": 0.04}, 0.02),
                                      (pybullet.GEOM_MESH, {"vertices": corners}, 0.03)):
            with self.subTest(kind=kind):
                self.world = World()
                self.assertAlmostEqual(self.separation(self.world.shape(kind, **options), height + 0.002), 0.002, delta=1e-6)

    def test_each_object_of_a_file_is_a_convex_piece(self):
        """Two steps; the hull of both would be 3 mm higher between them."""
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "steps.obj"
            box = lambda at: [(x + at, y, z + at) for x in (0, 0.01) for y in (0, 0.01) for z in (0, 0.01)]
            faces = "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
            text = "".join("v %g %g %g\n" % corner for corner in box(0) + box(0.01)) + "o low\n" + faces + "o high\n"
            file.write_text(text + re.sub(r"\d+", lambda number: str(int(number.group()) + 8), faces))
            for concave, kinds in (("", ["hull", "hull"]), ('concave="yes"', ["mesh"])):
                with self.subTest(concave=concave):
                    self.world = World()
                    urdf = pathlib.Path(folder) / "steps.urdf"
                    urdf.write_text(f"""<robot name="steps"><link name="it"><collision {concave}><geometry>
                        <mesh filename="{file}" scale="2 2 2"/></geometry></collision></link></robot>""")
                    pybullet.loadURDF(str(urdf), useFixedBase=True, physicsClientId=self.world.client)
                    made = self.session(self.world.box(Box((0.01, 0.01, 0.01), (0, 0, 1), 0.1)))._placed
                    self.assertEqual([each.kind for each in made.shapes[:-1]], [haptic.shapes.KINDS[kind] for kind in kinds])
                    self.assertAlmostEqual(max(made.radii[:-1]), 0.06, delta=1e-9)  # m

    def test_a_mesh_without_a_file_that_is_not_convex_is_named(self):
        tent = self.world.shape(pybullet.GEOM_MESH, vertices=[(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
                                indices=[0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH)
        self.world.add(tent, (0, 0, 0))
        with self.assertRaisesRegex(haptic.HapticError, "body 0, link -1: of a mesh that is not one convex piece"):
            self.session(self.world.box(Box((0.1, 0.1, 0.1), (0, 0, 2), 1)))

    def test_a_shape_that_pybullet_does_not_tell_is_named(self):
        tool = self.world.box(Box((0.1, 0.1, 0.1), (0, 0, 2), 1))
        hills = self.world.add(self.world.shape(pybullet.GEOM_HEIGHTFIELD, meshScale=[0.1, 0.1, 1], heightfieldData=[0.0] * 16,
                                                numHeightfieldRows=4, numHeightfieldColumns=4), (0, 0, 0))
        self.world.add(-1, (0, 0, 0))  # It has none.
        with self.assertWarnsRegex(UserWarning, f"body {hills}, link -1 is not felt") as caught:
            self.session(tool)
        self.assertEqual(len([each for each in caught.warnings if "is not felt" in str(each.message)]), 1)

    def test_a_tool_that_does_not_move_is_named(self):
        with self.assertRaisesRegex(haptic.HapticError, "body 0 has the mass 0.0 kg and 0 joints; the tool must have mass"):
            self.session(self.world.box(Box((0.1, 0.1, 0.1), (0, 0, 2))))

    def separation(self, shape, height):
        """The lowest point of the tool's shapes over the floor, m."""
        self.world.floor()
        session = self.session(self.world.add(shape, (0.1, 0.2, height), 0.1))
        placed, q = session._placed, session._q
        return min(lowest(shape, at + q[:3], haptic.pybullet.rotation(turn)) for shape, carrier, at, turn in
                   zip(placed.shapes, placed.carriers, placed.positions, placed.rotations) if carrier)


class Joints(unittest.TestCase):
    def test_mass_and_weight_of_an_arm_are_those_of_pybullet(self):
        world = World()
        arm = pybullet.loadURDF(pybullet_data.getDataPath() + "/kuka_iiwa/model.urdf", basePosition=(0.1, 0, 0),
                                useFixedBase=True, physicsClientId=world.client)
        angles = [0.3, -0.5, 0.7, 0.9, -0.2, 0.4, 1.1]
        for joint, angle in enumerate(angles):
            pybullet.resetJointState(arm, joint, angle, 0.1 * joint, physicsClientId=world.client)
        session = self.enterContext(haptic.pybullet.Session(
            world.client, world.box(Box((0.1,) * 3, (2, 0, 0), 1)), server="127.0.0.1:9"))
        tree = session._tree_now(arm)
        M = np.array(pybullet.calculateMassMatrix(arm, angles, physicsClientId=world.client))
        D = np.diag([session._frames.delay() * pybullet.getJointInfo(arm, joint, physicsClientId=world.client)[6]
                     for joint in range(7)])
        weight = -np.array(pybullet.calculateInverseDynamics(arm, angles, [0] * 7, [0] * 7, physicsClientId=world.client))
        np.testing.assert_allclose(np.linalg.inv(tree._inverse), M + D, atol=1e-6)
        np.testing.assert_allclose(tree._acceleration, np.linalg.solve(M + D, weight), rtol=1e-4)
        for link in range(7):
            felt = pybullet.getLinkState(arm, link, 1, 1, physicsClientId=world.client)
            np.testing.assert_allclose(tree.velocity(link + 1, [0.1 * joint for joint in range(7)]), felt[6] + felt[7],
                                       atol=1e-6)


class Example(unittest.TestCase):
    def test_it_presses_and_pushes(self):
        self.assertRegex(last_line_of("pybullet/touch.py"), r" N, brick at 0\.1\d\d m$")


if __name__ == "__main__":
    main()
