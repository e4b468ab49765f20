"""The maps of what the user's own values gave (`scripts/sweep --over`): tables NAME_over.csv."""

import collections
import math
import statistics

import matplotlib.pyplot as plt
import numpy as np

# What each experiment is, and how its pictures are read.
TITLES = {"limits": "The largest stiffness", "ocean": "What a hand perceives", "bodylimits": "Forces of bodies"}
WORDS = {
    "limits": "A peg in a hole that fits it exactly is shaken sideways at 2.5 Hz; the stiffness of its contacts is scanned from 125 N/m by "
    "octaves and then bisected to 10 %. By energy: the virtual side gives out no more than 10 mJ in any 2 s, the strict question, "
    "whether it is passive. By motion: the handle stays below 1 m/s and in the hole, the paper's question. \"> 256k\", hollow: stable to "
    "the end of the scan; \"too soft\", hollow: unstable at its beginning. Methods with four channels (those without \"direct\") reach the "
    "device through a spring of 1500 N/m: they bear any contact, and the hand feels both springs in series.",
    "ocean": "How late a wall is felt, mm; the largest force in a hole that the peg does not touch, N; a weight of 0.3 kg that is held, N; the "
    "friction of a brick that is pushed, N; the angular impulse of a door, N·m·s. Shapes: the server has them; planes: it gets contacts.",
    "bodylimits": "The force on the hand that lifts a cube from below, pushes a brick over a table, pushes it against a post (jam, 3 N), rests "
    "on a loose box and on a tower (2 N), with the body's mass of 0.3 kg unless another is given.",
}
FIXED = ("what", "unit", "criterion", "method", "seed", "value", "due", "sd", "right", "note")
SOFTEST = 125  # N/m.
MOST_PICTURES = 24  # Of one experiment; the table has all.


def number(text):
    try:
        return float(text)
    except ValueError:
        return None


def axes_of(rows):
    """Names of the conditions that were varied, those with most values first, words last."""
    names = [name for name in rows[0] if name not in FIXED]

    def rank(name):
        values = {row[name] for row in rows}
        return any(number(value) is None for value in values), -len(values)

    return sorted((name for name in names if name not in ("sense", "task")), key=rank)


def in_words(name):
    """'delay_s' as 'delay (s)'."""
    name, _, unit = name.partition("_")
    return f"{name} ({unit})" if unit else name


def values_of(rows, name):
    return sorted({row[name] for row in rows}, key=lambda text: (number(text) is None, number(text) or 0, text))


def grouped(rows, names):
    groups = collections.OrderedDict()
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups


def median(rows):
    values = [value for value in (float(row["value"]) for row in rows) if not math.isnan(value)]
    return statistics.median(values) if values else math.nan


def brief(value):
    """'256k' for 256000."""
    return f"{value / 1000:.3g}k" if abs(value) >= 1000 else f"{value:.3g}"


def shown(rows):
    """The median over the seeds, marked where a search ended there, and the least if it is another."""
    values = [float(row["value"]) for row in rows]
    middle = median(rows)
    if math.isnan(middle):
        return "–"
    notes = {row["note"] for row in rows if float(row["value"]) == middle}
    text = "too soft" if notes == {"below"} else ("> " if notes == {"beyond"} else "") + brief(middle)
    least = min(values)
    return text if least >= 0.9 * middle or middle <= 0 else f"{text}\n({brief(least)})"


def share_right(rows):
    return sum(row["right"] == "1" for row in rows) / len(rows)


def height(rows, of=statistics.median):
    """What is too soft for a search is at the search's beginning."""
    values = [SOFTEST if row["note"] == "below" else float(row["value"]) for row in rows]
    return of([value for value in values if not math.isnan(value)] or [math.nan])


def draw_lines(rows, x):
    """The value over one condition, a line for each method, with its range over the seeds; hollow where it is not right with every
    seed, or where a search ended."""
    figure, axis = plt.subplots(figsize=(9, 3.6))
    for (method,), some in grouped(rows, ["method"]).items():
        points = sorted((number(value), height(at)) for (value,), at in grouped(some, [x]).items())
        line, = axis.plot([p[0] for p in points], [p[1] for p in points], linewidth=1.2, label=method)
        for (value,), at in grouped(some, [x]).items():
            full = share_right(at) == 1 if rows[0]["criterion"] else all(not row["note"] for row in at)
            axis.plot([number(value)] * 2, [height(at, min), height(at, max)], color=line.get_color(), linewidth=0.8, alpha=0.6)
            axis.plot(number(value), height(at), "o", color=line.get_color(), markersize=5,
                      markerfacecolor=line.get_color() if full else "white")
    if rows[0]["due"] != "nan" and len({row["due"] for row in rows}) == 1:
        axis.axhline(float(rows[0]["due"]), color="#868e96", linewidth=0.8, linestyle=":", label="due")
    axis.set_xlabel(in_words(x))
    axis.set_ylabel(f"{rows[0]['what']} ({rows[0]['unit']})")
    due = number(rows[0]["due"])
    low, high = axis.get_ylim()
    if due > 0 and high - low < 0.3 * due:  # Not as if a percent were much.
        axis.set_ylim(min(low, 0.85 * due), max(high, 1.15 * due))
    if not rows[0]["criterion"]:
        axis.set_yscale("log")
        axis.yaxis.set_major_formatter(lambda value, _: brief(value))
        if high < 10 * low:
            axis.yaxis.set_minor_formatter(lambda value, _: brief(value))
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8, loc="center left", bbox_to_anchor=(1, 0.5))
    return figure


def draw_map(rows, x, y):
    """A panel for each method: green where all is right, red where nothing is; else by value."""
    methods = grouped(rows, ["method"])
    xs, ys = values_of(rows, x), values_of(rows, y)
    width = max(2.6, 0.55 * len(xs) + 1.2)
    columns = min(len(methods), 3)
    lines = -(-len(methods) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(width * columns, lines * max(2.0, 0.4 * len(ys) + 1.2)),
                                squeeze=False, sharey=True)
    for axis in axes.flat[len(methods):]:
        axis.set_visible(False)
    asked = bool(rows[0]["criterion"])
    logs = [math.log10(value) for value in (float(row["value"]) for row in rows) if 0 < value < math.inf]
    for axis, ((method,), some) in zip(axes.flat, methods.items()):
        shades = np.full((len(ys), len(xs)), np.nan)
        for (at_x, at_y), at in grouped(some, [x, y]).items():
            column, line = xs.index(at_x), ys.index(at_y)
            value = median(at)
            shades[line, column] = share_right(at) if asked else math.log10(value) if 0 < value < math.inf else math.nan
            if len(xs) <= 12 and len(ys) <= 20:
                axis.text(column, line, shown(at), ha="center", va="center", fontsize=7)
        low, high = (0, 1) if asked else (min(logs, default=0), max(logs, default=1))
        axis.imshow(shades, origin="lower", aspect="auto", cmap="RdYlGn" if asked else "viridis", vmin=low, vmax=high,
                    alpha=0.6)
        step = max(1, len(xs) // 8)
        axis.set_xticks(range(0, len(xs), step), [xs[i] for i in range(0, len(xs), step)], fontsize=7, rotation=45)
        step = max(1, len(ys) // 12)
        axis.set_yticks(range(0, len(ys), step), [ys[i] for i in range(0, len(ys), step)], fontsize=7)
        axis.set_title(method, fontsize=9)
        axis.set_xlabel(in_words(x), fontsize=8)
    for axis in axes[:, 0]:
        axis.set_ylabel(in_words(y), fontsize=8)
    return figure


def pictures(rows):
    """[(words, figure)]: for each thing that was perceived or found, over the one or two conditions with most values; apart for
    each value of the others."""
    axes = axes_of(rows)
    drawn = [name for name in axes if any(number(row[name]) is not None for row in rows) and len(values_of(rows, name)) > 1][:2]
    drawn = drawn or axes[:1]
    if len(drawn) == 1 and number(rows[0][drawn[0]]) is None and len(axes) > 1:
        drawn.append(next(name for name in axes if name not in drawn))
    others = [name for name in axes if name not in drawn]
    made = []
    for key, some in list(grouped(rows, ["what", *others]).items())[:MOST_PICTURES]:
        words = f"{key[0]} ({some[0]['unit']})"
        words += "".join(f", {in_words(name)} {value}" for name, value in zip(others, key[1:]))
        dues = {row["due"] for row in some} - {"nan"}
        if len(dues) == 1:
            words += f". Due: {brief(float(dues.pop()))}"
        if some[0]["criterion"]:
            words += f". Right: {some[0]['criterion']}"
        single = len(drawn) == 1 and number(some[0][drawn[0]]) is not None
        made.append((words, draw_lines(some, drawn[0]) if single else draw_map(some, drawn[0], drawn[-1])))
    return made
