#!/usr/bin/env python3
"""Writes worlds/clutter.sdf: a bin of a hundred loose objects, and a hook.

Usage: worlds/make_clutter.py
"""

import pathlib
import random

FOLDER = pathlib.Path(__file__).parent
SEED = 11
PITCH = 0.05   # m, between the places from which the objects fall
ROWS, LAYERS = 5, 4
MASS = 0.3     # kg
INSIDE = 0.27  # m, of the bin
WALL, HEIGHT = 0.02, 0.1  # m
MU = 0.4

HEAD = """<?xml version="1.0"?>
<!--
  A bin of a hundred loose objects of 0.3 kg, z up, and a hook to rummage with: free in space, without
  weight. Written by worlds/make_clutter.py. Lengths in m.

  What is to be felt: objects that give way, roll, tip and pile up; what the hook draws along weighs and
  rubs; the walls and the floor do not give way.
-->
<sdf version="1.9">
  <world name="clutter">
    <haptic:tool>hook</haptic:tool>
    <haptic:description>A bin of a hundred loose objects to rummage in.</haptic:description>
    <gravity>0 0 -9.81</gravity>
    <!-- 480 steps a second: with 240 what is squeezed spins, with 960 the heap is too slow for 60 frames/s. -->
    <physics type="ode">
      <max_step_size>0.0020834</max_step_size>
      <ode><solver><iters>30</iters></solver></ode>
    </physics>

    <model name="table">
      <static>true</static>
      <link name="top">
        <collision name="plane">
          <geometry><plane><normal>0 0 1</normal></plane></geometry>
          <surface><friction><ode><mu>0.4</mu></ode></friction></surface>
        </collision>
      </link>
    </model>

    <!-- A shaft of 16 mm, held at its upper end, with a foot along x. -->
    <model name="hook">
      <pose>0 0 0.33 0 0 0</pose>
      <haptic:hand><link>body</link><pose>0 0 0.08 0 0 0</pose></haptic:hand>
      <link name="body">
        <gravity>false</gravity>
        <inertial>
          <mass>0.3</mass>
          <inertia><ixx>6.7e-4</ixx><iyy>7.2e-4</iyy><izz>6e-5</izz></inertia>
        </inertial>
        <collision name="shaft">
          <geometry><box><size>0.016 0.016 0.16</size></box></geometry>
          <surface><friction><ode><mu>0.3</mu></ode></friction></surface>
        </collision>
        <collision name="foot">
          <pose>0.022 0 -0.072 0 0 0</pose>
          <geometry><box><size>0.06 0.016 0.016</size></box></geometry>
          <surface><friction><ode><mu>0.3</mu></ode></friction></surface>
        </collision>
      </link>
    </model>
"""


def collision(name, geometry, pose="0 0 0 0 0 0"):
    return (f'        <collision name="{name}">\n          <pose>{pose}</pose>\n'
            f"          <geometry>{geometry}</geometry>\n"
            f"          <surface><friction><ode><mu>{MU}</mu></ode></friction></surface>\n"
            "        </collision>\n")


def box(x, y, z):
    return f"<box><size>{x:g} {y:g} {z:g}</size></box>"


def bin_model():
    out = 0.5 * (INSIDE + WALL)
    length = INSIDE + 2 * WALL
    walls = [("west", box(WALL, length, HEIGHT), -out, 0), ("east", box(WALL, length, HEIGHT), out, 0),
             ("south", box(INSIDE, WALL, HEIGHT), 0, -out), ("north", box(INSIDE, WALL, HEIGHT), 0, out)]
    sides = "".join(collision(name, geometry, f"{x:g} {y:g} {HEIGHT / 2:g} 0 0 0")
                    for name, geometry, x, y in walls)
    return ('    <model name="bin">\n      <static>true</static>\n      <link name="walls">\n'
            f"{sides}      </link>\n    </model>\n")


#: Geometry, and moments of inertia of 1 kg, m².
KINDS = [
    (box(0.03, 0.03, 0.03), (1.5e-4, 1.5e-4, 1.5e-4)),
    (box(0.04, 0.026, 0.02), (9.0e-5, 1.67e-4, 1.9e-4)),
    ("<sphere><radius>0.016</radius></sphere>", (1.02e-4, 1.02e-4, 1.02e-4)),
    ("<cylinder><radius>0.015</radius><length>0.035</length></cylinder>", (1.58e-4, 1.58e-4, 1.13e-4)),
    ("<capsule><radius>0.011</radius><length>0.02</length></capsule>", (1.2e-4, 1.2e-4, 5.5e-5)),
]


def loose(number, place, angles):
    geometry, inertia = KINDS[number % len(KINDS)]
    moments = "".join(f"<{name}>{MASS * value:.3g}</{name}>" for name, value in zip(("ixx", "iyy", "izz"), inertia))
    pose = " ".join(f"{value:.4g}" for value in (*place, *angles))
    return (f'    <model name="object{number + 1}">\n      <pose>{pose}</pose>\n      <link name="body">\n'
            f"        <inertial><mass>{MASS}</mass><inertia>{moments}</inertia></inertial>\n"
            f'{collision("shape", geometry)}      </link>\n    </model>\n')


def main():
    chance = random.Random(SEED)
    places = [((i - (ROWS - 1) / 2) * PITCH, (j - (ROWS - 1) / 2) * PITCH, 0.025 + PITCH * layer)
              for layer in range(LAYERS) for i in range(ROWS) for j in range(ROWS)]
    numbers = list(range(len(places)))
    chance.shuffle(numbers)
    objects = "".join(loose(number, place, (0, 0, chance.uniform(-3, 3)))
                      for number, place in zip(numbers, places))
    (FOLDER / "clutter.sdf").write_text(HEAD + bin_model() + objects + "  </world>\n</sdf>\n")


if __name__ == "__main__":
    main()
