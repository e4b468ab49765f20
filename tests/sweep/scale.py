#!/usr/bin/python3
"""Measures sweeps: 100,000 cells listed and merged, the speed-up of two workers over one, and what Slurm adds at a minute a job.

Usage: scale.py EXPERIMENTS [list|workers|slurm …]     all of them by default. On a machine that does nothing else.
"""

import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

from slurm_bed import SlurmBed

PROGRAM = pathlib.Path(sys.argv[1]).resolve()
SWEEP = pathlib.Path(__file__).resolve().parents[2] / "scripts/sweep"
SEEDS = 25_000  # Of Fig. 6, four cells each.
HEAVY = ["roams", "holding", "--quick", "--seed", "1"]  # 300 cells, 80 s of one core.


def seconds(run):
    began = time.monotonic()
    run()
    return time.monotonic() - began


def call(*arguments, **options):
    return subprocess.run([*map(str, arguments)], check=False, capture_output=True, text=True, **options)


def measure_list(root):
    """The files of all cells but one are made up: with that one's results."""
    folder = root / "many"
    chosen = ["--only", "fig06", "--seeds", SEEDS]
    listed = []
    listing = seconds(lambda: listed.extend(call(PROGRAM, *chosen, "--list-cells").stdout.splitlines()))
    call(PROGRAM, *chosen, "--out", folder, "--begin")
    call(PROGRAM, "--out", folder, "--cell", "fig06-00002")
    one = json.loads((folder / "cells/fig06/fig06-00002.json").read_text())
    for line in listed:
        name, _, method, condition, seed, _ = line.split("\t")
        one["cell"] = name
        one["inputs"] = {"method": method, "rate_hz": float(condition.split()[1]), "seed": float(seed)}
        (folder / f"cells/fig06/{name}.json").write_text(json.dumps(one))
    status = call(PROGRAM, "--out", folder, "--status").stdout.strip()
    merging = seconds(lambda: call(PROGRAM, "--out", folder, "--merge"))
    print(f"{len(listed)} cells: listed in {listing:.2f} s, merged in {merging:.1f} s ({status})")


def sweep(folder, *arguments, **options):
    done = call(SWEEP, *arguments, "--program", PROGRAM, "--out", folder, **options)
    if done.returncode not in (0, 1):
        sys.exit(done.stdout + done.stderr)


def measure_workers(root):
    times = {1: [], 2: []}
    for repeat in range(2):
        for workers, taken in times.items():
            taken.append(seconds(lambda: sweep(root / f"w{workers}_{repeat}", *HEAVY, "--workers", workers)))
    ratios = [one / two for one, two in zip(times[1], times[2])]
    print(f"two workers: {' and '.join(f'{ratio:.2f}' for ratio in ratios)} times as quick as one, which takes {min(times[1]):.0f} s")


def measure_slurm(root):
    """Jobs of about a minute on two cores, side by side with two workers."""
    chosen = ["roams", "--seed", "1", "--job", "84.5"]
    here = seconds(lambda: sweep(root / "here", *chosen, "--workers", 2))
    with SlurmBed(root / "bed") as slurm:
        there = seconds(lambda: sweep(root / "slurm", *chosen, "--slurm", "--partition=both", "--wait",
                                      env=slurm.environment()))
    jobs = len(list((root / "slurm/jobs").glob("*/*")))
    print(f"Slurm: {jobs} jobs in {there:.1f} s, two workers {here:.1f} s: {100 * (there / here - 1):+.1f} %")


def main():
    measures = {"list": measure_list, "workers": measure_workers, "slurm": measure_slurm}
    root = pathlib.Path(tempfile.mkdtemp())
    try:
        for name in sys.argv[2:] or measures:
            measures[name](root)
    finally:
        shutil.rmtree(root)


if __name__ == "__main__":
    main()
