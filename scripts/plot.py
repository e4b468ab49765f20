#!/usr/bin/python3
"""Draws one picture of a session from the tick log that haptic_server writes."""

import math
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Polygon

from arguments import Arguments
from plot_input import (
    InputError,
    phases_from_hand,
    matrix,
    phases_from_states,
    read_log,
    read_world,
    rotation_of,
)

# Line styles: the later ones are drawn on top, so that coinciding lines stay visible.
STYLES = {
    "tool": dict(color="#f4a261", linewidth=4.5, label="virtual tool (environment)"),
    "proxy": dict(color="#2a9d8f", linewidth=2.2, label="proxy (local model)"),
    "device": dict(color="#1d3557", linewidth=0.9, label="device (hand)"),
}
FORCE_STYLES = {
    "hand": dict(color="#8d99ae", linewidth=3.2, label="hand on device"),
    "env": dict(color="#e76f51", linewidth=1.8, label="virtual contacts on hand"),
    "command": dict(color="#1d3557", linewidth=0.7, label="device on hand (command)"),
}
STATE_COLOURS = {
    "contact": "#fde2d4",
    "no session": "#e5e5e5",
    "fading": "#fff3b0",
    "fault": "#f28482",
}
# Colour of the numbers that link phases and places.
MARK = "#e63946"
# Marks nearer than this, m, share one name.
SAME_PLACE = 0.012
# Length of the close-up, s.
CLOSE_UP = 2.0
# A force whose components stay within this for one SLOT, N, is constant there.
CONSTANT_FORCE = 0.05
SLOT = 0.1  # s
# Smallest drift shown, mm: 0 has no place on a logarithmic axis.
LEAST_DRIFT = 1e-3
# Smallest ranges shown: less is at rest, or nothing.
LEAST_MM, LEAST_DEGREES, LEAST_NEWTONS = 10, 5, 1
# Bins over the session in which tick times are reduced to their maximum.
TIMING_BINS = 800


def heading(log, subject):
    """Rotation angle, degrees: about z where the tool is planar, else about its axis."""
    w, x, y, z = (log[f"{subject}_q{part}"] for part in "wxyz")
    if is_planar(log):
        return np.degrees(np.unwrap(2 * np.arctan2(z, w), period=2 * math.pi))
    return np.degrees(2 * np.arctan2(np.sqrt(x * x + y * y + z * z), np.abs(w)))


def is_planar(log):
    tolerance = 1e-9  # m, and half a rotation angle in rad.
    session = log["session"] > 0  # Outside sessions the frames mean nothing.
    if not session.any():
        return True
    still = np.ptp(log["proxy_z_m"][session]) < tolerance
    tilt = np.hypot(log["proxy_qx"], log["proxy_qy"])[session]
    return bool(still and np.all(tilt < tolerance))


def distance(log, a, b):
    """Between the origins of two frames, mm."""
    squares = sum((log[f"{a}_{axis}_m"] - log[f"{b}_{axis}_m"]) ** 2 for axis in "xyz")
    return 1e3 * np.sqrt(squares)


def in_session(log, values):
    """Nothing outside sessions: there the frames mean nothing."""
    return np.where(log["session"] > 0, values, np.nan)


def show_at_least(axes, span):
    """So that a line at rest is a line, and not its last digits."""
    low, high = axes.get_ylim()
    missing = max(0, span - (high - low)) / 2
    axes.set_ylim(low - missing, high + missing)


def draw_positions(axes, log, axis, least=LEAST_MM):
    for subject in ("tool", "proxy", "device"):
        values = in_session(log, 1e3 * log[f"{subject}_{axis}_m"])
        axes.plot(log["time_s"], values, **STYLES[subject])
    axes.set_ylabel(f"position {axis}\nmm")
    show_at_least(axes, least)
    if axis == "y" and is_planar(log):
        axes.invert_yaxis()


def draw_heading(axes, log):
    for subject in ("tool", "proxy", "device"):
        axes.plot(log["time_s"], in_session(log, heading(log, subject)), **STYLES[subject])
    axes.set_ylabel("heading\n°" if is_planar(log) else "rotation\n°")
    show_at_least(axes, LEAST_DEGREES)


def draw_drift(axes, log):
    for pair, style, label in (
        (("proxy", "tool"), STYLES["tool"], "proxy to virtual tool\n(as last reported)"),
        (("device", "proxy"), STYLES["device"], "device to proxy"),
    ):
        drift = in_session(log, np.maximum(distance(log, *pair), LEAST_DRIFT))
        axes.plot(log["time_s"], drift, color=style["color"], linewidth=1, label=label)
    axes.set_ylabel("drift\nmm")
    axes.set_yscale("log")


def draw_force(axes, log, axis):
    for subject, style in FORCE_STYLES.items():
        if subject == "hand" and not log["hand_measured"].any():
            continue
        axes.plot(log["time_s"], log[f"{subject}_force_{axis}_N"], **style)
    axes.set_ylabel(f"force {axis}\nN")
    show_at_least(axes, LEAST_NEWTONS)


def draw_separation(axes, log):
    present = log["active_contacts"] + log["predicted_contacts"] > 0
    separation = np.where(present, 1e3 * log["smallest_separation_m"], np.nan)
    axes.axhline(0, color="black", linewidth=0.6)
    axes.plot(log["time_s"], separation, color="#6a4c93", linewidth=1, label="smallest separation")
    axes.set_ylabel("separation\nmm")


def draw_contacts(axes, log):
    axes.stackplot(
        log["time_s"],
        log["active_contacts"],
        log["predicted_contacts"],
        step="post",
        colors=("#e76f51", "#cdb4db"),
        labels=("active (touching)", "predicted (near)"),
    )
    axes.set_ylabel("local\ncontacts")
    axes.yaxis.get_major_locator().set_params(integer=True)


def draw_timing(axes, log):
    time = log["time_s"]
    edges = np.linspace(time[0], time[-1], TIMING_BINS + 1)
    starts = np.unique(np.searchsorted(time, edges[:-1]))
    starts = starts[starts < len(time)]
    for column, colour, label in (
        ("lateness_s", "#457b9d", "lateness of the tick"),
        ("execution_s", "#2a9d8f", "its execution"),
    ):
        largest = np.maximum(1e6 * np.maximum.reduceat(log[column], starts), 0.1)
        axes.step(time[starts], largest, where="post", color=colour, linewidth=0.9, label=label)
    axes.axhline(1e6 * period(log), color=MARK, linewidth=1, linestyle="--", label="period")
    missed = time[1:][np.diff(log["overruns"]) > 0]
    if len(missed):
        axes.plot(missed, np.full(len(missed), 1e6 * period(log)), "rx", label="missed periods")
    axes.set_yscale("log")
    axes.set_ylabel("tick time\n(largest)\nµs")


def period(log):
    return float(np.median(np.diff(log["time_s"]))) if len(log["time_s"]) > 1 else math.nan


def draw_view(axes, log, world, phases):
    """Paths seen from above, or from the side where the tool moves in space; the held link's outline where
    each phase begins and at the end."""
    planar = is_planar(log)
    view, (along, across) = ([0, 1], "xy") if planar else ([0, 2], "xz")
    if world:
        draw_bodies(axes, world, view)
    for subject in ("tool", "proxy", "device"):
        x, y = (in_session(log, 1e3 * log[f"{subject}_{axis}_m"]) for axis in (along, across))
        axes.plot(x, y, **STYLES[subject])
    for i, names in marked_ticks(log, phases, (along, across)):
        pose = tool_pose(log, i)
        for shape in world.held if world else []:
            draw_shape(axes, shape.moved(pose), view, edgecolor="#f4a261")
        x, y = 1e3 * pose[view, 3]
        axes.plot(x, y, "o", color=MARK, markersize=4, zorder=5)
        offset = dict(xytext=(6, 6), textcoords="offset points", zorder=5)
        axes.annotate(", ".join(names), (x, y), color=MARK, fontsize=11, **offset)
    down = ", mm (down the page)" if planar else ", mm"
    axes.set(xlabel="x, mm", ylabel=across + down, aspect="equal")
    axes.autoscale_view()
    if planar:
        axes.invert_yaxis()
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3, frameon=False)
    title = f"Seen from {'above' if planar else 'the side'}. Numbers: where each phase begins"
    if world and world.loose:
        title += "\ndashed: what moves, where it begins"
    if world and world.left_out:
        title += "\nnot drawn: " + ", ".join(sorted(set(world.left_out)))
    axes.set_title(title)


def draw_bodies(axes, world, view):
    """The world where it begins, with the names of its models."""
    loose = dict(facecolor="#e9f2f9", edgecolor="#457b9d", linestyle="--")
    link = dict(facecolor="#fdf1e7", edgecolor="#f4a261", linestyle="--")
    fixed = dict(facecolor="#d9d9d9", edgecolor="#8c8c8c")
    names = {}  # of what is seen at one place, in mm
    for bodies, style in ((world.walls, fixed), (world.loose, loose), (world.links, link)):
        named = set()
        for body in bodies:
            outline = 1e3 * body.shape.outline(view)
            draw_shape(axes, body.shape, view, **style)
            if body.name not in named:
                centre = tuple(np.round((outline.min(axis=0) + outline.max(axis=0)) / 2))
                names.setdefault(centre, []).append(body.name.replace("_", " "))
            named.add(body.name)
    for centre, those in names.items():
        style = dict(ha="center", va="center", fontsize=9, color="#555555", clip_on=True)
        axes.text(*centre, "\n".join(those), **style)


def draw_shape(axes, shape, view, edgecolor, facecolor="none", linestyle="-"):
    """Of a mesh its triangles, and the edges at which those that face the viewer end."""
    if shape.triangles is None:
        outline = 1e3 * shape.outline(view)
        axes.add_patch(Polygon(outline, facecolor=facecolor, edgecolor=edgecolor, linestyle=linestyle, linewidth=1))
        return
    triangles, edges = (1e3 * part for part in shape.contours(view))
    if facecolor != "none":
        axes.add_collection(PolyCollection(triangles, facecolor=facecolor, edgecolor=facecolor, linewidth=0.5, zorder=1))
    axes.add_collection(LineCollection(edges, colors=edgecolor, linestyle=linestyle, linewidth=0.8, zorder=1))


def tool_pose(log, tick):
    """Of the hand's frame on the tool, as a matrix."""
    position = [log[f"tool_{axis}_m"][tick] for axis in "xyz"]
    return matrix(position, rotation_of(*(log[f"tool_q{part}"][tick] for part in "wxyz")))


def marked_ticks(log, phases, axes):
    """Ticks at which a phase begins or the session ends, those at one place of the view under one name."""
    session = np.flatnonzero(log["session"] > 0)
    begins = [np.searchsorted(log["time_s"], phase.begin) for phase in phases]
    named = [(i, str(n)) for n, i in enumerate(begins, start=1) if log["session"][i] > 0]
    if len(session):
        named.append((session[-1], "end"))
    marks = []
    for i, name in named:
        for j, names in marks:
            away = math.dist(*([log[f"tool_{axis}_m"][k] for axis in axes] for k in (i, j)))
            if away < SAME_PLACE:
                names.append(name)
                break
        else:
            marks.append((i, [name]))
    return marks


def find_close_up(log):
    """(when a stretch of CLOSE_UP begins; whether the force changes in it): the latest of those in which it changes
    most of the time, with the force fully on; (None, False) without a session."""
    time = log["time_s"]
    on = np.flatnonzero((log["session"] > 0) & (log["server_state"] == "active"))
    if not len(on):
        on = np.flatnonzero(log["session"] > 0)
    if not len(on):
        return None, False
    slots = ((time[on] - time[on[0]]) / SLOT).astype(int)
    starts = np.flatnonzero(np.diff(slots, prepend=-1))
    forces = np.array([log[f"command_force_{axis}_N"][on] for axis in "xyz"])
    swing = np.maximum.reduceat(forces, starts, axis=1) - np.minimum.reduceat(forces, starts, axis=1)
    changing = np.zeros(slots[-1] + 1)
    changing[slots[starts]] = swing.max(axis=0) > CONSTANT_FORCE
    width = min(round(CLOSE_UP / SLOT), len(changing))
    changes = np.convolve(changing, np.ones(width), "valid")
    chosen = np.flatnonzero(changes == changes.max())[-1]
    return time[on[0]] + chosen * SLOT, changes[chosen] > 0


def draw_close_up(position, force, log):
    """A stretch of changing force, along the axis of the largest change there."""
    begin, changes = find_close_up(log)
    if begin is None:
        position.axis("off")
        force.axis("off")
        return
    shown = (log["session"] > 0) & (log["time_s"] >= begin) & (log["time_s"] <= begin + CLOSE_UP)
    part = {name: values[shown] for name, values in log.items()}
    axis = max("xyz", key=lambda a: np.ptp(part[f"command_force_{a}_N"]))
    draw_positions(position, part, axis, least=0)
    draw_force(force, part, axis)
    position.set_title(f"Close-up: {CLOSE_UP:g} s of " + ("changing force" if changes else "constant force, the last of it"))
    force.set_xlabel("time since the server started, s")
    for axes in (position, force):
        axes.grid(alpha=0.3)
        axes.ticklabel_format(useOffset=False)


def draw_phases(panels, phases, log):
    """Numbers the phases above the panels and shades what the server was doing."""
    for phase in phases_from_states(log):
        if phase.label in STATE_COLOURS:
            for axes in panels:
                axes.axvspan(phase.begin, phase.end, color=STATE_COLOURS[phase.label], zorder=0)
    for i, phase in enumerate(phases, start=1):
        for axes in panels:
            axes.axvline(phase.begin, color=MARK, linewidth=0.5, zorder=1)
        middle = (phase.begin + phase.end) / 2, 1.04
        style = dict(xycoords=("data", "axes fraction"), color=MARK, ha="center", fontsize=11)
        panels[0].annotate(str(i), middle, **style)


def write_key(axes, phases, log):
    """What the numbers and the shades mean."""
    axes.axis("off")
    lines = [f"{i:2}  {p.begin:5.1f} s  {p.label}" for i, p in enumerate(phases, start=1)]
    axes.text(0, 1, "Phases\n" + "\n".join(lines), va="top", family="monospace", fontsize=10)
    shades = {p.label for p in phases_from_states(log)} & STATE_COLOURS.keys()
    handles = [plt.Rectangle((0, 0), 1, 1, color=STATE_COLOURS[s], label=s) for s in sorted(shades)]
    if handles:
        axes.legend(handles=handles, loc="upper right", title="Shaded times")


def title_of(world):
    if world is None:
        return "Haptic session"
    held = f", held: {world.tool}" if world.tool else ""
    return f"{world.name}{held}. {world.description}"


def summary(log):
    time = log["time_s"]
    duration = time[-1] - time[0]
    rate = (len(time) - 1) / duration if duration > 0 else math.nan
    force = np.sqrt(sum(log[f"command_force_{axis}_N"] ** 2 for axis in "xyz"))
    late = 1e6 * np.percentile(log["lateness_s"], (50, 99, 100))
    line = [
        f"{duration:.1f} s, {len(time)} ticks at {rate:.1f} Hz, {log['overruns'][-1]:.0f} missed",
        f"lateness p50 {late[0]:.0f}, p99 {late[1]:.0f}, max {late[2]:.0f} µs",
        f"{np.count_nonzero(log['adopted'])} contact updates adopted",
        f"{log['datagrams'][-1]:.0f} datagrams, {log['dropped'][-1]:.0f} dropped",
    ]
    second = [f"peak force {force.max():.2f} N"]
    running = np.isin(log["server_state"], ["ramping", "active"])
    for a, b, name in (("device", "proxy", "device-proxy"), ("proxy", "tool", "proxy-tool")):
        if running.any():
            drift = distance(log, a, b)[running]
            second.append(f"{name} drift: largest {drift.max():.2f}, last {drift[-1]:.2f} mm")
    return " | ".join(line) + "\n" + " | ".join(second)


def explain_lines(axes, explained):
    """A legend beside the panel, of the lines that no panel above has explained."""
    handles, labels = axes.get_legend_handles_labels()
    new = [(h, l) for h, l in zip(handles, labels) if l not in explained]
    explained.update(labels)
    if new:
        axes.legend(*zip(*new), loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)


def draw(log, world, phases):
    planar = is_planar(log)
    axes_shown = "xy" if planar else "xyz"
    painters = (
        [lambda axes, a=a: draw_positions(axes, log, a) for a in axes_shown]
        + [lambda axes: draw_heading(axes, log), lambda axes: draw_drift(axes, log)]
        + [lambda axes, a=a: draw_force(axes, log, a) for a in axes_shown]
        + [lambda axes: draw_separation(axes, log), lambda axes: draw_contacts(axes, log)]
        + [lambda axes: draw_timing(axes, log)]
    )
    figure = plt.figure(figsize=(20, 14), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=(1, 1.5))
    plan, key, position, force = left.subplots(4, 1, height_ratios=(5, 1.8, 1.3, 1.3))
    panels = right.subplots(len(painters), 1, sharex=True)
    explained = set()
    for axes, paint in zip(panels, painters):
        paint(axes)
        axes.grid(alpha=0.3)
        explain_lines(axes, explained)
    panels[-1].set_xlabel("time since the server started, s")
    panels[-1].set_xlim(log["time_s"][0], log["time_s"][-1])
    draw_phases(panels, phases, log)
    draw_view(plan, log, world, phases)
    write_key(key, phases, log)
    draw_close_up(position, force, log)
    figure.suptitle(title_of(world) + "\n" + summary(log), fontsize=12)
    return figure


def main():
    parser = Arguments(__doc__)
    parser.add_argument("log", help="tick log (CSV) of haptic_server")
    parser.add_argument("picture", help="picture to write (PNG)")
    parser.add_argument("--world", help="SDF file whose bodies are drawn where they begin")
    parser.add_argument("--hand", help="hand script (TOML) whose segments name the phases")
    options = parser.parse_args()
    try:
        log = read_log(options.log)
        world = read_world(options.world) if options.world else None
        phases = phases_from_hand(options.hand, log) if options.hand else []
        figure = draw(log, world, phases or phases_from_states(log))
        figure.savefig(options.picture, dpi=100)
    except InputError as error:
        sys.exit(f"plot.py: {error}")
    except (OSError, ValueError) as error:
        sys.exit(f"plot.py: {options.picture}: cannot be written: {error}")


if __name__ == "__main__":
    main()
