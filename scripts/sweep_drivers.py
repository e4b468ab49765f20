"""What runs the cells of a sweep: workers of this machine, others by ssh, or Slurm."""

import collections
import concurrent.futures
import itertools
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import tarfile
import time

from sweep_folder import PROJECT, Refused

ANSWER = 60  # s: so long may Slurm take to accept a job, or a host to answer.
AWAY = 600  # s: so long may Slurm's controller be away while it is waited for.
# Slurm's reasons for which a job waits for ever.
NEVER = re.compile("held|JobHoldMaxRequeue|PartitionTimeLimit|PartitionNodeLimit|BadConstraints|DependencyNeverSatisfied", re.I)


def cost_of(cells):
    return sum(cost for _, cost in cells)


def dealt(cells, seconds):
    """Jobs that take so long each, about: cells in turn, so that jobs are alike even where costs are not right."""
    count = min(len(cells), math.ceil(cost_of(cells) / seconds) if seconds > 0 else len(cells))
    return [cells[first::count] for first in range(count)]


def shrinking(cells, seconds, workers):
    """Jobs of at most so many seconds. Large ones first, for little is lost at the start of each, and small ones last, for all shall
    end together."""
    jobs, rest = [], cost_of(cells)
    while cells:
        limit = min(seconds, max(1, rest / (2 * workers)))
        sums = itertools.accumulate(cost for _, cost in cells)
        count = max(1, sum(1 for _ in itertools.takewhile(lambda cost: cost <= limit, sums)))
        jobs.append(cells[:count])
        rest -= cost_of(jobs[-1])
        cells = cells[count:]
    return jobs


def run_here(sweep, cells, workers, seconds):
    jobs = shrinking(cells, seconds, workers) if seconds > 0 else dealt(cells, seconds)
    attempt = sweep.write_jobs(jobs)
    crew = Crew(len(jobs))
    statuses = crew.run([[sweep.program.parent / "run_job", f"{attempt}/{number}"] for number in range(1, len(jobs) + 1)], workers)
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
    jobs = dealt(cells, seconds)
    attempt = sweep.write_jobs(jobs)
    with tarfile.open(sweep.folder / "sweep.tar", "w") as archive:
        for name in ("program", "sweep.json", f"jobs/{attempt}", "inputs"):
            archive.add(sweep.folder / name, name)
    remote = f"sweep.{sweep.folder.name}.{os.getpid()}"
    parallel = ["parallel", "--will-cite", "--sshlogin", logins, "--workdir", remote, "--cleanup", "--retries", "2",
                "--basefile", "sweep.tar", "--basefile", "program/run_job_apart", "--return", "job{}.tar",
                f"program/run_job_apart {attempt} {{}}", ":::", *map(str, range(1, len(jobs) + 1))]
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
                       f"--chdir={sweep.folder}", "--requeue", *self.split(options)]
        (sweep.folder / "logs").mkdir(exist_ok=True)

    @staticmethod
    def split(options):
        try:
            return shlex.split(options)
        except ValueError as error:
            raise Refused(f"--slurm '{options}' must be options of sbatch: {error}") from None

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
        number = done.stdout.strip().split(";")[0]
        if not number.isdigit():
            raise Refused(f"sbatch says '{number}', which must be a job's number")
        return number

    def submit_cells(self, cells, seconds):
        """Numbers of the arrays. Indices are less than MaxArraySize, and ours begin at 1."""
        self.sweep.add_libraries()
        jobs = dealt(cells, seconds)
        attempt = self.sweep.write_jobs(jobs)
        shown = asked_slurm("scontrol", "show", "config")
        found = re.search(r"^MaxArraySize\s*=\s*(\d+)", shown.stdout, re.M)
        largest = max(1, int(found.group(1)) - 1) if found else 1000
        arrays = []
        try:
            for first in range(0, len(jobs), largest):
                arrays.append(self.submit(f"--array=1-{min(largest, len(jobs) - first)}",
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
            time.sleep(2)


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
