#!/usr/bin/python3
"""A Drake world in the hand: a box that presses on a floor, and then pushes a brick along.

    touch.py [SECONDS]

Needs Drake (pip install drake) and the package haptic. Without a device a server with a simulated one is started, and hold() is
the hand.
"""

import sys
import time

import haptic_local_model as haptic
from pydrake.geometry import (AddCompliantHydroelasticProperties, AddContactMaterial, AddRigidHydroelasticProperties, Box, HalfSpace,
                              ProximityProperties)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

PERIOD = 1 / 60  # s, of a frame
SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 6

builder = DiagramBuilder()
plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=1 / 240)
floor, soft = ProximityProperties(), ProximityProperties()
for material in (floor, soft):
    AddContactMaterial(friction=CoulombFriction(0.4, 0.4), properties=material)
AddRigidHydroelasticProperties(floor)                         # one point of contact would not bear a box
AddCompliantHydroelasticProperties(resolution_hint=0.1, hydroelastic_modulus=1e7, properties=soft)
plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform(), HalfSpace(), "floor", floor)
for name, mass, x in (("tool", 0.1, 0), ("brick", 0.3, 0.08)):
    body = plant.AddRigidBody(name, SpatialInertia.SolidBoxWithMass(mass, 0.04, 0.04, 0.04))
    plant.RegisterCollisionGeometry(body, RigidTransform(), Box(0.04, 0.04, 0.04), name, soft)
    plant.SetDefaultFloatingBaseBodyPose(body, RigidTransform((x, 0, 0.02)))
plant.Finalize()
simulator = Simulator(builder.Build())
context = plant.GetMyContextFromRoot(simulator.get_context())

with haptic.drake.Session(simulator, plant, scene_graph, tool="tool", period=PERIOD) as touch:
    start, frame = time.monotonic(), 0
    while time.monotonic() - start < SECONDS:
        along = max(0, time.monotonic() - start - 2)          # s: it presses for two, then it pushes
        touch.hold((min(0.05 * along, 0.15), 0, 0.012 if along == 0 else 0.022))
        steps = touch.drive()
        simulator.AdvanceTo(simulator.get_context().get_time() + steps * plant.time_step())
        touch.send()
        frame += 1
        if frame % 30 == 0:
            x, y, z = touch.touch.force[:3]
            at = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName("brick")).translation()[0]
            print(f"{touch.touch.server_state}: {x:5.2f} {y:5.2f} {z:5.2f} N, brick at {at:.3f} m", flush=True)
        time.sleep(max(0, start + frame * PERIOD - time.monotonic()))
