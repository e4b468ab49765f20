"""What this project is about, in a browser: one hand on one stiff floor, twice.

    python3 -m haptic_local_model                  # left the engine's force held between its frames, right the local model
    python3 -m haptic_local_model testbed          # the live page with a world instead; the mouse is the hand

Starts haptic_server, with a simulated device, and ve_client, which serves the page, at free ports of this machine. They end
with it, however it ends. Needs the programs: see haptic._programs.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import http.client
import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time
import webbrowser
from typing import IO, Callable, Iterator, Optional, Sequence

from haptic_local_model import HapticError, __version__
from haptic_local_model._programs import program

HERE = "127.0.0.1"
USUAL_PORT = 8080
CONTRAST = "contrast"
PATIENCE = 20    # s, for the page to answer
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LOOK = 0.05      # s, between two looks at what was started

# Of both servers alike, so that left and right differ in the coupling alone. Force stays within 12 N. The guards that would damp
# a hand which shakes are out of the way, and a device that is simulated may wait for a browser that has the whole machine.
SERVER_OPTIONS = (
    "--status", "false", "--log-level", "warn", "--keep-recordings", "0", "--keep-stiffness", "--force-limit", "12",
    "--power-limit", "10000", "--energy-budget", "1000000", "--claim-energy", "1000000", "--claim-power", "10000",
    "--handle-speed-limit", "50", "--silence-time", "0.5", "--max-gap", "60",
    "--device-option", "freedom=spatial", "--device-option", "max-force=10000")
# The held force is that of a spring to the engine's tool: that is where the device is, as far as the floor lets it.
HELD_OPTIONS = ("--follow-frequency", "1000", "--contacts", "--epsilon", "0")


class _Ended(SystemExit):
    """A signal asked for the end."""


class Programs:
    """What was started; ends with the block, and with this process if that is killed."""

    def __init__(self) -> None:
        self._running: list[tuple[str, subprocess.Popen[bytes], IO[bytes]]] = []

    def __enter__(self) -> "Programs":
        return self

    def __exit__(self, *reason: object) -> None:
        for each in _SIGNALS:
            signal.signal(each, signal.SIG_IGN)
        for _, process, _ in self._running:
            process.terminate()
        for _, process, said in self._running:
            try:
                process.wait(timeout=3)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            said.close()

    def start(self, name: str, *options: object) -> None:
        """Raises HapticError where there is no such program."""
        said = tempfile.TemporaryFile()
        process = subprocess.Popen(
            [program(name), *map(str, options)], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=said,
            start_new_session=True, preexec_fn=_ends_with(os.getpid()))
        self._running.append((name, process, said))

    def check(self) -> None:
        """Raises HapticError with what a program that has ended said last."""
        for name, process, said in self._running:
            if process.poll() is None:
                continue
            said.seek(0)
            lines = said.read().decode(errors="replace").strip().splitlines()
            how = f"was ended by signal {-process.returncode}" if process.returncode < 0 else f"ended with {process.returncode}"
            raise HapticError(lines[-1] if lines and process.returncode > 0 else f"{name} {how}")


def _ends_with(parent: int) -> Callable[[], None]:
    """What a child does before it becomes a program: asks to be ended with its parent."""
    libc = ctypes.CDLL(None)
    set_parent_death_signal = 1

    def ask() -> None:
        libc.prctl(set_parent_death_signal, signal.SIGTERM)
        if os.getppid() != parent:
            os._exit(1)

    return ask


@contextlib.contextmanager
def _free_ports(count: int, kind: socket.SocketKind) -> Iterator[list[int]]:
    """Ports that nobody has until the end of the block."""
    with contextlib.ExitStack() as held:
        sockets = [held.enter_context(socket.socket(socket.AF_INET, kind)) for _ in range(count)]
        for each in sockets:
            each.bind((HERE, 0))
        yield [each.getsockname()[1] for each in sockets]


def _page_port(asked: Optional[int]) -> int:
    """The one that was asked for, else the usual one, else any that is free. Raises HapticError where it cannot be had."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HERE, asked or USUAL_PORT))
            return asked or USUAL_PORT
        except OSError as error:
            if asked is not None:
                raise HapticError(f"--port {asked} cannot be had: {error.strerror}") from None
    with _free_ports(1, socket.SOCK_STREAM) as (free,):
        return free


def _wait_for(programs: Programs, port: int) -> None:
    """Until the page there answers. Raises HapticError where a program ended, or none answers in time."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        programs.check()
        with contextlib.suppress(OSError, http.client.HTTPException), \
                contextlib.closing(http.client.HTTPConnection(HERE, port, timeout=1)) as connection:
            connection.request("GET", "/")
            connection.getresponse()
            programs.check()    # another program may have the port
            return
        time.sleep(LOOK)
    raise HapticError(f"no page answers at http://{HERE}:{port} within {PATIENCE} s")


def start_contrast(programs: Programs, world: pathlib.Path, port: int) -> str:
    """Both sides. Returns the page's address."""
    with _free_ports(2, socket.SOCK_DGRAM) as (held, local), _free_ports(1, socket.SOCK_STREAM) as (partner,):
        pass
    for udp, page, options in ((held, partner, ("--page-partner", port, *HELD_OPTIONS)), (local, port, ())):
        programs.start("haptic_server", "--listen", f"{HERE}:{udp}", *SERVER_OPTIONS)
        programs.start("ve_client", "--server", f"{HERE}:{udp}", "--world", world, "--page", f"{HERE}:{page}", "--quiet",
                       *options)
    for page in (partner, port):
        _wait_for(programs, page)
    return f"http://{HERE}:{port}/contrast.html?left={partner}"


def start_live_page(programs: Programs, world: pathlib.Path, port: int) -> str:
    """One side with a world. Returns the page's address."""
    with _free_ports(1, socket.SOCK_DGRAM) as (udp,):
        pass
    programs.start("haptic_server", "--listen", f"{HERE}:{udp}", "--status", "false", "--log-level", "warn",
                   "--device-option", "freedom=spatial")
    programs.start("ve_client", "--server", f"{HERE}:{udp}", "--world", world, "--page", f"{HERE}:{port}", "--quiet")
    _wait_for(programs, port)
    return f"http://{HERE}:{port}/"


def worlds_folder(holding: str) -> pathlib.Path:
    """The folder of worlds that has the file `holding`: share/ beside the programs' folder, or that of the clone which this
    package stands in. Raises HapticError that says where it was looked for."""
    folders = [pathlib.Path(program("ve_client")).resolve().parent.parent / "share/haptic_local_model/worlds"]
    for clone in list(pathlib.Path(__file__).resolve().parents)[3:4]:   # CLONE/client/python/haptic
        folders.append(clone / "worlds")
    for folder in folders:
        if (folder / holding).is_file():
            return folder
    for folder in folders:
        if names := sorted(file.stem for file in folder.glob("*.sdf")):
            raise HapticError(f"there is no world {holding.removesuffix('.sdf')}: {folder} has {', '.join(names)}")
    looked = " and ".join(str(folder) for folder in folders)
    raise HapticError(f"there is no world {holding}: looked in {looked}. Name its folder with --worlds")


def _world(name: str, folder: Optional[str]) -> pathlib.Path:
    """The file of a world: a file's name, or that of one in `folder` or in the usual one, without .sdf."""
    if pathlib.Path(name).suffix:
        return pathlib.Path(name)
    if folder is None:
        return worlds_folder(f"{name}.sdf") / f"{name}.sdf"
    file = pathlib.Path(folder) / f"{name}.sdf"
    if not file.is_file():
        raise HapticError(f"--worlds {folder} has no {name}.sdf")
    return file


def _port(text: str) -> int:
    if text.isdecimal() and 0 < int(text) < 65536:
        return int(text)
    raise argparse.ArgumentTypeError(f"{text!r} must be 1 to 65535")


def _arguments(given: Optional[Sequence[str]]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python3 -m haptic_local_model" if pathlib.Path(sys.argv[0]).name == "__main__.py" else None,
        description="Opens a page that shows what this project is about: one hand on one stiff floor, with the engine's force "
                    "held between its frames, and with the local model. Ctrl-C ends it.")
    parser.add_argument("world", nargs="?", metavar="WORLD",
                        help="open the live page with this world instead: the name of one that is installed, for example "
                             "testbed, or an SDFormat or URDF file. The mouse is the hand")
    parser.add_argument("--port", type=_port, metavar="PORT",
                        help=f"serve the page there (default: {USUAL_PORT}, or a free port where that is taken)")
    parser.add_argument("--no-browser", action="store_true", help="only say the page's address")
    parser.add_argument("--worlds", metavar="FOLDER", help="where the worlds are (default: where they are installed)")
    parser.add_argument("--version", action="version", version=f"haptic_demo {__version__}")
    return parser.parse_args(given)


def _has_display() -> bool:
    """Whether a browser would not take over the terminal."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _end(*_: object) -> None:
    raise _Ended(0)


def main(given: Optional[Sequence[str]] = None) -> int:
    """Returns an exit status: 0 ended by a person, 1 something failed, which is said in one line."""
    arguments = _arguments(given)
    before = {each: signal.signal(each, _end) for each in _SIGNALS}
    try:
        with Programs() as programs:
            begin = start_live_page if arguments.world else start_contrast
            address = begin(programs, _world(arguments.world or CONTRAST, arguments.worlds), _page_port(arguments.port))
            print(f"{address}   Ctrl-C ends it.", flush=True)
            if not arguments.no_browser and _has_display():
                webbrowser.open(address)
            while True:
                programs.check()
                time.sleep(0.2)
    except HapticError as error:
        print(f"haptic: {error}", file=sys.stderr)
        return 1
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
