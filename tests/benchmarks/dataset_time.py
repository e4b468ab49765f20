#!/usr/bin/python3
"""How large a recording of 20 contacts at 60 Hz and 1 kHz is, and how long it takes to make a data set of it.

Usage: dataset_time.py LIBHAPTIC PACKAGE_FOLDER HAPTIC_REPLAY [SECONDS] [FORMAT …]
"""

import gzip
import os
import pathlib
import sys
import tempfile
import time

LIBRARY, PACKAGE, REPLAY = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
SECONDS, FORMATS = float((sys.argv[4:5] or ["120"])[0]), sys.argv[5:] or ["hdf5", "mcap"]
os.environ.update(HAPTIC_LIBRARY=str(LIBRARY), HAPTIC_PROGRAMS=str(REPLAY.parent))
sys.path.insert(0, str(PACKAGE))

import haptic_local_model as haptic  # noqa: E402
import haptic_local_model.dataset  # noqa: E402
import haptic_local_model.virtual  # noqa: E402
import numpy as np  # noqa: E402

COUNT, PERIOD = 20, 1 / 60  # contacts; s
AROUND = np.column_stack([0.02 * np.cos(np.arange(COUNT)), 0.02 * np.sin(np.arange(COUNT)), np.full(COUNT, -0.02)])  # m


def record(recording, episodes):
    with haptic.virtual.Server("--record", str(recording)) as server:
        with haptic.Session(tool=haptic.box(0.1, [0.04] * 3), q=(0, 0, 0.021, 1, 0, 0, 0), rate=60) as touch:
            with touch.episode("press", episodes):
                while server.now < SECONDS:
                    touch.poll()
                    touch.hold((0, 0, 0.015))
                    touch.sample(touch.q, touch.v, PERIOD)
                    contacts = haptic.contacts(COUNT)
                    contacts["identity"], contacts["a_kind"] = np.arange(1, COUNT + 1), haptic.TOOL_LINK
                    contacts["point"], contacts["normal"], contacts["separation"] = touch.q[:3] + AROUND, (0, 0, 1), touch.q[2] - 0.02
                    touch.send(contacts)
                    touch.log(qpos=np.zeros(20))


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    recording = folder / "run.pcap.gz"
    record(recording, folder / "episodes")
    with gzip.open(recording) as data:
        plain = len(data.read())
    for size, kind in ((recording.stat().st_size, ".pcap.gz"), (plain, "unpacked")):
        print(f"{SECONDS:g} s recorded: {size / 1e6:.1f} MB, {3600 / SECONDS * size / 1e9:.2f} GB an hour {kind}")
    for form in FORMATS:
        begin = time.perf_counter()
        haptic.dataset.convert([recording], [folder / "episodes"], form, folder / f"set.{form}", contacts=COUNT)
        print(f"{form}: {time.perf_counter() - begin:.1f} s")
