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
JOB = 60  # s: what a job takes, about.
ANSWER = 60  # s: so long may Slurm take to accept a job.


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


# The drivers


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


def run_by_ssh(sweep, cells, logins, seconds):
    """What each job gives comes back; nothing stays there."""
    sweep.add_libraries()
    count = sweep.write_jobs(cells, seconds)
    with tarfile.open(sweep.folder / "sweep.tar", "w") as archive:
        for name in ("program", "sweep.json", "jobs", "inputs"):
            if (sweep.folder / name).exists():
                archive.add(sweep.folder / name, name)
    for program in ("parallel", "rsync"):
        if not shutil.which(program):
            raise Refused(f"--ssh needs {program} on this machine")
    subprocess.run(["parallel", "--will-cite", "--sshlogin", answering(logins), "--basefile", "sweep.tar", "--basefile", "program/run_job_apart",
                    "--workdir", f"sweep.{sweep.folder.name}.{os.getpid()}", "--cleanup", "--return", "job{}.tar", "--retries", "2", "program/run_job_apart {}", ":::", *map(str, range(1, count + 1))],
                   check=False, cwd=sweep.folder, stdin=subprocess.DEVNULL)
    return take_in(sweep)


def answering(logins):
    """Those that do: one that is away would fail most jobs, as it is quickest."""
    there = []
    for login in logins.split(","):
        host = login.rpartition("/")[2]
        ssh = [*shlex.split(os.environ.get("PARALLEL_SSH", "ssh")), "-o", "BatchMode=yes", "-o", "ConnectTimeout=10", host, "true"]
        asked = subprocess.run(["true"] if host == ":" else ssh, check=False, capture_output=True, text=True,
                               stdin=subprocess.DEVNULL)
        if asked.returncode == 0:
            there.append(login)
        else:
            why = (asked.stderr.strip().splitlines() or [f"status {asked.returncode}"])[-1]
            print(f"{host} does not answer and is left out: {why}", file=sys.stderr)
    if not there:
        raise Refused("--ssh needs a host that answers")
    return ",".join(there)


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
            why = [line for line in done.stderr.splitlines() if not line.startswith("Try ")][-1]
            raise Refused(f"Slurm refuses the job: {why.removeprefix('sbatch: error: ')}")
        return done.stdout.strip().split(";")[0]

    def most_in_array(self):
        """Indices are less than MaxArraySize, and ours begin at 1."""
        shown = subprocess.run(["scontrol", "show", "config"], check=False, capture_output=True, text=True).stdout
        found = re.search(r"^MaxArraySize\s*=\s*(\d+)", shown, re.M)
        return int(found.group(1)) - 1 if found else 1000

    def submit_cells(self, cells, seconds):
        """Numbers of the arrays."""
        self.sweep.add_libraries()
        count = self.sweep.write_jobs(cells, seconds)
        largest = self.most_in_array()
        return [self.submit(f"--array=1-{min(largest, count - first)}",
                            f"--wrap=program/run_job $(({first} + SLURM_ARRAY_TASK_ID))") for first in range(0, count, largest)]

    def submit_merge(self, arrays):
        return self.submit(f"--dependency=afterany:{':'.join(arrays)}",
                           f"--wrap={shlex.quote(str(PROJECT / 'scripts/sweep'))} --merge .")

    def wait(self, arrays):
        """Until none of them waits or runs. What is held never runs, and is given up."""
        while True:
            states = subprocess.run(["squeue", "--noheader", f"--jobs={','.join(arrays)}", "--format=%T %r"], check=False,
                                    capture_output=True, text=True)
            lines = states.stdout.split("\n")[:-1]
            if all("held" in line for line in lines) and (states.returncode == 0 or "Invalid job id" in states.stderr):
                subprocess.run(["scancel", *arrays], check=False, capture_output=True)
                return
            time.sleep(2)


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
    parser.add_argument("--program", type=pathlib.Path, metavar="FILE", help="built already; nothing is set up or built")
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
    if "--slurm" in sys.argv[:-1]:  # Its value begins with dashes, too.
        at = sys.argv.index("--slurm")
        sys.argv[at:at + 2] = [f"--slurm={sys.argv[at + 1]}"]
    try:
        sys.exit(run(parsed(description, out, replace)))
    except Refused as refused:
        print(f"scripts/{pathlib.Path(sys.argv[0]).name}: {refused}", file=sys.stderr)
        sys.exit(2)
