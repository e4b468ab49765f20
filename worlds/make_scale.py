#!/usr/bin/env python3
"""Writes worlds/scale.sdf and what it includes, worlds/models/posts.sdf and things.sdf: 10,000 posts, and
500 loose things among them.

Usage: worlds/make_scale.py
"""

import pathlib

FOLDER = pathlib.Path(__file__).parent
PITCH = 0.04  # m, of the posts
POSTS = 100   # in a row, and rows
ROWS_OF_THINGS, THINGS = 25, 20

HEAD = """<?xml version="1.0"?>
<!--
  {text} Written by worlds/make_scale.py. Lengths in m.
-->
<sdf version="1.9">
"""

WORLD = """  <world name="scale">
    <haptic:tool>rod</haptic:tool>
    <haptic:description>10,000 posts, and 500 loose things among them.</haptic:description>
    <gravity>0 0 -9.81</gravity>

    <model name="table">
      <static>true</static>
      <link name="top">
        <collision name="plane">
          <geometry><plane><normal>0 0 1</normal></plane></geometry>
          <surface><friction><ode><mu>0.4</mu></ode></friction></surface>
        </collision>
      </link>
    </model>

    <!-- Held at its upper end. -->
    <model name="rod">
      <pose>0 0 0.09 0 0 0</pose>
      <haptic:hand><link>body</link><pose>0 0 0.03 0 0 0</pose></haptic:hand>
      <link name="body">
        <gravity>false</gravity>
        <inertial>
          <mass>0.2</mass>
          <inertia><ixx>8e-5</ixx><iyy>8e-5</iyy><izz>1e-5</izz></inertia>
        </inertial>
        <collision name="rod">
          <geometry><capsule><radius>0.007</radius><length>0.05</length></capsule></geometry>
          <surface><friction><ode><mu>0.2</mu></ode></friction></surface>
        </collision>
      </link>
    </model>

"""

#: Geometry, height of its middle (m), and the moments of inertia of 0.2 kg, kg·m².
KINDS = [
    ("<box><size>0.018 0.018 0.018</size></box>", 0.009, (1.08e-5, 1.08e-5, 1.08e-5)),
    ("<cylinder><radius>0.01</radius><length>0.014</length></cylinder>", 0.007, (8.27e-6, 8.27e-6, 1e-5)),
    ("<box><size>0.022 0.014 0.012</size></box>", 0.006, (5.67e-6, 1.05e-5, 1.13e-5)),
    ("<sphere><radius>0.009</radius></sphere>", 0.009, (6.48e-6, 6.48e-6, 6.48e-6)),
]
MU = "<surface><friction><ode><mu>0.3</mu></ode></friction></surface>"


def post(i):
    """One, 1 mm over the table: of pieces that adjoin planes are felt beyond their edges (docs/method.md 10)."""
    x = (i - (POSTS - 1) / 2) * PITCH
    return (f'    <link name="post{i + 1}"><pose>{x:.3f} 0 0.016 0 0 0</pose><collision name="c"><geometry>'
            "<cylinder><radius>0.006</radius><length>0.03</length></cylinder></geometry>"
            f"{MU}</collision></link>\n")


def thing(i):
    geometry, height, moments = KINDS[i % len(KINDS)]
    inertia = "".join(f"<{name}>{value:g}</{name}>" for name, value in zip(("ixx", "iyy", "izz"), moments))
    x = (i - (THINGS - 1) / 2) * 2 * PITCH
    return (f'    <link name="thing{i + 1}"><pose>{x:.3f} 0 {height:g} 0 0 0</pose>'
            f"<inertial><mass>0.2</mass><inertia>{inertia}</inertia></inertial>"
            f'<collision name="c"><geometry>{geometry}</geometry>{MU}</collision></link>\n')


def include(name, file, x, y):
    return f'    <include><uri>models/{file}</uri><name>{name}</name><pose>{x:.3f} {y:.3f} 0 0 0 0</pose></include>\n'


def write(name, text, body):
    (FOLDER / name).write_text(HEAD.format(text=text) + body + "</sdf>\n")


def main():
    posts = "".join(include(f"row{i + 1}", "posts.sdf", 0, (i - (POSTS - 1) / 2) * PITCH) for i in range(POSTS))
    # Between the posts, on every second place of a chessboard.
    things = "".join(include(f"things{i + 1}", "things.sdf", i % 2 * PITCH, (i - ROWS_OF_THINGS // 2) * PITCH)
                     for i in range(ROWS_OF_THINGS))
    write("models/posts.sdf", "A row of posts.",
          '  <model name="posts">\n    <static>true</static>\n' + "".join(map(post, range(POSTS))) + "  </model>\n")
    write("models/things.sdf", "A row of loose things.",
          '  <model name="things">\n' + "".join(map(thing, range(THINGS))) + "  </model>\n")
    write("scale.sdf", "10,000 posts on a table and 500 loose things among them, z up; the tool is a rod, free in "
          "space and\n  without weight.\n\n  What is to be felt: each post, from all sides; things that slide, tip "
          "and roll when they are pushed, and jam\n  between posts; and nothing of how much there is.",
          WORLD + posts + "\n" + things + "  </world>\n")


if __name__ == "__main__":
    main()
