#!/usr/bin/env python3
"""Checks a receipt of haptic_replay --receipt against the tick log of the same session, or a tick log against the bound.

From the commanded wrenches and the poses of the handle in the tick log it adds up what the device port gave and took
between updates, by itself, and compares. Exit status 1 if any line differs by more than 1e-9 J. With --bound instead of
a receipt: if over any stretch of time t it gave more than ENERGY + POWER · t beyond what it took. A column `life`
counts the faults that a person let end, which also forgives the energy that the port owed.
"""

import csv
import math
import sys

from arguments import Arguments

TOLERANCE = 1e-9  # J


def product(a, b):
    """Of two quaternions, w x y z."""
    (aw, ax, ay, az), (bw, bx, by, bz) = a, b
    return (aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw)


def rotation_vector(q):
    if q[0] < 0:
        q = [-x for x in q]
    sine = math.hypot(*q[1:])
    scale = 2 * math.atan2(sine, q[0]) / sine if sine > 0 else 2
    return [scale * x for x in q[1:]]


def numbers(row, names):
    return [float(row[name]) for name in names]


def work(before, after, scale):
    """Of the wrench commanded in one tick on the handle's way to the next, J."""
    position = [f"device_{axis}_m" for axis in "xyz"]
    orientation = [f"device_q{part}" for part in "wxyz"]
    force = numbers(before, [f"command_force_{axis}_N" for axis in "xyz"])
    torque = numbers(before, [f"command_torque_{axis}_N_m" for axis in "xyz"])
    move = [(b - a) / scale for a, b in zip(numbers(before, position), numbers(after, position))]
    w, x, y, z = numbers(before, orientation)
    turn = rotation_vector(product(numbers(after, orientation), (w, -x, -y, -z)))
    return sum(f * d for f, d in zip(force + torque, move + turn))


def receipt_of(ticks, scale):
    """{(session, step): (given, taken)} between updates, and the totals."""
    lines, total = {}, [0.0, 0.0]
    given = taken = 0.0
    before = None
    for row in ticks:
        if row["step"] == "0":
            continue
        if before is not None and before["session"] == row["session"]:
            if int(row["step"]) != int(before["step"]) + 1:
                sys.exit(f"energy_receipt.py: the tick log lacks the steps between {before['step']} and {row['step']}")
            passed = work(before, row, scale)
            given += max(passed, 0)
            taken += max(-passed, 0)
        before = row
        if row["adopted"] != "0":
            lines[row["session"], row["step"]] = (given, taken)
            total[0] += given
            total[1] += taken
            given = taken = 0.0
    return lines, total


def compare(ticks, receipt, scale):
    """(totals of the own receipt, lines of the other one, the largest difference between the two, J)"""
    with open(ticks, encoding="utf-8", newline="") as file:
        own, total = receipt_of(csv.DictReader(file), scale)
    with open(receipt, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    largest = 0.0
    for row in rows:
        key = row["session"], row["step"]
        if key not in own:
            sys.exit(f"energy_receipt.py: {ticks} has no update in step {row['step']} of session {row['session']}")
        for mine, column in zip(own[key], ("given_J", "taken_J")):
            largest = max(largest, abs(mine - float(row[column])))
    return total, rows, largest


def largest_excess(ticks, scale, power):
    """(rows, time in s, the most in J that was given beyond what was taken and `power` (W) times time, at a stretch)"""
    rows, time, most = 0, 0.0, 0.0
    before, excess, least = None, 0.0, 0.0
    for row in ticks:
        rows += 1
        passed = float(row["time_s"]) - float((before or row)["time_s"])
        given = work(before or row, row, scale)
        if before is None or before.get("life") != row.get("life"):
            excess = least = 0.0
        else:
            time += passed
            # As a session begins the handle's place in the world is chosen anew.
            excess += (given if int(row["step"]) > 1 else 0) - power * passed
            least = min(least, excess)
            most = max(most, excess - least)
        before = row
    return rows, time, most


def check_bound(options):
    energy, power = options.bound
    with open(options.ticks, encoding="utf-8", newline="") as file:
        rows, time, most = largest_excess(csv.DictReader(file), options.scale, power)
    print(f"{rows} ticks, {time:.1f} s: at most {most:.4f} J + {power:g} W · t beyond what was taken; {energy:g} J is due")
    sys.exit(0 if rows and most <= energy else 1)


def main():
    parser = Arguments(__doc__)
    parser.add_argument("ticks", metavar="TICKS.csv", help="tick log of haptic_server")
    parser.add_argument("receipt", metavar="RECEIPT.csv", nargs="?", help="what haptic_replay --receipt wrote")
    parser.add_argument("--scale", metavar="SCALE", type=float, default=1.0,
                        help="of the device: metres in the world for each metre of the handle; default %(default)s")
    parser.add_argument("--bound", metavar=("ENERGY", "POWER"), type=float, nargs=2,
                        help="J and W: of the server's defaults 5 and 1")
    options = parser.parse_args()
    if (options.receipt is None) == (options.bound is None):
        parser.error(f"{options.ticks} is compared with one of the two: RECEIPT.csv or --bound ENERGY POWER")
    if options.bound and not all(0 <= limit < math.inf for limit in options.bound):
        parser.error(f"--bound {options.bound[0]:g} {options.bound[1]:g}: both must be finite and not negative")
    if not 0 < options.scale < math.inf:
        parser.error(f"--scale '{options.scale}' must be a number above 0")
    try:
        if options.bound:
            check_bound(options)
        total, rows, largest = compare(options.ticks, options.receipt, options.scale)
    except OSError as error:
        sys.exit(f"energy_receipt.py: {error.filename}: cannot be read: {error.strerror}")
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        what = f"{options.ticks} must be a tick log" if options.bound else \
            f"{options.ticks} and {options.receipt} must be a tick log and a receipt"
        sys.exit(f"energy_receipt.py: {what}: {'no column ' if isinstance(error, KeyError) else ''}{error}")
    print(f"{len(rows)} updates, given {total[0]:.9g} J, taken {total[1]:.9g} J, largest difference {largest:.2g} J")
    sys.exit(0 if rows and largest <= TOLERANCE else 1)


if __name__ == "__main__":
    main()
