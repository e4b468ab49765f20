#!/usr/bin/python3
"""Makes one self-contained HTML page of what the experiments have written."""

import base64
import collections
import csv
import html
import io
import json
import math
import pathlib
import sys
import textwrap

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Polygon

import report_over
from arguments import Arguments
from plot_input import read_starts, read_world

TESTBED = pathlib.Path(__file__).resolve().parent.parent / "worlds/testbed.sdf"

# One look per method on all figures.
STYLES = {
    "IR": ("#d62828", "-"),
    "IR-rot": ("#f77f00", "-"),
    "IR four-channel": ("#d62828", "--"),
    "IR coupler": ("#d62828", ":"),
    "VRPN recovery": ("#bc6c25", "-"),
    "VRPN four-channel": ("#bc6c25", "--"),
    "coupler to engine": ("#6c757d", "-"),
    "direct to engine": ("#000000", "-"),
    "LM₀": ("#4895ef", "-"),
    "LM₀ direct": ("#4895ef", "--"),
    "LM₀ coupler": ("#4895ef", ":"),
    "LM₀ rule P": ("#4895ef", "-."),
    "LM₅": ("#1b4332", "-"),
    "LM₅ direct": ("#1b4332", "--"),
    "LM₅ coupler": ("#1b4332", ":"),
    "LM₅ rule P": ("#1b4332", "-."),
    "LM shapes": ("#2a9d8f", "-"),
    "LM shapes direct": ("#2a9d8f", "--"),
}

# What each experiment is, in the order of the page.
SECTIONS = {
    "testbed": "The testbed",
    "fig06": "Figure 6: one degree of freedom, walls that arrive late",
    "fig09": "Figure 9: the same hole with predicted walls",
    "fig14": "Figure 14: pushed onto a wall and left there",
    "fig16": "Figure 16: the peg in its hole, shaken with 1 N (k = 4000 N/m)",
    "fig17": "Figure 17: shaken with 3 N at k = 15000 N/m",
    "updates": "Updates: jumps of the force and energy",
    "limits": "Largest stable stiffness, side by side",
    "maps": "Where each method stops working",
    "approach": "Where a wall is felt, over approach speed",
    "shapes": "The geometry near the hand in the server, across delays",
    "ocean": "Across an ocean: what a hand perceives, over the round trip",
    "roams": "A peg about the testbed's hole: the same in motion, tick by tick",
    "observer": "A hand that is not measured",
    "spatial": "Six degrees of freedom",
    "collisions": "Collisions and friction",
    "linkages": "Linkages",
    "bodies": "Bodies that move when pushed",
    "bodylimits": "Where bodies that move end",
    "holding": "Bodies that hold each other, and a loop that stalls",
    "held": "What the hand holds, against a world without delay",
    "external": "Loads and walls that are stated as a wrench",
    "scenes": "The shipped scenes",
}

INTRODUCTION = {
    "testbed": "The paper's Fig. 12: a planar enclosure with a hole that fits the peg exactly. A table seen from "
    "above, y pointing down the page. Figure 14 pushes the peg from where it lies in the middle onto the bottom "
    "wall, which it touches with its centre at y = 124 mm; Figures 16 and 17 and the search for the largest "
    "stiffness shake it in the hole, where it stands upright.",
    "fig06": "A 1 kg peg between two walls that it just touches; the hand shakes it with 5 N at 10 Hz, "
    "coupled directly; k = 10 kN/m, b = 15 N·s/m; each report of the walls takes 20 ms and is repeated "
    "every 20 ms. The intermediate representation (IR) renders the full depth of a wall that arrives "
    "late; the local model (LM₀) deforms its proxy so that the wall begins where the peg is.",
    "fig09": "The same hole. LM₅ gets walls within 5 mm before they are touched: then the delay of "
    "the environment cannot be felt at all.",
    "fig14": "The peg is pushed with 0.5 N onto a wall at y = 124 mm, up to 0.2 mm off its centre. With "
    "IR it never comes to rest: a corner that loses contact comes back late and deep, which turns the peg, "
    "which loses the other corner. The paper has one run of each: the wall, which is at 124 mm, is felt at 118 mm "
    "(LM₅), 84 mm (IR) and 78 mm (LM₀), all before it. Here a wall that arrives late is felt beyond its place, "
    "and over many moments of arrival LM₀ is 3 to 7 mm worse than LM₅. A late wall cannot be felt early: "
    "presumably the paper's device lagged behind the tool of its simulation; here the tool is carried along "
    "with the proxy, so that lateness alone shows.",
    "fig16": "The peg stands in an exactly fitting hole and is shaken sideways with 1 N at 2.5 Hz, up to "
    "2 mm off its centre.",
    "fig17": "The same with 3 N and contacts nearly four times as stiff. The paper has one run of LM₀ and LM₅, both "
    "stable: LM₀ moves some 20 mm farther along x and y, and LM₅ farther than its stiffness allows, as it "
    "overshoots by more than its 5 mm. Here LM₅ stays within 0.1 mm: no run overshoots by so much, and every "
    "wall is there before it is met. LM₀ moves about 12 mm farther along x. IR, which the paper calls unstable "
    "here and does not show, is run too. A run counts as unstable when "
    "the virtual side (motors, coupling, proxy, contacts) gives out more than 10 mJ in some 2 s, five "
    "periods of the hand: a passive one gives out nothing that it has not taken.",
    "updates": "What adopting one update does while the peg is shaken as in Fig. 16: the change of the "
    "resultant of all contact springs, with the proxy where it was, and of the energy stored in them. "
    "A jump of 0.1 N is 10 % of the hand's force: about what a person can just notice. (The random 3-D "
    "stress of the update rules and the properties of collisions are unit tests: contact_update_test.cc, "
    "collision_test.cc.)",
    "limits": "The hole of Fig. 17 (3 N, b = 100 N·s/m), contact stiffness found by scanning octaves and "
    "then bisecting to 10 %, under two criteria: by energy, no more than 10 mJ given out in any 2 s; by "
    "motion, the handle below 1 m/s and not out of the hole. For the couplings to the engine's own tool the "
    "stiffness is that of the coupling. Where deformation heals it does so at 50 mm/s, which the paper has not. An asterisk marks a method that is stable again above a stiffness "
    "where it was not; > the end of the scan.",
    "maps": "The same search with one condition varied at a time: fixed rate of the environment, one-way "
    "network delay, jitter and loss, delay of the device, rate of the loop, and whether the environment "
    "waits for each acknowledgement; by both criteria. Hollow marks: stable up to the end of the scan. At the "
    "lower edge: unstable at the softest contact tried; no fit uses either. Grey: Colgate's bound for an undelayed wall without virtual "
    "damping, k < 2 b_device / Δt.",
    "approach": "A peg meets a wall at a steady speed, 20 ms away one way, environment at 30 to 60 Hz. "
    "Left: where the handle comes to rest, from where it should. Middle: how far it gets beyond the wall. "
    "Right: how far handle and the environment's tool drift apart on the way.",
    "shapes": "The server has the world's shapes and finds the contacts at every tick, or gets planes from the client. Left: how "
    "far from a wall force begins that is met at 0.05 to 1 m/s; at the top: never. Right: what is felt in holes that a peg "
    "enters without touching them, at 0.05 to 1 m/s, with 0.02 to 3 mm to spare on each side.",
    "ocean": "Shapes: the server has the world's shapes and finds contacts at every tick. Planes: it gets planes from "
    "the client. IR: the paper's intermediate representation, coupled directly, 1 kN/m. Direct: the engine's "
    "force, held between frames, 0.5 kN/m; its spring is felt in free motion too. Drawn at 60 Hz and 0.3 m/s "
    "with all datagrams arriving; the table behind it has also 15 and 200 Hz, 0.05 and 1 m/s, 5 % of all "
    "datagrams lost, and an outage of 300 ms when it matters most. A wall is met; a peg enters a hole with 1 "
    "mm to spare on each side and touches nothing; a cube of 0.3 kg is lifted and held; a brick is pushed "
    "over a table; a door is pushed open, and what is felt is its angular impulse, against that without "
    "delay. IR feels no free hole because it knows only what is touched already, and that is why its walls "
    "are late. With planes the hand passes through a door that it meets before the round trip is over.",
    "roams": "Pegs of 38 and 40 mm are led to and fro before the testbed's hole of 40 mm, into it and out, at up to 0.4 m/s and "
    "5 rad/s, or pushed about the room with up to 7 N, the environment at 30 to 60 Hz. In each tick the force is held "
    "against the walls as they are. Left: the share of ticks with more than 0.5 N where no wall is within 0.3 mm, of led "
    "pegs. Middle: how deep they get. Right: in how many runs a pushed peg's middle gets into a wall.",
    "observer": "Four channels on a device with encoder steps of 0.05 mm, a filtered velocity and 0 to 3 ticks of delay: "
    "the hand's wrench measured, observed from the motion, or unknown. Left: what a hand that shakes the handle "
    "in free motion feels as its mass; device and proxy have 1 kg each. Middle: how far the hand's force, as the server knows it, is from "
    "the true one of 0.5 N. Right: the largest stable stiffness in the hole of Fig. 17, by energy; at the end of the "
    "scan it is beyond.",
    "spatial": "A free body of six degrees of freedom: a square peg in an exactly fitting square hole, "
    "held down with 0.5 N and shaken along x and y; and a box, set down on an edge and pressed flat "
    "with 0.5 N.",
    "collisions": "Drawn tools of one to five links that approach 1 to 64 contacts: what is left of their kinetic "
    "energy by Newton's rule (Eq. 11, whose impulses may pull) and by impulses that do not pull. A block that is "
    "pressed on a wall with 3 N and pulled to and fro along it (μ_s = 0.5, μ_k = 0.3). A block that is thrown at a "
    "wall: the impulse takes as many ticks as 12 N need for its momentum.",
    "linkages": "Chains that were kicked once and left to themselves. An arm of three links that goes through its "
    "stretched posture while a post pushes its middle link with 3.2 N: what Eq. 8 alone would make of that, and what "
    "is felt. Three bars that fold onto themselves, the paper's Fig. 11: where the last hits the first both turn "
    "otherwise. The arm of worlds/corner.sdf, led to the limits of its joints (dotted).",
    "bodies": "A cube is lifted off two rails by a tray and held; a brick of 0.375 kg is pushed over a table "
    "(μ = 0.4), through its centre and 20 mm off it, and against a post; the hand rests on a loose box. What "
    "the hand must feel is known: weight, friction, its own push. Each mark is the mean of a run at 30 or "
    "60 Hz, 0 or 20 ms each way, and contacts of 4 to 50 kN/m; its bar the standard deviation.",
    "bodylimits": "The same tasks, and a rest on a tower of three cubes, over delay and mass. Colour: how far the "
    "mean force is from what is expected; crosses: more than 10 %, or a standard deviation of more than 6 % of it "
    "(and 0.05 N): the hand feels another body there, or a chatter.",
    "holding": "3 kg on a plate that is carried; two to ten cubes on each other that are pressed with 2 N, of which the "
    "device's dry friction may bear 0.2 N; a wall of 60 kg that swings, pressed with 2 N, whose bar is its own "
    "acceleration; a cube of 0.4 kg that is held while the server's loop stands still for 5 to 25 ms four times a second.",
    "held": "A cube and towers are lifted by a tray, carried to the side and put down, thrown up and caught, pressed from "
    "above; a plate carries a load; bricks are pushed. Each run is compared, tick by tick, with one at 240 Hz without "
    "delay. Bars: the mean difference of the force over the last half second.",
    "external": "An environment states in each frame what pushes the tool, and no contact: a force, a payload that is welded "
    "to it, a wall whose force it measures. The tool has 0.3 kg. Walls are pressed by a hand of 200 N/m; a payload also "
    "moved to and fro, where the bar is its inertia.",
    "scenes": "Each scene of scripts/run is played in virtual time by its own hand: the largest command, its limit, "
    "and the largest step of the contact force at an update that no collision explains.",
}


def read_table(path):
    with open(path, encoding="utf-8") as file:
        return list(csv.DictReader(file))


def by_method(rows):
    groups = collections.OrderedDict()
    for row in rows:
        groups.setdefault(row["method"], []).append(row)
    return groups


def column(rows, name, scale=1.0):
    return [scale * float(row[name]) for row in rows]


def style(method):
    colour, line = STYLES[method]
    return {"color": colour, "linestyle": line, "linewidth": 1.3, "label": method}


def panels(count, width=5.2, height=3.2):
    figure, axes = plt.subplots(1, count, figsize=(width * count, height), squeeze=False)
    for axis in axes[0]:
        axis.grid(alpha=0.3)
    return figure, axes[0]


def label(axis, x, y):
    axis.set_xlabel(x)
    axis.set_ylabel(y)


def draw_lines(axis, rows, x, y, y_scale=1.0):
    for method, points in by_method(rows).items():
        axis.plot(column(points, x), column(points, y, y_scale), **style(method))


def draw_fig06(folder):
    rows = by_method(read_table(folder / "fig06_series.csv"))
    longest = max(float(points[-1]["time_s"]) for points in rows.values())
    figure, axes = panels(len(rows))
    for axis, (method, points) in zip(axes, rows.items()):
        time, x = column(points, "time_s"), column(points, "x_m", 1e3)
        axis.plot(time, x, **style(method))
        axis.set_title(f"{method}, 1 kHz")
        if time[-1] < longest - 0.01:
            axis.plot(time[-1], x[-1], "x", color="black")
            axis.annotate("the session ends", (time[-1], x[-1]), xytext=(-6, 4), textcoords="offset points",
                          ha="right", fontsize=8)
        if method == "IR":
            axis.set_xlim(0, 1)
        label(axis, "time, s", "x, mm")
    return figure


def draw_fig09(folder):
    rows = read_table(folder / "fig09_series.csv")
    figure, axes = panels(2)
    draw_lines(axes[0], rows, "time_s", "x_m", 1e3)
    draw_lines(axes[1], rows, "time_s", "force_N")
    label(axes[0], "time, s", "x, mm")
    label(axes[1], "time, s", "contact force, N")
    for axis in axes:
        axis.set_xlim(0, 0.5)
    axes[0].legend()
    return figure


def draw_fig14(folder):
    rows = read_table(folder / "fig14_series.csv")
    figure, axes = panels(2)
    draw_lines(axes[0], rows, "time_s", "y_m", 1e3)
    draw_lines(axes[1], rows, "time_s", "theta_rad", 57.29578)
    axes[0].axhline(124, color="#999999", linewidth=0.8)
    axes[0].text(0, 124.2, "the wall", color="#666666", fontsize=8)
    axes[0].set_ylim(100, 140)
    label(axes[0], "time, s", "y of the handle, mm")
    label(axes[1], "time, s", "heading of the handle, °")
    axes[0].legend(loc="lower right")
    return figure


def draw_hole(folder, name, limit):
    rows = read_table(folder / f"{name}_series.csv")
    figure, axes = panels(2)
    for method, points in by_method(rows).items():
        axes[0].plot(column(points, "x_m", 1e3), column(points, "y_m", 1e3), **style(method))
        axes[1].plot(column(points, "time_s"), column(points, "theta_rad", 57.29578), **style(method))
    axes[0].set_xlim(100 - limit, 100 + limit)
    axes[0].set_ylim(184 + limit, 184 - limit)
    axes[0].set_aspect("equal")
    axes[1].set_ylim(-3 * limit, 3 * limit)
    label(axes[0], "x of the handle, mm", "y, mm (down the hole)")
    label(axes[1], "time, s", "rotation from upright, °")
    axes[0].legend(fontsize=8)
    return figure


def draw_updates(folder):
    rows = read_table(folder / "updates.csv")
    figure, axes = panels(2, 5.6)
    methods = [row["method"] for row in rows]
    axes[0].barh(methods, column(rows, "largest_jump_N"), color="#ced4da", label="largest")
    axes[0].barh(methods, column(rows, "p99_jump_N"), height=0.4, color="#1d3557", label="99th percentile")
    axes[0].axvline(0.1, color="#d62828", linewidth=1, label="just noticeable")
    axes[0].set_xscale("symlog", linthresh=1e-3)
    axes[0].set_xlim(left=0)
    axes[0].invert_yaxis()
    axes[0].legend(fontsize=8)
    axes[0].set_xlabel("change of the contact force at an update, N")
    axes[1].barh(methods, [max(e, 0) for e in column(rows, "largest_energy_J", 1e3)], color="#e76f51")
    axes[1].set_xscale("symlog", linthresh=1e-6)
    axes[1].set_xlim(left=0)
    axes[1].invert_yaxis()
    axes[1].set_xlabel("energy stored by an update at most, mJ")
    return figure


# What counts as stable, and how it is drawn.
CRITERIA = {"energy": {"alpha": 0.85}, "motion": {"alpha": 0.35}}


def by_criterion(rows, criterion):
    return [row for row in rows if row["criterion"] == criterion]


def kilonewtons(cell):
    """k_max of a row of `limits` or `maps`, as text."""
    k_max = float(cell["k_max"])
    if k_max == 0:
        return "–"
    return f"{'> ' if cell['beyond'] == '1' else ''}{k_max / 1000:.3g} kN/m"


def ratio(cell, baseline):
    """k_max over that of IR, as text; the method's own k_max where IR has none."""
    if baseline is None or float(baseline["k_max"]) == 0:
        return kilonewtons(cell)
    if cell is baseline:
        return "1"
    if cell["beyond"] == baseline["beyond"] == "1":
        return "both beyond"
    sign = "> " if cell["beyond"] == "1" else "< " if baseline["beyond"] == "1" else ""
    return sign + f"{float(cell['k_max']) / float(baseline['k_max']):.3g}"


def draw_limits(folder):
    rows = read_table(folder / "limits.csv")
    devices = list(collections.OrderedDict.fromkeys(row["device"] for row in rows))
    methods = list(by_method(rows))
    figure, axes = panels(len(devices), 5.6, 1.2 + 0.42 * len(methods))
    for axis, device in zip(axes, devices):
        for shift, (criterion, look) in zip((-0.2, 0.2), CRITERIA.items()):
            of_device = by_criterion([row for row in rows if row["device"] == device], criterion)
            baseline = next((row for row in of_device if row["method"] == "IR"), None)
            for row in of_device:
                place = methods.index(row["method"])
                k_max = float(row["k_max"]) / 1000
                axis.barh(place + shift, k_max, height=0.38, color=STYLES[row["method"]][0], **look)
                text = kilonewtons(row) if baseline in (None, row) else f"{ratio(row, baseline)} × IR"
                text += "" if row["monotonous"] == "1" else " *"
                axis.text(max(k_max, 0.1) * 1.1, place + shift, text, va="center", fontsize=7)
            axis.barh([-1], [0], color="#555555", label=f"by {criterion}", **look)
        axis.set_yticks(range(len(methods)), methods)
        axis.set_ylim(len(methods) - 0.4, -0.6)
        axis.set_xscale("log")
        axis.set_xlim(0.1, 5000)
        axis.set_title(f"device: {device}", fontsize=10)
        axis.set_xlabel("k_max, kN/m")
        axis.legend(fontsize=8, loc="lower right")
    return figure


def draw_map(axis, rows):
    """k_max over one condition, by one criterion."""
    for method, points in by_method(rows).items():
        x = column(points, "value")
        y = [max(k, 0.0625) for k in column(points, "k_max", 1e-3)]
        axis.plot(x, y, **style(method))
        for at_x, at_y, point in zip(x, y, points):
            colour = STYLES[method][0]
            hollow = point["beyond"] == "1"
            axis.plot(at_x, at_y, "o", color=colour, markersize=4,
                      markerfacecolor="white" if hollow else colour)
    first = next(iter(by_method(rows).values()))
    axis.plot(column(first, "value"), column(first, "colgate", 1e-3), color="#adb5bd", linewidth=3,
              zorder=0, label="Colgate's bound")
    axis.set_yscale("log")
    axis.grid(alpha=0.3)
    unit = first[0]["unit"]
    name = first[0]["axis"].replace("_", " ").replace("ve ", "VE ")
    label(axis, name + (f", {unit}" if unit else ""), "k_max, kN/m")


def draw_maps(folder):
    rows = read_table(folder / "maps.csv")
    names = list(collections.OrderedDict.fromkeys(row["axis"] for row in rows))
    figure, axes = plt.subplots(len(names) + 1, len(CRITERIA), figsize=(11, 3.3 * len(names) + 1.6),
                                height_ratios=[3] * len(names) + [1.2])
    for line, name in zip(axes, names):
        of_axis = [row for row in rows if row["axis"] == name]
        for axis, criterion in zip(line, CRITERIA):
            draw_map(axis, by_criterion(of_axis, criterion))
            axis.set_title(f"by {criterion}", fontsize=10)
    for axis in axes[-1]:
        axis.axis("off")
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncol=4)
    return figure


def ratios(folder):
    """k_max over that of IR in the same run, as tables: a line per condition."""
    rows = read_table(folder / "maps.csv")
    return "\n".join(ratios_by(by_criterion(rows, criterion), criterion) for criterion in CRITERIA)


def ratios_by(rows, criterion):
    methods = list(by_method(rows))
    lines = [f"<p>k_max by {criterion}, as a multiple of IR's under the same condition (&gt;, &lt;: one of "
             "them is beyond the scan). Where IR is unstable at the softest contact tried, each method's own "
             "k_max; –: the method is too.</p>",
             '<table class="wide"><tr><th>condition</th>' + "".join(f"<th>{m}</th>" for m in methods) + "</tr>"]
    conditions = collections.OrderedDict()
    for row in rows:
        conditions.setdefault((row["axis"], row["value"], row["unit"]), {})[row["method"]] = row
    for (axis, value, unit), cells in conditions.items():
        name = f"{axis.replace('_', ' ').replace('ve ', 'VE ')} {value} {unit}"
        values = "".join(f"<td>{html.escape(ratio(cells[m], cells.get('IR')))}</td>" for m in methods)
        lines.append(f"<tr><td>{name}</td>{values}</tr>")
    lines.append("</table>")
    return "\n".join(lines)


def draw_approach(folder):
    rows = read_table(folder / "approach.csv")
    figure, axes = panels(3, 4)
    arrived = [row for row in rows if float(row["arrival_m_s"]) > 0]
    for method, points in by_method(arrived).items():
        speeds = sorted({float(point["speed_m_s"]) for point in points})
        for axis, name in zip(axes, ("error_m", "overshoot_m", "drift_m")):
            means = []
            for speed in speeds:
                values = [1e3 * float(p[name]) for p in points if float(p["speed_m_s"]) == speed]
                means.append(max(sum(values) / len(values), 1e-2))
            axis.plot(speeds, means, marker="o", markersize=3, **style(method))
    for axis in axes:
        axis.set_yscale("log")
        axis.axhline(1, color="#999999", linewidth=0.8)
    label(axes[0], "approach speed, m/s", "error of the perceived wall, mm")
    label(axes[1], "approach speed, m/s", "overshoot, mm")
    label(axes[2], "approach speed, m/s", "largest distance handle to VE tool, mm")
    axes[2].legend(fontsize=7)
    return figure


def draw_shapes(folder):
    figure, axes = panels(2, 4)
    colors = {"planes": "#d62728", "shapes": "#1f77b4"}
    never = 1000  # mm
    for i, (name, color) in enumerate(colors.items()):
        walls = [r for r in read_table(folder / "shapes_walls.csv") if r["contacts"] == name]
        x = [1e3 * float(r["delay_s"]) + 12 * i for r in walls]
        y = [min(1e3 * float(r["error_m"]), never) for r in walls]
        axes[0].plot(x, y, "o", markersize=4, color=color, alpha=0.5, label=name)
        entries = [r for r in read_table(folder / "shapes_entries.csv")
                   if r["contacts"] == name and float(r["free"]) > 0]
        holes = list(dict.fromkeys(r["walls"] for r in entries))
        x = [holes.index(r["walls"]) + 0.2 * i for r in entries]
        y = [max(float(r["largest_force_n"]), 1e-3) for r in entries]
        axes[1].plot(x, y, "o", markersize=4, color=color, alpha=0.5, label=name)
    axes[0].set(yscale="log")
    label(axes[0], "delay each way, ms", "where the wall is felt, off by, mm")
    axes[1].set(yscale="log")
    axes[1].set_xticks(range(len(holes)), holes)
    axes[1].axhline(0.5, color="#999999", linewidth=0.8)
    label(axes[1], "hole", "largest force felt, N (0.001: none)")
    for axis in axes:
        axis.legend(fontsize=7)
    return figure


SIGHTS = {"shapes": ("#1f77b4", "shapes in the server"), "planes": ("#d62728", "planes from the client"),
          "IR": ("#ff9f1c", "IR (the paper's baseline)"), "direct": ("#495057", "direct: the engine's force")}
# Of each panel: title, axis, what is due (no number: drawn is the ratio to it), range, whether it is logarithmic.
SENSES = {"wall": ("A wall is felt late", "late by, mm", 0, (-8, 160), False),
          "hole": ("A free hole is felt", "force from nothing, N", 0, (-6, 110), False),
          "weight": ("A body that is held (0.3 kg)", "force / m g", None, (-0.1, 2), False),
          "push": ("A brick that is pushed", "force / μ m g", None, (-0.1, 2), False),
          "door": ("A door that is pushed open", "impulse / due", None, (0.1, 1000), True)}


def round_trips(rows):
    return sorted({float(row["round_trip_s"]) for row in rows})


def draw_sense(axis, name, rows):
    title, unit, due, (low, high), logarithmic = SENSES[name]
    delays = round_trips(rows)
    axis.axhline(1 if due is None else due, color="#2b8a3e", linewidth=6, alpha=0.25, label="as it should be")
    for i, (sight, (color, text)) in enumerate(SIGHTS.items()):
        points = [row for row in rows if row["sense"] == name and row["sight"] == sight]
        if not points:
            continue
        x = [delays.index(float(row["round_trip_s"])) + 0.06 * (i - 1.5) for row in points]
        scales = [1 if due is not None else 1 / float(row["due"]) for row in points]
        y = [min(max(float(row["value"]) * scale, low), high) for row, scale in zip(points, scales)]
        axis.plot(x, y, "-", color=color, linewidth=1.6, label=text)
        for place, value, row in zip(x, y, points):
            right = row["right"] == "1"
            axis.plot(place, value, "o" if right else "x", color=color, markersize=6 if right else 8, markeredgewidth=2,
                      clip_on=False, zorder=3)
    if logarithmic:
        axis.set_yscale("log")
    axis.set_ylim(low, high)
    axis.set_xticks(range(len(delays)), [f"{1e3 * delay:g}" for delay in delays])
    axis.set_title(title, fontweight="bold")
    label(axis, "round trip, ms", unit)


def edge(rows, name, sight):
    """Up to which round trip all is right, in words; and whether that is as far as was tried."""
    points = [row for row in rows if row["sense"] == name and row["sight"] == sight]
    if not points:
        return "–", None
    longest = None
    for row in sorted(points, key=lambda row: float(row["round_trip_s"])):
        if row["right"] != "1":
            break
        longest = float(row["round_trip_s"])
    return ("never", False) if longest is None else (f"{1e3 * longest:g} ms", longest == round_trips(rows)[-1])


def draw_edges(axis, rows):
    cells = [[edge(rows, name, sight) for sight in SIGHTS] for name in SENSES]
    colors = {None: "#f1f3f5", True: "#b7e4c7", False: "#ffd6d6"}
    table = axis.table([[text for text, _ in line] for line in cells], rowLabels=list(SENSES), colLabels=list(SIGHTS),
                       cellColours=[[colors[whole] if text != "never" else "#ffa8a8" for text, whole in line]
                                    for line in cells], cellLoc="center", bbox=[0.12, 0.36, 0.88, 0.6])
    table.auto_set_font_size(False)
    table.set_fontsize(10)
    axis.axis("off")
    axis.set_title("Right up to a round trip of", fontweight="bold")


def draw_ocean(folder):
    rows = [row for row in read_table(folder / "ocean.csv") if row["network"] == "all arrives" and
            (float(row["rate_hz"]), float(row["speed_m_s"])) == (60, 0.3)]
    figure, axes = plt.subplots(2, 3, figsize=(13, 7.6))
    for axis, name in zip(axes.flat, SENSES):
        axis.grid(alpha=0.3)
        draw_sense(axis, name, rows)
    draw_edges(axes.flat[-1], rows)
    handles, texts = axes.flat[0].get_legend_handles_labels()
    handles += [plt.Line2D([], [], marker=marker, linestyle="", color="#555555") for marker in ("o", "x")]
    axes.flat[-1].legend(handles, [*texts, "right", "wrong (at the frame: beyond it)"], ncols=2, loc="lower center",
                         fontsize=8, frameon=False)
    figure.suptitle("What a hand feels over a network: engine at 60 Hz, hand at 0.3 m/s", fontsize=14)
    return figure


def draw_bars(axis, rows, group, value, title):
    """Bars of value(rows) by delay, one colour for each value of the column `group`."""
    delays = sorted({float(row["delay_s"]) for row in rows})
    names = list(dict.fromkeys(row[group] for row in rows))
    width = 0.8 / len(names)
    for i, name in enumerate(names):
        heights = [value([r for r in rows if r[group] == name and float(r["delay_s"]) == delay])
                   for delay in delays]
        axis.bar([place + (i - (len(names) - 1) / 2) * width for place in range(len(delays))], heights,
                 width=width, label=name)
    axis.set_xticks(range(len(delays)), [f"{1e3 * delay:g}" for delay in delays])
    label(axis, "delay each way, ms", title)
    axis.legend(fontsize=7)


def mean_percent(name):
    return lambda rows: sum(column(rows, name, 100)) / len(rows)


def draw_roams(folder):
    rows = read_table(folder / "roams.csv")
    led = [row for row in rows if row["hand"] == "led"]
    pushed = [row for row in rows if row["hand"] == "pushed"]
    figure, axes = panels(3, 4)
    draw_bars(axes[0], led, "setting", mean_percent("ghosts"), "ticks with force from nothing, %")
    draw_bars(axes[1], led, "setting", lambda points: max(column(points, "deepest_m", 1e3)), "deepest, mm")
    draw_bars(axes[2], pushed, "setting", mean_percent("leaves"), "pushed: runs that leave the room, %")
    return figure


def draw_spatial(folder):
    figure, axes = panels(3, 4)
    hole = read_table(folder / "spatial_hole_series.csv")
    for method, points in by_method(hole).items():
        axes[0].plot(column(points, "x_m", 1e3), column(points, "y_m", 1e3), **style(method))
    axes[0].set_xlim(-8, 8)
    axes[0].set_ylim(-8, 8)
    axes[0].set_aspect("equal")
    axes[0].legend(fontsize=7)
    axes[0].set_title("square hole")
    label(axes[0], "x, mm", "y, mm")
    draw_lines(axes[1], hole, "time_s", "rotation_rad", 57.29578)
    axes[1].set_ylim(0, 30)
    axes[1].set_title("square hole")
    label(axes[1], "time, s", "rotation, °")
    box = read_table(folder / "spatial_box_series.csv")
    draw_lines(axes[2], box, "time_s", "tilt_rad", 57.29578)
    axes[2].set_title("box on an edge")
    label(axes[2], "time, s", "tilt, °")
    return figure


def draw_observer(folder):
    rows = read_table(folder / "observer.csv")
    figure, axes = panels(3, 4.4)
    places = sorted({(float(row["rate_hz"]), float(row["delay_ticks"])) for row in rows})
    for name, colour, marker in (("measured", "#1b4332", "o"), ("observed", "#4895ef", "s"), ("unknown", "#d62828", "^")):
        of_hand = [row for row in rows if row["hand"] == name]
        x = [places.index((float(row["rate_hz"]), float(row["delay_ticks"]))) for row in of_hand]
        for axis, key, scale in zip(axes, ("felt_mass_kg", "error_N", "k_max_energy"), (1, 1, 1e-3)):
            axis.plot(x, column(of_hand, key, scale), marker, color=colour, label=name)
    for axis, text in zip(axes, ("mass felt, kg", "error of the hand's force, N rms", "largest stable stiffness, kN/m")):
        axis.set_xticks(range(len(places)), [f"{rate / 1000:g} kHz\n{delay:g}" for rate, delay in places])
        label(axis, "rate, delay in ticks", text)
        axis.set_ylim(bottom=0)
        axis.legend(fontsize=7)
    axes[2].set_yscale("log")
    axes[2].set_ylim(1, 400)
    return figure


def draw_collisions(folder):
    figure, axes = panels(3, 4.4)
    rows = read_table(folder / "collisions.csv")
    for name, colour, text in (("newton_share", "#d62828", "Eq. 11"),
                               ("nonnegative_share", "#1b4332", "no pull")):
        axes[0].plot(column(rows, "restitution"), column(rows, name), ".", color=colour, markersize=3, label=text)
    label(axes[0], "restitution", "kinetic energy that is left, share")
    rows = read_table(folder / "collisions_friction.csv")
    axes[1].plot(column(rows, "time_s"), column(rows, "pull_N"), color="#adb5bd", label="pull")
    axes[1].plot(column(rows, "time_s"), column(rows, "felt_N"), color="#1b4332", label="friction felt")
    label(axes[1], "time, s", "along the wall, N")
    rows = read_table(folder / "collisions_impulse.csv")
    axes[2].plot(column(rows, "time_s", 1e3), column(rows, "felt_N"), color="#1b4332", label="contact")
    axes[2].plot(column(rows, "time_s", 1e3), column(rows, "command_N"), color="#4895ef", label="command")
    axes[2].axhline(12, color="#d62828", linewidth=0.8)
    label(axes[2], "time from the collision, ms", "force on the hand, N")
    for axis in axes:
        axis.legend(fontsize=7)
    return figure


def draw_linkages(folder):
    figure, axes = panels(4, 4)
    chains = collections.OrderedDict()
    for row in read_table(folder / "linkages_energy.csv"):
        chains.setdefault(row["chain"], []).append(row)
    for name, points in chains.items():
        shares = [100 * (share - 1) for share in column(points, "energy_share")]
        axes[0].plot(column(points, "time_s"), shares, linewidth=1, label=name)
    axes[0].set_ylim(-1, 1)
    label(axes[0], "time, s", "change of energy, %")
    rows = read_table(folder / "linkages_map.csv")
    axes[1].plot(column(rows, "bend_rad"), column(rows, "exact_N"), color="#d62828", label="Eq. 8 alone")
    axes[1].plot(column(rows, "bend_rad"), column(rows, "felt_N"), color="#1b4332", label="felt")
    axes[1].axhline(3 * 3.2, color="#999999", linewidth=0.8)
    axes[1].set_yscale("log")
    axes[1].set_ylim(0.1, 2000)
    label(axes[1], "bend, rad (0: stretched)", "force at the hand, N")
    rows = read_table(folder / "linkages_fold.csv")
    axes[2].plot(column(rows, "time_s"), column(rows, "first_rad_s"), color="#4895ef", label="first bar")
    axes[2].plot(column(rows, "time_s"), column(rows, "last_rad_s"), color="#1b4332", label="last bar")
    label(axes[2], "time, s", "rotation, rad/s")
    rows = read_table(folder / "linkages_limits.csv")
    for name, colour, limits in (("shoulder", "#4895ef", (-0.8, 0.8)), ("elbow", "#1b4332", (-1.1, 1.3))):
        axes[3].plot(column(rows, "time_s"), column(rows, f"{name}_rad"), color=colour, label=name)
        for limit in limits:
            axes[3].axhline(limit, color=colour, linewidth=0.8, linestyle=":")
    label(axes[3], "time, s", "joint, rad")
    for axis in axes:
        axis.legend(fontsize=7)
    return figure


def draw_forces(rows, limits):
    """The mean force of each run against what is due, its bar the standard deviation."""
    tasks = list(collections.OrderedDict.fromkeys(row["task"] for row in rows))
    figure, axes = panels(1, 12)
    axis = axes[0]
    markers = {30.0: "o", 60.0: "s", 240.0: "^"}
    colours = {0.0: "#1f77b4", 0.005: "#1f77b4", 0.02: "#d62728", 0.05: "#999999"}
    rates, delays = (sorted({float(row[name]) for row in rows}) for name in ("ve_rate_Hz", "delay_s"))
    for place, task in enumerate(tasks):
        points = [row for row in rows if row["task"] == task]
        for i, row in enumerate(points):
            rate, delay, due = (float(row[n]) for n in ("ve_rate_Hz", "delay_s", "due_N"))
            felt = float(row["mean_N"]) / due
            axis.errorbar(place + 0.8 * (i + 0.5) / len(points) - 0.4, min(max(felt, limits[0]), limits[1]),
                          yerr=float(row["sd_N"]) / abs(due), marker=markers[rate], markersize=3,
                          color=colours[delay], linewidth=1)
    for rate in rates:
        axis.plot([], [], marker=markers[rate], linestyle="", color="#555555", label=f"{rate:.0f} Hz")
    for delay in delays:
        axis.plot([], [], color=colours[delay], label=f"{1e3 * delay:.0f} ms each way")
    axis.axhline(1, color="#999999", linewidth=0.8)
    axis.set_ylim(*limits)
    axis.set_xticks(range(len(tasks)), [textwrap.fill(task, 12) for task in tasks])
    axis.legend(fontsize=7, ncols=4)
    return figure


def draw_bodies(folder):
    figure = draw_forces([row for row in read_table(folder / "bodies.csv") if row["contacts"] == "planes"], (0.9, 1.1))
    label(figure.axes[0], "in each group: k = 4, 16, 50 kN/m", "force felt / force due")
    return figure


def draw_holding(folder):
    figure = draw_forces(read_table(folder / "holding.csv"), (0.85, 1.15))
    label(figure.axes[0], "in each group: planes, then shapes; what is lost lies on the edge", "force felt / force due")
    return figure


def draw_held(folder):
    rows = [row for row in read_table(folder / "held.csv") if float(row["outage_s"]) < 1]
    tasks = list(collections.OrderedDict.fromkeys(row["task"] for row in rows))
    figure, axes = panels(2, 12)
    markers = {0.0: ("o", "#1f77b4"), 0.02: ("s", "#d62728"), 0.1: ("^", "#1b4332"), 0.5: ("v", "#999999")}
    for axis, name, factor, text in ((axes[0], "rms_N", 1, "force off, rms, N"), (axes[1], "away_m", 1e3, "apart at the end, mm")):
        for delay, (marker, colour) in markers.items():
            points = [row for row in rows if float(row["delay_s"]) == delay]
            axis.plot([tasks.index(row["task"]) for row in points], [max(factor * float(row[name]), 1e-5) for row in points], marker,
                      color=colour, markersize=4, label=f"{1e3 * delay:.0f} ms each way")
        axis.set_yscale("log")
        axis.set_xticks(range(len(tasks)), [textwrap.fill(task, 12) for task in tasks])
        label(axis, "", text)
    axes[0].legend(fontsize=7)
    return figure


def draw_external(folder):
    figure = draw_forces([row for row in read_table(folder / "external.csv") if float(row["due_N"]) != 0], (0.9, 1.1))
    label(figure.axes[0], "in each group: the hand's wrench unknown, then measured", "force felt / force due")
    return figure


def draw_bodylimits(folder):
    rows = read_table(folder / "bodylimits.csv")
    tasks = list(collections.OrderedDict.fromkeys(row["task"] for row in rows))
    grid = [(rate, k) for rate in (60.0, 30.0) for k in (4000.0, 16000.0, 50000.0)]
    masses = sorted({float(row["mass_kg"]) for row in rows})
    delays = sorted({float(row["delay_s"]) for row in rows})
    figure, axes = plt.subplots(len(tasks), len(grid), figsize=(15, 2.1 * len(tasks)), squeeze=False,
                                layout="constrained")
    image = None
    for line, task in zip(axes, tasks):
        for axis, (rate, k) in zip(line, grid):
            error = [[0.0] * len(delays) for _ in masses]
            for row in rows:
                if row["task"] != task or (float(row["ve_rate_Hz"]), float(row["stiffness"])) != (rate, k):
                    continue
                x, y = delays.index(float(row["delay_s"])), masses.index(float(row["mass_kg"]))
                error[y][x] = 100 * abs(float(row["mean_N"]) / float(row["due_N"]) - 1)
                if row["right"] == "0":
                    axis.plot(x, y, "x", color="#d62828", markersize=7, markeredgewidth=2)
            image = axis.imshow(error, vmin=0, vmax=10, cmap="Blues", aspect="auto", origin="lower")
            axis.set_xticks(range(len(delays)), [f"{1e3 * delay:g}" for delay in delays], fontsize=7)
            axis.set_yticks(range(len(masses)), [f"{mass:g}" for mass in masses], fontsize=7)
            axis.set_title(f"{task}, {rate:.0f} Hz, {k / 1000:.0f} kN/m", fontsize=8)
        line[0].set_ylabel("mass, kg", fontsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("delay each way, ms", fontsize=8)
    figure.colorbar(image, ax=axes, label="mean force off by, %", shrink=0.5)
    return figure


def draw_scenes(folder):
    rows = read_table(folder / "scenes.csv")
    figure, axes = panels(2, 6)
    names = [row["scene"] for row in rows]
    axes[0].bar(names, column(rows, "largest_force_N"), color="#1f77b4")
    axes[0].axhline(12, color="#d62728", linewidth=1)
    label(axes[0], "red: the limit", "largest command, N")
    axes[1].bar(names, column(rows, "update_step_N"), color="#1f77b4")
    axes[1].axhline(0.5, color="#d62728", linewidth=1)
    label(axes[1], "red: what may not be passed", "largest step at an update, N")
    for axis in axes:
        axis.tick_params(axis="x", labelsize=8, rotation=30)
    return figure


def draw_testbed(_):
    world = read_world(TESTBED)
    from_above = [0, 1]
    figure, axes = panels(1, 6, 5)
    axis = axes[0]
    for wall in world.walls:
        axis.add_patch(Polygon(1e3 * wall.shape.outline(from_above), facecolor="#ced4da"))
    starts = [np.eye(4), *read_starts(TESTBED, world.tool)]
    for pose, name in zip(starts, ("peg", "in the hole")):
        for shape in world.held:
            axis.add_patch(Polygon(1e3 * shape.moved(pose).outline(from_above), facecolor="#a8dadc",
                                   edgecolor="#1d3557"))
        angle = math.degrees(math.atan2(pose[1, 0], pose[0, 0]))
        axis.text(*(1e3 * pose[:2, 3]), name, ha="center", va="center", fontsize=8, rotation=angle)
    axis.annotate("", (0, 105), (0, 25), arrowprops={"arrowstyle": "->", "color": "#d62828"})
    axis.text(6, 65, "0.5 N (Fig. 14)", color="#d62828", fontsize=8)
    axis.annotate("", (150, 130), (50, 130), arrowprops={"arrowstyle": "<->", "color": "#d62828"})
    axis.text(100, 126, "1 or 3 N (Figs. 16, 17)", color="#d62828", fontsize=8, ha="center")
    axis.set_xlim(-245, 245)
    axis.set_ylim(290, -265)
    axis.set_aspect("equal")
    label(axis, "x, mm", "y, mm")
    return figure


DRAW = {
    "testbed": draw_testbed,
    "fig06": draw_fig06,
    "fig09": draw_fig09,
    "fig14": draw_fig14,
    "fig16": lambda folder: draw_hole(folder, "fig16", 6),
    "fig17": lambda folder: draw_hole(folder, "fig17", 20),
    "updates": draw_updates,
    "limits": draw_limits,
    "maps": draw_maps,
    "approach": draw_approach,
    "shapes": draw_shapes,
    "ocean": draw_ocean,
    "roams": draw_roams,
    "observer": draw_observer,
    "spatial": draw_spatial,
    "collisions": draw_collisions,
    "linkages": draw_linkages,
    "bodies": draw_bodies,
    "bodylimits": draw_bodylimits,
    "holding": draw_holding,
    "held": draw_held,
    "external": draw_external,
    "scenes": draw_scenes,
}


def drawn(figure):
    """The bytes of a PNG."""
    if figure.get_layout_engine() is None:  # A colour bar's figure has its own.
        figure.tight_layout()
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=110)
    plt.close(figure)
    return data.getvalue()


def picture(figure, text):
    encoded = base64.b64encode(drawn(figure)).decode()
    return f'<img alt="{html.escape(text)}" src="data:image/png;base64,{encoded}">'


def claims_table(claims):
    lines = ["<table><tr><th></th><th>what</th><th>the paper</th><th>measured: median (range)</th>"
             "<th>criterion</th></tr>"]
    for claim in claims:
        holds = claim["holds"] == "1"
        mark = '<td class="holds">holds</td>' if holds else '<td class="fails">FAILS</td>'
        cells = "".join(f"<td>{html.escape(claim[key])}</td>"
                        for key in ("what", "paper", "measured", "criterion"))
        lines.append(f"<tr>{mark}{cells}</tr>")
    lines.append("</table>")
    return "\n".join(lines)


STYLE_SHEET = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem;
       color: #212529; }
img { max-width: 100%; }
table { border-collapse: collapse; font-size: 0.9rem; margin: 1rem 0; width: 100%; }
th, td { border-bottom: 1px solid #dee2e6; padding: 0.3rem 0.6rem; text-align: left; vertical-align: top; }
.holds, .fails { white-space: nowrap; } .wide { font-size: 0.75rem; }
.holds { color: #2b8a3e; font-weight: 600; } .fails { color: #c92a2a; font-weight: 700; }
code { background: #f1f3f5; padding: 0.1rem 0.3rem; }
.finding { border-left: 4px solid #adb5bd; padding-left: 0.8rem; margin: 0.8rem 0; }
"""


def section(folder, name, claims, findings, rerun):
    lines = [f'<h2 id="{name}">{html.escape(SECTIONS[name])}</h2>',
             f"<p>{html.escape(INTRODUCTION[name])}</p>",
             picture(DRAW[name](folder), SECTIONS[name]),
             claims_table(claims) if claims else "",
             ratios(folder) if name == "maps" else ""]
    lines += [f'<p class="finding">{html.escape(finding["text"])}</p>' for finding in findings]
    if name != "testbed":
        lines.append(f"<p>Again, alone: <code>scripts/reproduce --only {name} {html.escape(rerun)}</code></p>")
    return "\n".join(lines)


def experiment_of(path):
    return path.stem.removesuffix("_over")


def own_title(path):
    return report_over.TITLES[experiment_of(path)] + ", with your values"


def over_section(path):
    """What an experiment gave with the user's own values."""
    rows = read_table(path)
    lines = [f'<h2 id="{path.stem}">{html.escape(own_title(path))}</h2>',
             f"<p>{html.escape(report_over.WORDS[experiment_of(path)])}</p>",
             "<p>Maps: green is right with every seed, red with none; without a criterion, lighter is more. Numbers are medians over the "
             f"seeds, below them in brackets the least if it is lower by 10 %. The table: <code>{path.name}</code>, {len(rows)} rows.</p>"]
    for words, figure in report_over.pictures(rows) if rows else ():
        lines += [f"<h3>{html.escape(words)}</h3>", picture(figure, words)]
    return "\n".join(lines)


def own_files(folder):
    """Devices of the user's."""
    lines = []
    for path in sorted((folder / "inputs").glob("*")):
        lines += [f"<h3>{html.escape(path.name)}</h3>", f"<pre>{html.escape(path.read_text(encoding='utf-8'))}</pre>"]
    return "\n".join(lines)


def has_rows(folder, name):
    files = sorted(set(folder.glob(f"{name}*.csv")) - set(folder.glob("*_over.csv")))
    return bool(files) and all(read_table(file) for file in files)


def missing_cells(folder):
    """What has no results, and how to run it alone."""
    missing = read_table(folder / "missing.csv")
    if not missing:
        return ""
    lines = [f"<p class='fails'>{len(missing)} cells have no results. What needs them is left out.</p><table>",
             "<tr><th>cell</th><th>method</th><th>condition</th><th>seed</th><th>why</th>"
             "<th>alone, in the sweep's folder</th></tr>"]
    for row in missing:
        cells = [html.escape(row[name]) for name in ("cell", "method", "condition", "seed", "why")]
        lines.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) +
                     f"<td><code>{html.escape(row['command'])}</code></td></tr>")
    return "\n".join([*lines, "</table>"])


def page(folder):
    commit = json.loads((folder / "sweep.json").read_text())["program"]["commit"]
    claims = read_table(folder / "claims.csv")
    findings = read_table(folder / "findings.csv")
    parameters = read_table(folder / "parameters.csv")
    rerun = next(row["value"] for row in parameters if row["name"] == "arguments")
    # Which experiments were run shows in what they wrote.
    run = [name for name in SECTIONS if name != "testbed" and has_rows(folder, name)]
    run = ["testbed"] * bool(run) + run
    own = sorted(folder.glob("*_over.csv"))
    held = sum(claim["holds"] == "1" for claim in claims)
    title = "The paper's evaluation, reproduced" if claims or not own else "A sweep with values of your own"
    lines = ["<!doctype html><html lang='en'><head><meta charset='utf-8'>",
             "<meta name='viewport' content='width=device-width'>",
             f"<title>{title}</title>",
             f"<style>{STYLE_SHEET}</style></head><body>",
             f"<h1>{title}</h1>",
             "<p>Constantinescu, Salcudean and Croft, <em>Local model of interaction for haptic "
             "manipulation of rigid virtual worlds</em>. Every run is the product's own server tick and "
             "client frame (ODE, ε-active contacts, encoded packets), in virtual time: the same seed "
             "gives the same page.</p>",
             "<p>" + (f"<strong>{held} of {len(claims)} criteria hold.</strong> " if claims else "") +
             f"Commit <code>{html.escape(commit)}</code>; arguments <code>{html.escape(rerun)}</code>.</p>",
             missing_cells(folder),
             "<ul>"]
    lines += [f'<li><a href="#{name}">{html.escape(SECTIONS[name])}</a></li>' for name in run]
    lines += [f'<li><a href="#{path.stem}">{html.escape(own_title(path))}</a></li>' for path in own]
    lines.append("</ul>")
    for name in run:
        lines.append(section(folder, name, [c for c in claims if c["experiment"] == name],
                             [f for f in findings if f["experiment"] == name], rerun))
    lines += [over_section(path) for path in own]
    lines.append(own_files(folder))
    lines.append("<h2>Parameters</h2><p>Where the paper is silent, these are our choices.</p><table>" if claims else "<table>")
    lines += [f"<tr><td>{html.escape(row['name'])}</td><td>{html.escape(row['value'])}</td></tr>"
              for row in parameters]
    lines.append("</table></body></html>")
    return "\n".join(lines)


def main():
    parser = Arguments(__doc__)
    parser.add_argument("folder", type=pathlib.Path, help="folder that the experiments wrote to")
    parser.add_argument("--picture", choices=DRAW, metavar="EXPERIMENT",
                        help="also its picture alone, EXPERIMENT.png in the folder")
    arguments = parser.parse_args()
    target = arguments.folder / "report.html"
    try:
        if arguments.picture:
            (arguments.folder / f"{arguments.picture}.png").write_bytes(drawn(DRAW[arguments.picture](arguments.folder)))
        part = target.with_suffix(".part")
        part.write_text(page(arguments.folder), encoding="utf-8")
        part.rename(target)
    except FileNotFoundError as error:
        sys.exit(f"report.py: {error.filename}: no such table; run the experiments first")
    print(target)


if __name__ == "__main__":
    main()
