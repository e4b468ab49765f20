"""Sweeps: the cells of the experiments, run by workers of this machine, on others by ssh, or by Slurm, and the page of what
they give. A sweep is a folder: sweep.json says what it is, program/ runs its cells, cells/ has a file for each."""

import argparse
import collections
import concurrent.futures
import itertools
import math
import os
import pathlib
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tarfile
import time

from arguments import Arguments

PROJECT = pathlib.Path(__file__).resolve().parent.parent
PASSES = 3  # So often is a cell tried whose worker ends without a word.
JOB = 60  # s: what a job takes, about.
ANSWER = 60  # s: so long may Slurm take to accept a job, or a host to answer.
AWAY = 600  # s: so long may Slurm's controller be away while it is waited for.
# Slurm's reasons for which a job waits for ever.
NEVER = re.compile("held|JobHoldMaxRequeue|PartitionTimeLimit|PartitionNodeLimit|BadConstraints|DependencyNeverSatisfied", re.I)


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
        self.attempts = itertools.count(1)

    def command(self, *arguments):
        return [str(self.program), "--out", str(self.folder), *map(str, arguments)]

    def run(self, *arguments, **options):
        if not self.program.exists():
            raise Refused(f"{self.folder} holds no sweep")
        libraries = {**os.environ, "LD_LIBRARY_PATH": str(self.program.parent / "lib")}
        return subprocess.run(self.command(*arguments), check=False, text=True, env=libraries, **options)

    def begin(self, built, selection, replace):
        """The folder holds this sweep, and the program that runs its cells."""
        if not os.access(built, os.X_OK) or not os.path.isfile(built):
            raise Refused(f"--program {built} must be an experiments program")
        begun = subprocess.run([built, "--out", self.folder, "--begin", *selection, *["--replace"][:replace]], check=False)
        if begun.returncode != 0:
            sys.exit(begun.returncode)
        if self.program.exists():  # The same, or it would have been refused.
            return
        part = self.folder / f"program.{os.getpid()}.part"
        beside = built.resolve().parent / "worlds"
        shutil.copytree(beside if beside.exists() else PROJECT / "worlds", part / "worlds")
        for file in (built, *(PROJECT / "scripts/sweeping").iterdir()):
            shutil.copy2(file, part)
        part.rename(self.program.parent)

    def add_libraries(self):
        """What the program needs of this system, but for the C library: other machines may not have it."""
        target = self.program.parent / "lib"
        if target.exists():
            return
        part = self.program.parent / f"lib.{os.getpid()}.part"
        part.mkdir()
        listed = subprocess.run(["ldd", self.program], check=True, capture_output=True, text=True).stdout
        for name, path in re.findall(r"(\S+) => (\S+)", listed):
            if not re.match(r"(libc|libm|libdl|librt|libpthread|libresolv|ld-linux.*)\.so", name):
                shutil.copy2(path, part / name)
        part.rename(target)

    def left(self, states):
        """[(name, cost)] of the cells that are "left" or "failed", the longest first."""
        listed = self.run("--status", "--list-cells", stdout=subprocess.PIPE)
        if listed.returncode != 0:
            sys.exit(listed.returncode)
        rows = [line.split("\t") for line in listed.stdout.splitlines()]
        return sorted(((row[0], float(row[5])) for row in rows if row[6] in states), key=lambda cell: -cell[1])

    def write_jobs(self, cells, seconds):
        """Lists of cells that take so long together, about, in a folder of this attempt's: jobs/ATTEMPT/1, 2, … Returns ATTEMPT and
        how many there are."""
        jobs, cost = [], math.inf
        for name, expected in cells:
            if cost + expected > seconds:
                jobs.append([])
                cost = 0
            jobs[-1].append(name)
            cost += expected
        attempt = f"{time.strftime('%Y%m%d-%H%M%S')}.{os.getpid()}.{next(self.attempts)}"
        folder = self.folder / "jobs" / attempt
        folder.mkdir(parents=True)
        for number, names in enumerate(jobs, 1):
            (folder / str(number)).write_text("\n".join(names) + "\n")
        return attempt, len(jobs)

    def merge(self):
        """Tables, claims and page. Returns the program's status: 1 a criterion fails, 3 cells are missing."""
        merged = self.run("--merge")
        if merged.returncode in (0, 1, 3):
            page = subprocess.run(["/usr/bin/python3", PROJECT / "scripts/report.py", self.folder], check=False)
            if page.returncode != 0:
                raise Refused(f"the tables are in {self.folder}, but there is no page: scripts/report.py needs python3-matplotlib")
        return merged.returncode


# The drivers


def run_here(sweep, cells, workers, seconds):
    attempt, count = sweep.write_jobs(cells, min(seconds, sum(cost for _, cost in cells) / (20 * workers)))
    crew = Crew(count)
    statuses = crew.run([[sweep.program.parent / "run_job", f"{attempt}/{number}"] for number in range(1, count + 1)], workers)
    return 2 not in statuses  # A file that cannot be written: the program has said so.


class Crew:
    """Runs commands, so many at a time, until one ends with status 2. They end with it."""

    def __init__(self, count):
        self.running, self.stopped, self.progress = set(), False, Progress(count)

    def run(self, commands, workers):
        """Their statuses."""
        pool = concurrent.futures.ThreadPoolExecutor(workers)
        try:
            return list(pool.map(self.run_one, commands))
        except BaseException:
            self.stopped = True
            for process in list(self.running):
                process.terminate()
            raise
        finally:
            pool.shutdown()

    def run_one(self, command):
        if self.stopped:
            return 0
        with subprocess.Popen(command, stdin=subprocess.DEVNULL) as process:
            self.running.add(process)
            status = process.wait()
        self.running.discard(process)
        self.stopped = self.stopped or status == 2
        self.progress.step()
        return status


def run_by_ssh(sweep, cells, logins, seconds):
    """What each job gives comes back."""
    for program in ("parallel", "rsync"):
        if not shutil.which(program):
            raise Refused(f"--ssh needs {program} on this machine")
    logins = answering(logins)
    sweep.add_libraries()
    attempt, count = sweep.write_jobs(cells, seconds)
    with tarfile.open(sweep.folder / "sweep.tar", "w") as archive:
        for name in ("program", "sweep.json", f"jobs/{attempt}", "inputs"):
            archive.add(sweep.folder / name, name)
    remote = f"sweep.{sweep.folder.name}.{os.getpid()}"
    parallel = ["parallel", "--will-cite", "--sshlogin", logins, "--workdir", remote, "--cleanup", "--retries", "2",
                "--basefile", "sweep.tar", "--basefile", "program/run_job_apart", "--return", "job{}.tar",
                f"program/run_job_apart {attempt} {{}}", ":::", *map(str, range(1, count + 1))]
    with subprocess.Popen(parallel, cwd=sweep.folder, stdin=subprocess.DEVNULL) as process:
        try:
            process.wait()
        except BaseException:
            process.terminate()
            raise
    return take_in(sweep)


def answering(logins):
    """Those that do: one that is away would fail most jobs, as it is quickest."""
    there = []
    for login in logins.split(","):
        host = login.rpartition("/")[2]
        ssh = [*shlex.split(os.environ.get("PARALLEL_SSH", "ssh")), "-o", "BatchMode=yes", "-o", "ConnectTimeout=10", host, "true"]
        try:
            asked = subprocess.run(["true"] if host == ":" else ssh, check=False, capture_output=True, text=True,
                                   stdin=subprocess.DEVNULL, timeout=ANSWER)
            why = (asked.stderr.strip().splitlines() or [f"status {asked.returncode}"])[-1] if asked.returncode else ""
        except subprocess.TimeoutExpired:
            why = f"nothing within {ANSWER} s"
        if not why:
            there.append(login)
        else:
            print(f"{host} does not answer and is left out: {why}", file=sys.stderr)
    if not there:
        raise Refused("--ssh needs a host that answers")
    return ",".join(there)


def take_in(sweep):
    """Moves what came back from other machines to its place."""
    archives = list(sweep.folder.glob("job*.tar"))
    for path in archives:
        try:
            take_out(path, sweep.folder)
        except tarfile.TarError as error:
            print(f"{path.name} came back damaged, its other cells are run again: {error}", file=sys.stderr)
        path.unlink()
    return bool(archives)


def take_out(path, folder):
    with tarfile.open(path) as archive:
        for member in archive:
            if not member.isfile() or not re.fullmatch(r"cells/\w+/[\w-]+\.json", member.name):
                continue
            target = folder / member.name
            target.parent.mkdir(parents=True, exist_ok=True)
            part = target.with_suffix(".part")
            part.write_bytes(archive.extractfile(member).read())
            part.rename(target)


class Slurm:
    """Arrays of jobs. Only the cells' files say what has run: a controller that was killed forgets jobs, and runs some twice."""

    def __init__(self, sweep, options):
        self.sweep = sweep
        self.common = ["sbatch", "--parsable", f"--job-name={sweep.folder.name}", f"--output={sweep.folder}/logs/%A_%a.txt",
                       f"--chdir={sweep.folder}", "--requeue", *shlex.split(options)]
        (sweep.folder / "logs").mkdir(exist_ok=True)

    def submit(self, *more):
        """The job's number."""
        try:
            done = subprocess.run([*self.common, *more], check=False, capture_output=True, text=True, timeout=ANSWER)
        except FileNotFoundError:
            raise Refused("--slurm needs sbatch on this machine") from None
        except subprocess.TimeoutExpired:
            raise Refused(f"Slurm takes no job within {ANSWER} s: it may have as many as MaxJobCount allows") from None
        if done.returncode != 0:
            said = [line for line in done.stderr.splitlines() if line and not line.startswith("Try ")]
            raise Refused(f"Slurm refuses the job: {(said or ['it does not say why'])[-1].removeprefix('sbatch: error: ')}")
        return done.stdout.strip().split(";")[0]

    def submit_cells(self, cells, seconds):
        """Numbers of the arrays. Indices are less than MaxArraySize, and ours begin at 1."""
        self.sweep.add_libraries()
        attempt, count = self.sweep.write_jobs(cells, seconds)
        shown = asked_slurm("scontrol", "show", "config")
        found = re.search(r"^MaxArraySize\s*=\s*(\d+)", shown.stdout, re.M)
        largest = int(found.group(1)) - 1 if found else 1000
        arrays = []
        try:
            for first in range(0, count, largest):
                arrays.append(self.submit(f"--array=1-{min(largest, count - first)}",
                                          f"--wrap=program/run_job {attempt}/$(({first} + SLURM_ARRAY_TASK_ID))"))
        except Refused:
            if arrays:
                asked_slurm("scancel", *arrays)
            raise
        return arrays

    def submit_merge(self, arrays):
        return self.submit(f"--dependency=afterany:{':'.join(arrays)}",
                           f"--wrap={shlex.quote(str(PROJECT / 'scripts/sweep'))} --merge .")

    def wait(self, arrays):
        """Until none of them waits or runs. What never runs is given up."""
        answered, shown = time.monotonic(), None
        while True:
            states = asked_slurm("squeue", "--noheader", f"--jobs={','.join(arrays)}", "--format=%T %r")
            if states.returncode == 0 or "Invalid job id" in states.stderr:
                answered = time.monotonic()
                jobs = states.stdout.splitlines()
                if all(NEVER.search(job) for job in jobs):
                    asked_slurm("scancel", *arrays)
                    return
                counts = ", ".join(f"{count} {state}" for state, count in sorted(collections.Counter(jobs).items()))
                if counts != shown and sys.stderr.isatty():
                    print(shown := counts, file=sys.stderr)
            elif time.monotonic() - answered > AWAY:
                raise Refused(f"Slurm has not answered for {AWAY} s; the same command goes on")
            time.sleep(5)


def asked_slurm(*command):
    try:
        return subprocess.run(command, check=False, capture_output=True, text=True)
    except FileNotFoundError:
        raise Refused(f"--slurm needs {command[0]} on this machine") from None


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
        chosen += ["--over", text]
    return chosen + ["--quick"] * arguments.quick


def parsed(description, out, replace):
    parser = Arguments(description)
    add_selection(parser)
    parser.add_argument("--out", metavar="FOLDER", help=f"of the sweep: {out} of this project unless given")
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
    alone.add_argument("--status", metavar="FOLDER", help="what is done, failed and left; stands alone")
    alone.add_argument("--merge", metavar="FOLDER", help="tables and page of what has run; stands alone")
    arguments = parser.parse_args()
    for name in ("--status", "--merge"):
        if getattr(arguments, name[2:]) is not None and len(sys.argv) - 1 > len(
                [each for each in sys.argv if each.startswith(name)]) + (f"{name}" in sys.argv):
            parser.error(f"{name} FOLDER must stand alone")
    if arguments.wait and arguments.slurm is None:
        parser.error("--wait must go with --slurm")
    arguments.replace = arguments.replace or replace and arguments.out is None
    arguments.out = arguments.out or PROJECT / out
    return arguments


def run(arguments):
    """Returns the status to end with."""
    if arguments.status:
        return Sweep(arguments.status).run("--status").returncode
    if arguments.merge:
        return Sweep(arguments.merge).merge()
    chosen = selection(arguments)
    sweep = Sweep(arguments.out)
    sweep.begin(arguments.program or build(), chosen, arguments.replace)
    take_in(sweep)
    attempt = driver(sweep, arguments)
    for number in range(PASSES):
        cells = sweep.left({"left", "failed"} if number == 0 else {"left"})
        # Of what ended its worker twice nothing is known: it must not take others with it.
        if not cells or not attempt(cells, arguments.job if number < PASSES - 1 else 0):
            break
    return 0 if arguments.slurm is not None and not arguments.wait else sweep.merge()


def build():
    subprocess.run([PROJECT / "scripts/setup", "run"], check=True)
    subprocess.run([PROJECT / "scripts/build", "release", "experiments"], check=True)
    return PROJECT / "build/release/tests/experiments/experiments"


def driver(sweep, arguments):
    """What runs cells in jobs of so many seconds once, and returns whether what is left may be tried again."""
    if arguments.ssh:
        return lambda cells, seconds: run_by_ssh(sweep, cells, arguments.ssh, seconds)
    if arguments.slurm is None:
        return lambda cells, seconds: run_here(sweep, cells, arguments.workers, seconds)
    slurm = Slurm(sweep, arguments.slurm)

    def submit(cells, seconds):
        arrays = slurm.submit_cells(cells, seconds)
        if arguments.wait:
            slurm.wait(arrays)
            return True
        print(f"{len(cells)} cells in array {', '.join(arrays)}; job {slurm.submit_merge(arrays)} makes the page. How far they are: "
              f"scripts/sweep --status {sweep.folder}")
        return False

    return submit


def main(description, out, replace=False):
    """replace: another sweep in the folder is removed."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)
    if "--slurm" in sys.argv[:-1]:  # Its value begins with dashes, too.
        at = sys.argv.index("--slurm")
        sys.argv[at:at + 2] = [f"--slurm={sys.argv[at + 1]}"]
    try:
        sys.exit(run(parsed(description, out, replace)))
    except Refused as refused:
        complain(refused)
    except OSError as error:
        complain(f"{error.filename}: {error.strerror}")
    except KeyboardInterrupt:
        print("What has run stays; the same command goes on.", file=sys.stderr)
        sys.exit(130)


def complain(text):
    print(f"scripts/{pathlib.Path(sys.argv[0]).name}: {text}", file=sys.stderr)
    sys.exit(2)
