"""A haptic_server of a session's own, with the simulated device, where none runs on this machine."""

from __future__ import annotations

import os
import pathlib
import shutil
import socket
import subprocess
import sys
from typing import Optional

from haptic._library import load

ADDRESS = "127.0.0.1:47800"
_NAME = "haptic_server"
_VARIABLE = "HAPTIC_SERVER_PROGRAM"
_PATIENCE = 2  # s, for it to end


class OwnServer:
    """It gets a free port of this machine, so that the usual one stays free. From start() on it runs, until end(), or the
    end of the program or of the thread that started it."""

    def __init__(self) -> None:
        self._process: Optional[subprocess.Popen] = None
        # Bound until the server takes the port, so that nobody else gets it.
        self._place = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._place.bind(("127.0.0.1", 0))
        self.address = "%s:%d" % self._place.getsockname()  #: "HOST:PORT"

    def start(self, freedom: str, key_file: Optional[str]) -> None:
        """Raises FileNotFoundError that says where the program was looked for."""
        program = _find()
        self._place.close()
        # In a session of its own: Ctrl-C is for the program, which may go on.
        self._process = subprocess.Popen(
            [program, "--listen", self.address, "--parent", str(os.getpid()), "--device", "simulated",
             "--device-option", f"freedom={freedom}", "--device-option", "friction=0",
             "--status", "false", "--log-level", "error", *(["--key-file", key_file] if key_file else [])],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True)
        print(f"haptic: no server listens at {ADDRESS}: started {program} at {self.address} with a simulated device, "
              f"until this session ends or: kill {self._process.pid}", file=sys.stderr, flush=True)

    @property
    def status(self) -> Optional[int]:
        """Its exit status; None before it has ended."""
        return self._process.poll() if self._process else None

    def end(self) -> None:
        self._place.close()
        if self._process is None:
            return
        self._process.terminate()
        try:
            self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def listens() -> bool:
    """Whether a server has the usual port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # Another program that asks is no server.
        host, port = ADDRESS.split(":")
        try:
            probe.bind((host, int(port)))
        except OSError:
            return True
    return False


def _find() -> str:
    """What the variable names; without it the program beside the library or the package, or in PATH."""
    if named := os.environ.get(_VARIABLE):
        places = [pathlib.Path(named)]
    else:
        library = pathlib.Path(load()._name)
        above = list(library.resolve().parents[1:3]) if library.is_absolute() else []
        above += pathlib.Path(__file__).resolve().parents[4:5]
        places = [folder / "bin" / _NAME for folder in above]
    for place in places:
        if os.access(place, os.X_OK) and place.is_file():
            return str(place)
    if not named and (found := shutil.which(_NAME)):
        return found
    searched = ", ".join(map(str, places)) + ("" if named else ", PATH")
    raise FileNotFoundError(
        f"no server listens at {ADDRESS}, and there is no {_NAME} to start: looked for {searched}. Install it, set "
        f"{_VARIABLE} to its file, or give the session server=\"HOST:PORT\", or start_server=False to wait for one")
