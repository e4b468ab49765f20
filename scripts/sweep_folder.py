"""The folder of a sweep: sweep.json says what it is, program/ runs its cells, cells/ has a file for each, jobs/ has lists of them."""

import fcntl
import itertools
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time

PROJECT = pathlib.Path(__file__).resolve().parent.parent


class Refused(Exception):
    """One line that names what cannot be used, and what can."""


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
        if begun.returncode == 2:  # It has said why.
            sys.exit(2)
        if begun.returncode != 0 or not (self.folder / "sweep.json").exists():
            raise Refused(f"--program {built} must be an experiments program")
        if self.program.exists():  # The same, or it would have been refused.
            return
        part = self.folder / f"program.{os.getpid()}.part"
        beside = built.resolve().parent / "worlds"
        shutil.copytree(beside if beside.exists() else PROJECT / "worlds", part / "worlds")
        for file in (built, *(PROJECT / "scripts/sweeping").iterdir()):
            shutil.copy2(file, part)
        part.rename(self.program.parent)

    def lock(self):
        """One command at a time works on a folder. The lock goes with the process."""
        self.folder.mkdir(parents=True, exist_ok=True)
        try:
            fcntl.flock(os.open(self.folder, os.O_RDONLY), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise Refused(f"another command works on {self.folder}: it must end first") from None
        except OSError:  # A file system without locks.
            pass

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

    def write_jobs(self, jobs):
        """Lists of cells, in a folder of this attempt's: jobs/ATTEMPT/1, 2, … Returns ATTEMPT."""
        attempt = f"{time.strftime('%Y%m%d-%H%M%S')}.{os.getpid()}.{next(self.attempts)}"
        folder = self.folder / "jobs" / attempt
        folder.mkdir(parents=True)
        for number, cells in enumerate(jobs, 1):
            (folder / str(number)).write_text("".join(f"{name}\n" for name, _ in cells))
        return attempt

    def merge(self):
        """Tables, claims and page. Returns the program's status: 1 a criterion fails, 3 cells are missing."""
        merged = self.run("--merge")
        if merged.returncode in (0, 1, 3):
            page = subprocess.run(["/usr/bin/python3", PROJECT / "scripts/report.py", self.folder], check=False)
            if page.returncode != 0:
                raise Refused(f"the tables are in {self.folder}, but there is no page: scripts/report.py needs python3-matplotlib")
        return merged.returncode
