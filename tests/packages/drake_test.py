#!/usr/bin/python3
"""haptic.drake: a box presses, slides, pushes, lifts and enters a hole.

Usage: drake_test.py HAPTIC_SERVER LIBHAPTIC [TEST …]
"""

import unittest

from given import last_line_of, main

import haptic_local_model as haptic
import haptic_local_model.drake
import virtual_hand
from pydrake.geometry import AddCompliantHydroelasticProperties, AddContactMaterial, AddRigidHydroelasticProperties
from pydrake.geometry import Box as DrakeBox
from pydrake.geometry import HalfSpace, ProximityProperties
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from scenes import play, scenes
from touch_tasks import TouchTasks

STEP = 1 / 480  # s


class World:
    def __init__(self, scene, step=STEP):
        builder = DiagramBuilder()
        self.plant, self.scene_graph = AddMultibodyPlantSceneGraph(builder, step)
        material = self.material(scene.floor)
        AddRigidHydroelasticProperties(material)
        self.plant.RegisterCollisionGeometry(self.plant.world_body(), RigidTransform(), HalfSpace(), "floor", material)
        self.box("tool", scene.tool)
        self.body = None if scene.body is None else self.box("body", scene.body)
        for number, wall in enumerate(scene.walls):
            self.box(f"wall {number}", wall)
        self.plant.Finalize()
        self.simulator = Simulator(builder.Build())

    @staticmethod
    def material(friction):
        """One point of contact, as without hydroelastic surfaces, does not bear a box."""
        made = ProximityProperties()
        AddContactMaterial(dissipation=1.0, friction=CoulombFriction(friction, friction), properties=made)
        return made

    def box(self, name, box):
        place, material = RigidTransform(box.centre), self.material(box.friction)
        AddCompliantHydroelasticProperties(resolution_hint=0.1, hydroelastic_modulus=1e7, properties=material)
        body = self.plant.world_body()
        if box.mass > 0:
            body, place = self.plant.AddRigidBody(name, SpatialInertia.SolidBoxWithMass(box.mass, *box.size)), RigidTransform()
            self.plant.SetDefaultFloatingBaseBodyPose(body, RigidTransform(box.centre))
        self.plant.RegisterCollisionGeometry(body, place, DrakeBox(*box.size), name, material)
        return body

    def place(self):
        context = self.plant.GetMyContextFromRoot(self.simulator.get_context())
        return (0, 0, 0) if self.body is None else self.plant.EvalBodyPoseInWorld(context, self.body).translation()

    def play(self, server, seconds, rate, stall=0):
        """Returns where the body was."""
        with haptic.drake.Session(self.simulator, self.plant, self.scene_graph, "tool", period=1 / rate, gravity=(0, 0, 0)) as touch:
            def frame():
                steps = touch.drive()
                self.simulator.AdvanceTo(self.simulator.get_context().get_time() + steps * self.plant.time_step())
                touch.send()
            return play(server, seconds, frame, self.place, stall)


class Touch(TouchTasks, unittest.TestCase):
    rates = (30, 60, 500)
    largest_jump_of_bodies = 0.3      # N
    largest_deviation_of_load = 0.1   # N

    @staticmethod
    def play(scene, seconds, hand, *options, rate=60, stall=0):
        # Drake's rule for two coefficients is none of the server's: the floor has that of the box.
        made = scenes()[scene]
        floor = made.body.friction if made.body else made.tool.friction
        world = World(made._replace(floor=floor), min(STEP, 1 / rate))
        return virtual_hand.play(hand, options, lambda server: world.play(server, seconds, rate, stall))


class Example(unittest.TestCase):
    def test_it_presses_and_pushes(self):
        self.assertRegex(last_line_of("drake/touch.py"), r" N, brick at 0\.1\d\d m$")


if __name__ == "__main__":
    main()
