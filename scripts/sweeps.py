"""Sweeps: the cells of the experiments, run by workers of this machine, on others by ssh, or by Slurm, and the page of what
they give. A sweep is a folder: sweep.json says what it is, program/ runs its cells, cells/ has a file for each."""

import argparse
import concurrent.futures
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tarfile
import time

from arguments import Arguments

PROJECT = pathlib.Path(__file__).resolve().parent.parent
PASSES = 3  # So often is a cell tried whose worker ends without a word.
JOB = 60  # s: what a job of a cluster takes, about.


class Refused(Exception):
    """One line that names what cannot be used, and what can."""


def names_in(file, pattern):
    """What the program knows, from its sources: before it is built."""
    return re.findall(pattern, (PROJECT / file).read_text(), re.M)


def experiments():
    return names_in("tests/experiments/sweep.cc", r'^    \{"(\w+)", \w+, [\d.]+')


def methods():
    return names_in("common/methods.h", r'{\.name = "([\w-]+)",')


# The folder


class Sweep:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder).resolve()
        self.program = self.folder / "program" / "experiments"

    def command(self, *arguments):
        return [str(self.program), "--out", str(self.folder), *map(str, arguments)]

    def run(self, *arguments, **options):
        if not self.program.exists():
            raise Refused(f"{self.folder} holds no sweep")
        return subprocess.run(self.command(*arguments), check=False, text=True, **options)

    def begin(self, built, selection, replace):
        """The folder holds this sweep, and the program that runs its cells."""
        begun = subprocess.run([built, "--out", self.folder, "--begin", *selection, *["--replace"][:replace]], check=False)
        if begun.returncode != 0:
            sys.exit(begun.returncode)
        if self.program.exists() and self.program.read_bytes() == built.read_bytes():
            return
        shutil.rmtree(self.program.parent, ignore_errors=True)
        shutil.copytree(PROJECT / "worlds", self.program.parent / "worlds")
        shutil.copy2(built, self.program)
        for script in (PROJECT / "scripts/sweeping").iterdir():
            shutil.copy2(script, self.program.parent)

    def add_libraries(self):
        """What the program needs of this system, but for the C library: other machines may not have it."""
        target = self.program.parent / "lib"
        listed = subprocess.run(["ldd", self.program], check=True, capture_output=True, text=True).stdout
        target.mkdir(exist_ok=True)
        for name, path in re.findall(r"(\S+) => (\S+)", listed):
            if not re.match(r"(libc|libm|libdl|librt|libpthread|libresolv|ld-linux.*)\.so", name) and not (target / name).exists():
                shutil.copy2(path, target / name)

    def left(self, states):
        """[(name, cost)] of the cells that are "left" or "failed", dear ones first."""
        listed = self.run("--status", "--list-cells", stdout=subprocess.PIPE)
        if listed.returncode != 0:
            sys.exit(listed.returncode)
        rows = [line.split("\t") for line in listed.stdout.splitlines()]
        return sorted(((row[0], float(row[5])) for row in rows if row[6] in states), key=lambda cell: -cell[1])

    def write_jobs(self, cells, seconds):
        """Lists of cells that take so long together, about. Returns how many there are: jobs/1, jobs/2, …"""
        jobs, cost = [], seconds
        for name, expected in cells:
            if cost + expected > seconds:
                jobs.append([])
                cost = 0
            jobs[-1].append(name)
            cost += expected
        folder = self.folder / "jobs"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for number, names in enumerate(jobs, 1):
            (folder / str(number)).write_text("\n".join(names) + "\n")
        return len(jobs)

    def merge(self):
        """Tables, claims and page. Returns the program's status: 1 a criterion fails, 3 cells are missing."""
        merged = self.run("--merge")
        if merged.returncode in (0, 1, 3):
            subprocess.run(["/usr/bin/python3", PROJECT / "scripts/report.py", self.folder], check=True)
        return merged.returncode


# The drivers. Each runs what is left once, and returns whether it may be tried again.


def run_here(sweep, cells, workers, seconds):
    count = sweep.write_jobs(cells, min(seconds, sum(cost for _, cost in cells) / (20 * workers)))
    progress = Progress(count)

    def run(number):
        status = subprocess.run([sweep.program.parent / "run_job", str(number)], check=False).returncode
        progress.step()
        return status

    with concurrent.futures.ThreadPoolExecutor(workers) as pool:
        statuses = list(pool.map(run, range(1, count + 1)))
    return 2 not in statuses  # A file that cannot be written: the program has said so.


def run_by_ssh(sweep, cells, hosts, seconds):
    sweep.add_libraries()
    count = sweep.write_jobs(cells, seconds)
    with tarfile.open(sweep.folder / "sweep.tar", "w") as archive:
        for name in ("program", "sweep.json", "jobs", "inputs"):
            if (sweep.folder / name).exists():
                archive.add(sweep.folder / name, name)
    subprocess.run(["parallel", "--will-cite", "--sshlogin", hosts, "--basefile", "sweep.tar", "--workdir", "...", "--cleanup",
                    "--return", "job{}.tar", "--retries", "2", "tar -xf sweep.tar program/run_job_apart && "
                    "program/run_job_apart {}", ":::", *map(str, range(1, count + 1))], check=False, cwd=sweep.folder)
    return take_in(sweep)


def take_in(sweep):
    """Moves what came back from other machines to its place."""
    archives = list(sweep.folder.glob("job*.tar"))
    for path in archives:
        with tarfile.open(path) as archive:
            for member in archive:
                target = sweep.folder / member.name
                if not member.isfile() or not member.name.startswith("cells/") or ".." in member.name:
                    continue
                target.parent.mkdir(parents=True, exist_ok=True)
                part = target.with_suffix(".part")
                part.write_bytes(archive.extractfile(member).read())
                part.rename(target)
        path.unlink()
    return bool(archives)


def run_by_slurm(sweep, cells, options, seconds):
    """Submits arrays, and a job after them that merges. Returns that one's number."""
    sweep.add_libraries()
    count = sweep.write_jobs(cells, seconds)
    (sweep.folder / "logs").mkdir(exist_ok=True)
    common = ["sbatch", "--parsable", f"--job-name={sweep.folder.name}", f"--output={sweep.folder}/logs/%A_%a.txt",
              f"--chdir={sweep.folder}", *shlex.split(options)]

    def submit(*more):
        done = subprocess.run([*common, *more], check=False, capture_output=True, text=True)
        if done.returncode != 0:
            raise Refused(f"Slurm refuses the job: {done.stderr.strip().splitlines()[-1]}")
        return done.stdout.strip().split(";")[0]

    largest = most_in_array()
    arrays = [submit("--requeue", f"--array=1-{min(largest, count - first)}",
                     f"--wrap=program/run_job $(({first} + SLURM_ARRAY_TASK_ID))") for first in range(0, count, largest)]
    return submit(f"--dependency=afterany:{':'.join(arrays)}", "--requeue",
                  f"--wrap={shlex.quote(str(PROJECT / 'scripts/sweep'))} --merge .")


def most_in_array():
    """Indices run from 0 to less than MaxArraySize, and ours from 1."""
    shown = subprocess.run(["scontrol", "show", "config"], check=False, capture_output=True, text=True)
    found = re.search(r"^MaxArraySize\s*=\s*(\d+)", shown.stdout, re.M)
    if not found:
        raise Refused(f"Slurm does not answer: {shown.stderr.strip() or 'scontrol shows no MaxArraySize'}")
    return int(found.group(1)) - 1


def wait_for_slurm(sweep, number):
    """Until that job is gone; a controller that is away for a while is waited for."""
    while True:
        queued = subprocess.run(["squeue", "--noheader", "--jobs", number], check=False, capture_output=True, text=True)
        if queued.returncode == 0 and not queued.stdout.strip() or "Invalid job id" in queued.stderr:
            return
        sweep.run("--status")
        time.sleep(5)


class Progress:
    """On a terminal, one line that is rewritten."""

    def __init__(self, jobs):
        self.jobs, self.done, self.began = jobs, 0, time.monotonic()

    def step(self):
        self.done += 1
        if sys.stderr.isatty():
            left = (time.monotonic() - self.began) * (self.jobs - self.done) / self.done
            end = "\n" if self.done == self.jobs else ""
            print(f"\r\x1b[K{self.done} of {self.jobs} jobs done, about {left:.0f} s left", end=end, file=sys.stderr, flush=True)


# The command line


def hosts(text):
    """HOST, HOST:JOBS or GNU parallel's JOBS/HOST, apart by commas; as parallel has them."""
    return ",".join(re.sub(r"^(.+):(\d+)$", r"\2/\1", host) for host in text.split(","))


def whole(text):
    if not re.fullmatch(r"[1-9]\d{0,8}", text):
        raise argparse.ArgumentTypeError(f"'{text}' must be a whole number of 1 or more")
    return int(text)


def add_selection(parser):
    known = ", ".join(experiments())
    parser.add_argument("experiments", nargs="*", metavar="EXPERIMENT", help=f"only these: {known}")
    parser.add_argument("--only", nargs="+", default=[], metavar="EXPERIMENT", help="the same")
    parser.add_argument("--quick", action="store_true", help="fewer seeds and cases")
    parser.add_argument("--method", nargs="+", default=[], metavar="METHOD",
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
        chosen += ["--over", text]
    return chosen + ["--quick"] * arguments.quick


def parsed(description, out, replace):
    parser = Arguments(description)
    add_selection(parser)
    parser.add_argument("--out", default=PROJECT / out, metavar="FOLDER", help=f"of the sweep: {out} of this project unless given")
    parser.add_argument("--replace", action="store_true", default=replace, help="another sweep in that folder is removed")
    parser.add_argument("--workers", "--jobs", type=whole, default=os.cpu_count(), metavar="N",
                        help="processes on this machine: as many as there are processors, unless given")
    parser.add_argument("--ssh", type=hosts, metavar="HOSTS",
                        help="on these machines: HOST or HOST:JOBS, apart by commas; ':' is this one. By GNU parallel")
    parser.add_argument("--slurm", metavar="OPTIONS", help="by Slurm, with these options of sbatch; the folder must be shared")
    parser.add_argument("--wait", action="store_true", help="with --slurm: until all has run")
    parser.add_argument("--job", type=float, default=JOB, metavar="SECONDS", help=f"what a job takes, about: {JOB} unless given")
    parser.add_argument("--status", metavar="FOLDER", help="what is done, failed and left")
    parser.add_argument("--merge", metavar="FOLDER", help="tables and page of what has run")
    return parser.parse_args()


def run(arguments):
    """Returns the status to end with."""
    if arguments.status:
        return Sweep(arguments.status).run("--status").returncode
    if arguments.merge:
        return Sweep(arguments.merge).merge()
    chosen = selection(arguments)
    subprocess.run([PROJECT / "scripts/setup", "run"], check=True)
    subprocess.run([PROJECT / "scripts/build", "release", "experiments"], check=True)
    sweep = Sweep(arguments.out)
    sweep.begin(PROJECT / "build/release/tests/experiments/experiments", chosen, arguments.replace)
    take_in(sweep)
    if arguments.slurm is not None:
        cells = sweep.left({"left", "failed"})
        number = run_by_slurm(sweep, cells, arguments.slurm, arguments.job)
        print(f"{len(cells)} cells; job {number} merges them. scripts/sweep --status {sweep.folder} says how far they are")
        if not arguments.wait:
            return 0
        wait_for_slurm(sweep, number)
        return sweep.merge()
    for attempt in range(PASSES):
        # Of what ended its worker nothing is known: it must not take others with it.
        cells = sweep.left({"left", "failed"} if attempt == 0 else {"left"})
        seconds = arguments.job if attempt == 0 else 0
        if not cells or not (run_by_ssh(sweep, cells, arguments.ssh, seconds) if arguments.ssh else
                             run_here(sweep, cells, arguments.workers, seconds)):
            break
    return sweep.merge()


def main(description, out, replace=False):
    """replace: another sweep in the folder is removed."""
    try:
        sys.exit(run(parsed(description, out, replace)))
    except Refused as refused:
        print(f"scripts/{pathlib.Path(sys.argv[0]).name}: {refused}", file=sys.stderr)
        sys.exit(2)
