"""The command line of scripts/sweep and scripts/reproduce."""

import argparse
import fcntl
import math
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys

from arguments import Arguments
from sweep_drivers import Slurm, run_by_ssh, run_here, take_in
from sweep_folder import PROJECT, Refused, Sweep

JOB = 60  # s: what a job takes, about.
# So often is a cell tried whose worker ends without a word: whether it is the last time, and which cells are tried.
TRIES = ((False, {"left", "failed"}), (False, {"left"}), (True, {"left"}))


def names_in(file, pattern):
    """What the program knows, from its sources: before it is built."""
    return re.findall(pattern, (PROJECT / file).read_text(), re.M)


def experiments():
    return names_in("experiments/sweep.cc", r'^    \{"(\w+)", \w+, [\d.]+')


def methods():
    return names_in("common/methods.h", r'{\.name = "([\w-]+)",')


def conditions():
    """Of each experiment that takes values of one's own."""
    return {name: names_in(f"experiments/{file}.cc", r'^  table\.\w+\("([\w-]+)"')
            for name, file in (("limits", "stiffness_limits"), ("bodylimits", "body_limits"), ("ocean", "ocean"))}


def hosts(text):
    """HOST, HOST:JOBS or GNU parallel's JOBS/HOST, apart by commas; as parallel has them."""
    if not all(text.split(",")):
        raise argparse.ArgumentTypeError(f"'{text}' must be HOST or HOST:JOBS, apart by commas")
    return ",".join(re.sub(r"^(.+):(\d+)$", r"\2/\1", host) for host in text.split(","))


def whole(text):
    if not re.fullmatch(r"[1-9]\d{0,8}", text):
        raise argparse.ArgumentTypeError(f"'{text}' must be a whole number of 1 or more")
    return int(text)


def folder(text):
    if not text:
        raise argparse.ArgumentTypeError("'' must be a folder")
    return text


def duration(text):
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"'{text}' must be above 0, in seconds")
    return value


def add_selection(parser):
    known = ", ".join(experiments())
    parser.add_argument("experiments", nargs="*", metavar="EXPERIMENT", help=f"only these: {known}")
    parser.add_argument("--only", nargs="+", action="extend", default=[], metavar="EXPERIMENT", help="the same")
    parser.add_argument("--quick", action="store_true", help="fewer seeds and cases")
    parser.add_argument("--method", nargs="+", action="extend", default=[], metavar="METHOD",
                        help=f"only these methods; claims that compare methods are left out: {', '.join(methods())}")
    parser.add_argument("--over", action="append", default=[], metavar="NAME=VALUES",
                        help="values of your own for a condition: numbers with units, FIRST:LAST:COUNT, FIRST:LAST:COUNTlog, or "
                        "files of devices, apart by commas; each is run with each of the others'. An unknown NAME is answered "
                        "by those that there are. For limits, bodylimits and ocean")
    parser.add_argument("--seed", type=whole, default=1, metavar="N", help="the first seed, 1 unless given")
    parser.add_argument("--seeds", type=whole, metavar="N",
                        help="how many seeds, one run each: 20 unless given, with --quick 5")


def selection(arguments):
    chosen = ["--seed", str(arguments.seed), *(["--seeds", str(arguments.seeds)] if arguments.seeds else [])]
    for name in arguments.experiments + arguments.only:
        if name not in experiments():
            raise Refused(f"experiment '{name}' must be one of {', '.join(experiments())}")
        chosen += ["--only", name]
    for name in arguments.method:
        if name not in methods():
            raise Refused(f"method '{name}' must be one of {', '.join(methods())}")
        chosen += ["--method", name]
    for text in arguments.over:
        if not re.fullmatch("[^=]+=.+", text):
            raise Refused(f"--over '{text}' must be NAME=VALUES")
        of = set(arguments.experiments + arguments.only) or set(conditions())
        if not of <= set(conditions()):
            raise Refused(f"--over must go with {', '.join(conditions())}, not with {', '.join(of - set(conditions()))}")
        known = {name for each in of for name in conditions()[each]}
        if (name := text.partition("=")[0].strip()) not in known:
            raise Refused(f"--over '{name}' must be one of {', '.join(sorted(known))}")
        chosen += ["--over", text]
    return chosen + ["--quick"] * arguments.quick


def parsed(description, out, replace):
    parser = Arguments(description)
    add_selection(parser)
    parser.add_argument("--out", type=folder, metavar="FOLDER", help=f"of the sweep: {out} of this project unless given")
    parser.add_argument("--replace", action="store_true",
                        help="another sweep in that folder is removed" + (", as without --out" if replace else ""))
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", "--jobs", type=whole, default=os.cpu_count(), metavar="N",
                       help="processes on this machine: as many as there are processors, unless given")
    where.add_argument("--ssh", type=hosts, metavar="HOSTS",
                       help="on these machines: HOST or HOST:JOBS, apart by commas; ':' is this one. By GNU parallel")
    where.add_argument("--slurm", metavar="OPTIONS", help="by Slurm, with these options of sbatch; the folder must be shared")
    parser.add_argument("--wait", action="store_true", help="with --slurm: until all has run")
    parser.add_argument("--job", type=duration, default=JOB, metavar="SECONDS", help=f"what a job takes, about: {JOB} unless given")
    parser.add_argument("--program", type=pathlib.Path, metavar="FILE", help="built already; nothing is set up or built")
    alone = parser.add_mutually_exclusive_group()
    alone.add_argument("--status", type=folder, metavar="FOLDER", help="what is done, failed and left; stands alone")
    alone.add_argument("--merge", type=folder, metavar="FOLDER", help="tables and page of what has run; stands alone")
    arguments = parser.parse_args()
    if (arguments.status is not None or arguments.merge is not None) and len(sys.argv) > 3:
        parser.error("--status FOLDER and --merge FOLDER must stand alone")
    if arguments.wait and arguments.slurm is None:
        parser.error("--wait must go with --slurm")
    if replace and arguments.out is None:
        arguments.replace = True
        if (PROJECT / out / "claims.csv").exists() and not (PROJECT / out / "sweep.json").exists():
            shutil.rmtree(PROJECT / out)  # Of an earlier version.
    arguments.out = arguments.out or PROJECT / out
    return arguments


def run(arguments):
    """Returns the status to end with."""
    if arguments.status is not None:
        return Sweep(arguments.status).run("--status").returncode
    if arguments.merge is not None:
        return Sweep(arguments.merge).merge()
    chosen = selection(arguments)
    sweep = Sweep(arguments.out)
    sweep.lock()
    sweep.begin(arguments.program or build(), chosen, arguments.replace)
    take_in(sweep)
    if arguments.slurm is not None:
        return run_by_slurm(sweep, arguments)
    for last, states in TRIES:
        cells = sweep.left(states)
        # Of what ended its worker twice nothing is known: it must not take others with it.
        seconds = 0 if last else arguments.job
        if not cells or not (run_by_ssh(sweep, cells, arguments.ssh, seconds) if arguments.ssh else
                             run_here(sweep, cells, arguments.workers, seconds)):
            break
    return sweep.merge()


def run_by_slurm(sweep, arguments):
    slurm = Slurm(sweep, arguments.slurm)
    for last, states in TRIES:
        cells = sweep.left(states)
        if not cells:
            break
        arrays = slurm.submit_cells(cells, 0 if last else arguments.job)
        if not arguments.wait:
            print(f"{len(cells)} cells in array {', '.join(arrays)}; job {slurm.submit_merge(arrays)} makes the page. How far they "
                  f"are: scripts/sweep --status {sweep.folder}")
            return 0
        slurm.wait(arrays)
    return sweep.merge()


def build():
    """One at a time."""
    with open(PROJECT / "scripts/build", encoding="utf-8") as script:
        fcntl.flock(script, fcntl.LOCK_EX)
        return built()


def built():
    subprocess.run([PROJECT / "scripts/setup", "run"], check=True)
    subprocess.run([PROJECT / "scripts/build", "release", "experiments"], check=True)
    return PROJECT / "build/release/experiments/experiments"


def main(description, out, replace=False):
    """replace: another sweep in the folder is removed."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) != signal.SIG_IGN:  # As nohup has it.
            signal.signal(number, signal.default_int_handler)
    if len(sys.argv) == 1 and not replace:
        sys.argv.append("--help")
    if "--slurm" in sys.argv[:-1]:  # Its value begins with dashes, too.
        at = sys.argv.index("--slurm")
        sys.argv[at:at + 2] = [f"--slurm={sys.argv[at + 1]}"]
    try:
        sys.exit(run(parsed(description, out, replace)))
    except Refused as refused:
        complain(refused)
    except subprocess.CalledProcessError as error:  # It has said why.
        sys.exit(error.returncode)
    except OSError as error:
        complain(f"{error.filename}: {error.strerror}")
    except KeyboardInterrupt:
        print("What has run stays; the same command goes on.", file=sys.stderr)
        sys.exit(130)


def complain(text):
    print(f"scripts/{pathlib.Path(sys.argv[0]).name}: {text}", file=sys.stderr)
    sys.exit(2)
