"""Each script says how it is used, and refuses an argument that it does not know, in one line and before it sets up or
builds anything.

Usage: scripts_test.py PROJECT_FOLDER
"""

import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(sys.argv[1]).resolve()
WAIT = 60  # s; a few unless the machine is busy
# What a script installs or builds with. Here they write down that they were called.
BUILDERS = ("apt-get", "cmake", "cpack", "ctest", "dpkg-query", "ninja", "node", "npm", "sudo")
# Arguments that are refused, and what the refusal must name besides the argument that is wrong.
REFUSED = {
    ".ci/run": [(["wrong"], "--help")],
    "scripts/bench-realtime": [(["--wrong"], "--seconds"), (["wrong"], "--seconds")],
    "scripts/build": [(["wrong"], "release"), (["release", "--wrong"], "target")],
    "scripts/check": [(["wrong"], "format"), (["format", "wrong"], "threads"), (["packages:wrong"], "pybullet")],
    "scripts/compile-times": [(["wrong"], "release"), (["release", "wrong"], "COUNT"), (["--wrong"], "VARIANT")],
    "scripts/energy_receipt.py": [(["--wrong"], "TICKS.csv"), (["a.csv", "b.csv", "--scale", "wrong"], "--scale"),
                                  (["wrong.csv"], "--bound")],
    "scripts/fuzz": [(["wrong"], "decoder"), (["all", "wrong"], "SECONDS"), (["all", "1", "wrong"], "TARGET")],
    "scripts/package": [(["wrong"], "wheel"), (["deb", "wrong"], "stands alone")],
    "scripts/plot.py": [(["--wrong"], "--world"), (["a.csv", "b.png", "wrong"], "picture")],
    "scripts/report.py": [(["--wrong"], "--picture"), (["out", "wrong"], "folder"), (["out", "--picture", "wrong"], "ocean")],
    "scripts/reproduce": [(["--wrong"], "--quick"), (["--only", "wrong"], "fig06"), (["--seeds=wrong"], "number"),
                          (["--only", "fig06", "--method", "lm0", "wrong"], "lm5"), (["--quick", "wrong"], "fig06")],
    "scripts/run": [(["--wrong"], "--scene"), (["--scene", "wrong"], "testbed"), (["--device", "wrong"], "haply")],
    "scripts/setup": [(["wrong"], "bench"), (["run", "wrong"], "COMMAND")],
    "scripts/site": [(["wrong"], "--help")],
    "scripts/soak": [(["wrong"], "MINUTES"), (["1", "wrong"], "SEED"), (["1", "1", "wrong"], "MINUTES")],
    "scripts/sweep": [(["--wrong"], "--slurm"), (["wrong"], "fig06"), (["ocean", "--workers", "wrong"], "number"),
                      (["--method", "wrong"], "lm5"), (["--over", "wrong"], "NAME=VALUES"), (["--over", "wrong=1"], "stiffness"),
                      (["ocean", "--over", "wrong=1"], "outage"), (["--status", "wrong"], "sweep")],
    "scripts/test": [(["--wrong"], "-R"), (["-R", "codec", "wrong"], "--repeat")],
}
# Sourced or imported by the others.
PARTS = {"arguments.py", "environments.sh", "glibc_2.31.sh", "plot_input.py", "progress.sh", "report_over.py", "stages.sh", "sweep_drivers.py", "sweep_folder.py", "sweeps.py", "usage.sh"}

wrong = []


def run(script, arguments, builders):
    """(exit status, standard output, standard error); notes a program that installs or builds."""
    calls = builders / "calls"
    calls.write_text("")
    path = f"{builders}:{os.environ['PATH']}"
    done = subprocess.run([ROOT / script, *arguments], cwd="/", env={**os.environ, "PATH": path}, timeout=WAIT,
                          capture_output=True, text=True)
    if calls.read_text():
        wrong.append(f"{script} {' '.join(arguments)}: called {' '.join(calls.read_text().split())}")
    return done.returncode, done.stdout, done.stderr


def check_help(script, builders):
    for option in ("--help", "-h"):
        status, out, err = run(script, [option], builders)
        if status != 0 or err or "sage:" not in out or pathlib.Path(script).name not in out:
            wrong.append(f"{script} {option}: status {status}, {out!r}, {err!r}")


def check_refusal(script, arguments, allowed, builders):
    status, out, err = run(script, arguments, builders)
    named = next(part for argument in arguments for part in argument.split("=") if "wrong" in part)
    lines = err.splitlines()
    if status != 2 or out or len(lines) != 1 or named not in err or allowed not in err or \
            not err.startswith(f"{script}: "):
        wrong.append(f"{script} {' '.join(arguments)}: status {status}, {out!r}, {err!r}")


def check_names():
    """scripts/sweep reads all experiments and methods from the sources."""
    sys.path.insert(0, str(ROOT / "scripts"))
    import sweeps
    for name, listed, file, pattern in (
            ("experiments", sweeps.experiments(), "experiments/experiments.h", r"^void \w+\(Bench& bench\);"),
            ("methods", sweeps.methods(), "common/methods.h", r"\.name =")):
        there = re.findall(pattern, (ROOT / file).read_text(), re.M)
        if len(set(listed)) != len(there):
            wrong.append(f"scripts/sweep: knows {len(set(listed))} {name}, {file} has {len(there)}")


def main():
    there = {path.name for path in (ROOT / "scripts").iterdir() if path.is_file() and path.suffix != ".txt"} - PARTS
    tested = {pathlib.Path(script).name for script in REFUSED if script.startswith("scripts/")}
    wrong.extend(f"scripts/{name}: has no test here" for name in sorted(there - tested))
    check_names()
    with tempfile.TemporaryDirectory() as folder:
        builders = pathlib.Path(folder)
        for name in BUILDERS:
            (builders / name).write_text(f'#!/bin/sh\necho {name} >>"{builders}/calls"\nexit 1\n')
            (builders / name).chmod(0o755)
        for script, refused in REFUSED.items():
            check_help(script, builders)
            for arguments, allowed in refused:
                check_refusal(script, arguments, allowed, builders)
    if wrong:
        sys.exit("\n".join(wrong))
    print(f"{len(REFUSED)} scripts say how they are used and refuse what they do not know")


if __name__ == "__main__":
    main()
