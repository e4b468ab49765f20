#!/usr/bin/python3
"""What a frame of the Python package costs beside the engine's own, with 16 contacts, on a real session;
and track() with 192 contacts of one pair.

Usage: python_loop.py HAPTIC_SERVER LIBHAPTIC PACKAGE_FOLDER
"""

import os
import pathlib
import statistics
import sys
import time

SERVER, LIBRARY, PACKAGE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
os.environ["HAPTIC_LIBRARY"] = str(LIBRARY)
sys.path[:0] = [str(PACKAGE), str(pathlib.Path(__file__).resolve().parents[1] / "support")]

import haptic_local_model as haptic  # noqa: E402
import hand_session  # noqa: E402
import numpy as np  # noqa: E402

PERIOD = 0.002  # s
FRAMES = 2000
GRID = np.stack(np.meshgrid([-0.02, -0.007, 0.007, 0.02], [-0.02, -0.007, 0.007, 0.02]), -1).reshape(16, 2)  # m


def floor(q):
    """A floor at z = 0 below 16 points of a box of 40 mm."""
    found = haptic.contacts(16)
    found["point"][:, :2] = q[:2] + GRID
    found["normal"] = 0, 0, 1
    found["separation"] = q[2] - 0.02
    return found


def spin_until(moment):
    """Sleep would give the core to others, and the frame would pay for cold caches."""
    while time.perf_counter() < moment:
        pass


with hand_session.server(SERVER, hand_session.push(60, 0, -2)) as server, \
        haptic.Session(server.address, haptic.box(0.3, (0.04, 0.04, 0.04)), q=(0, 0, 0.021, 1, 0, 0, 0),
                       rate=1 / PERIOD) as touch:
    costs = []
    begin = time.perf_counter()
    for frame in range(1, FRAMES + 1):
        times = [time.perf_counter()]
        touch.poll()
        times.append(time.perf_counter())
        contacts = floor(touch.q)  # The engine's part.
        times.append(time.perf_counter())
        for step in (lambda: touch.sample(touch.q, touch.v, PERIOD), lambda: touch.track(contacts),
                     lambda: touch.send(contacts)):
            step()
            times.append(time.perf_counter())
        if touch.connected:
            costs.append([1e6 * (after - before) for before, after in zip(times, times[1:])])
        spin_until(begin + frame * PERIOD)
    columns = [statistics.median(column) for column in zip(*costs)]
    columns.pop(1)
    whole = statistics.median(sum(row) - row[1] for row in costs)
    print(f"{len(costs)} frames, µs: {whole:.1f} (poll {columns[0]:.1f}, sample {columns[1]:.1f}, "
          f"track {columns[2]:.1f}, send {columns[3]:.1f}); medians")

    many, places, costs = haptic.contacts(haptic.MAX_CONTACTS), np.random.default_rng(1), []
    many["point"][:, :2] = places.uniform(-0.02, 0.02, (len(many), 2))
    many["normal"] = 0, 0, 1
    for frame in range(200):
        many["point"][:, :2] += places.normal(0, 0.0005, (len(many), 2))
        begin = time.perf_counter()
        touch.track(many)
        costs.append(1e3 * (time.perf_counter() - begin))
    print(f"track() of {len(many)}, ms: median {statistics.median(costs):.2f}, largest {max(costs):.2f}")
