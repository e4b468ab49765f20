"""The maps of what the user's own values gave (`scripts/sweep --over`): tables NAME_over.csv."""

import collections
import math
import statistics

import matplotlib.pyplot as plt
import numpy as np

FIXED = ("what", "unit", "criterion", "method", "seed", "value", "due", "right")
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


def share_right(rows):
    return sum(row["right"] == "1" for row in rows) / len(rows)


def draw_lines(rows, x):
    """The value over one condition, a line for each method; hollow where it is not right."""
    figure, axis = plt.subplots(figsize=(7, 3.4))
    for (method,), some in grouped(rows, ["method"]).items():
        points = [(number(value), median(at), share_right(at)) for (value,), at in grouped(some, [x]).items()]
        points.sort()
        line, = axis.plot([p[0] for p in points], [p[1] for p in points], linewidth=1.2, label=method)
        for at, value, right in points:
            axis.plot(at, value, "o", color=line.get_color(), markersize=5,
                      markerfacecolor=line.get_color() if right > 0.5 else "white")
    if rows[0]["due"] != "nan" and len({row["due"] for row in rows}) == 1:
        axis.axhline(float(rows[0]["due"]), color="#868e96", linewidth=0.8, linestyle=":", label="due")
    axis.set_xlabel(in_words(x))
    axis.set_ylabel(f"{rows[0]['what']} ({rows[0]['unit']})")
    if not rows[0]["criterion"] and all(float(row["value"]) > 0 for row in rows):
        axis.set_yscale("log")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8)
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
                axis.text(column, line, f"{value:.3g}", ha="center", va="center", fontsize=7)
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
    shown = [name for name in axes if any(number(row[name]) is not None for row in rows) and len(values_of(rows, name)) > 1][:2]
    shown = shown or axes[:1]
    if len(shown) == 1 and number(rows[0][shown[0]]) is None and len(axes) > 1:
        shown.append(next(name for name in axes if name not in shown))
    others = [name for name in axes if name not in shown]
    made = []
    for key, some in list(grouped(rows, ["what", *others]).items())[:MOST_PICTURES]:
        words = f"{key[0]} ({some[0]['unit']})"
        words += "".join(f", {in_words(name)} {value}" for name, value in zip(others, key[1:]))
        if some[0]["criterion"]:
            words += f". Right: {some[0]['criterion']}"
        single = len(shown) == 1 and number(some[0][shown[0]]) is not None
        made.append((words, draw_lines(some, shown[0]) if single else draw_map(some, shown[0], shown[-1])))
    return made
