"""A server in virtual time: a client of any engine, tested in its own process, exactly, at any load, faster than real time.

    with haptic.virtual.Server(hand=HAND, delay=0.02, loss=0.01) as server:
        with haptic.mujoco.Session(model, data, tool="tool") as touch:     # yours, as it is
            while server.now < 4:
                for _ in range(touch.drive(data)):
                    mujoco.mj_step(model, data)
                touch.send(data)
        force = server.ticks["env_force_z_N"]

The server's tick, its simulated device and the network's delays are those of haptic_server, of which this takes the options;
they and the session go on in one clock, from frame to frame. Run again, each number of each tick is the same.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import pathlib
import tempfile
import warnings
from typing import Any, Iterable, Iterator, NoReturn, Optional

import numpy as np

from haptic_local_model import HapticError, _arguments
from haptic_local_model._library import Network, load_virtual

#: What the device is unless an argument says otherwise: in space, without dry friction of its own.
_DEVICE = ("--device-option", "freedom=spatial", "--device-option", "friction=0")


class Server:
    """Until close(), which the with-block calls, sessions that name no server have this one: one session at a time.

    arguments: haptic_server's, of contacts, controller, safety and its simulated device, as "--stiffness", "16000". hand: what
    moves the device, a script as in worlds/hands, its text or its file; without one a session's hold() does. delay and jitter, s,
    and loss, 0 to 1: what the network does to each datagram, in either direction. seed: of what the network draws.
    Raises HapticError that names what cannot be used."""

    _server: Optional[ctypes.c_void_p] = None
    _running: list[str] = []  # addresses
    _outside: Optional[str] = None  # What HAPTIC_SERVER was before the first of them.

    def __init__(self, *arguments: str, hand: str | os.PathLike[str] = "", delay: float = 0, jitter: float = 0, loss: float = 0,
                 seed: int = 1):
        self._library = load_virtual()
        device = () if _names_another_device(arguments) else _DEVICE
        with _script(hand) as file:
            given = [_arguments.text(argument, "argument") for argument in (*device, *arguments, *file)]
            error = ctypes.create_string_buffer(512)
            self._server = self._library.haptic_virtual_open(
                (ctypes.c_char_p * len(given))(*given), len(given),
                ctypes.byref(_network(delay, jitter, loss, _arguments.integer(seed, "seed", 0, 2**64 - 1))), error, len(error))
        if not self._server:
            raise HapticError(error.value.decode(errors="replace"))
        #: For a session that names its server.
        self.address: str = self._library.haptic_virtual_address(self._server).decode()
        for warning in self._library.haptic_virtual_warnings(self._server).decode().splitlines():
            warnings.warn(warning, stacklevel=2)
        if not Server._running:
            Server._outside = os.environ.get("HAPTIC_SERVER")
        Server._running.append(self.address)
        os.environ["HAPTIC_SERVER"] = self.address

    def __enter__(self) -> "Server":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()

    def close(self) -> None:
        """Sessions that name no server have again the one from before. One that is open goes on."""
        if not self._server:
            return
        self._library.haptic_virtual_close(self._server)
        self._server = None
        Server._running.remove(self.address)
        if os.environ.get("HAPTIC_SERVER") == self.address:
            usual = Server._running[-1] if Server._running else Server._outside
            del os.environ["HAPTIC_SERVER"]
            if usual is not None:
                os.environ["HAPTIC_SERVER"] = usual

    def __reduce__(self) -> NoReturn:
        raise TypeError("a server cannot be copied")

    @property
    def now(self) -> float:
        """s, from 0."""
        return float(self._library.haptic_virtual_now(self._open()))

    def stop(self) -> None:
        """The server ends: zero force, goodbye to its client. Time goes on without it."""
        self._library.haptic_virtual_stop(self._open())

    def wait(self, seconds: float) -> None:
        """So much time passes, as when a loop stands still: the next frame begins late."""
        if self._library.haptic_virtual_wait(self._open(), _arguments.number(seconds, "seconds")) != 0:
            raise HapticError(f"seconds {seconds:g} must be 0 to 1e6")

    def set_frame(self, seconds: Optional[float]) -> None:
        """From here on each frame begins so many seconds after the one before. None: the session's own period, as from the
        start. 0: wait() alone lets time pass."""
        length = -1.0 if seconds is None else _arguments.number(seconds, "seconds", 0, 1e6, "s")
        self._library.haptic_virtual_set_frame(self._open(), length)

    def set_network(self, delay: float = 0, jitter: float = 0, loss: float = 0) -> None:
        """For what is sent from here on."""
        if self._library.haptic_virtual_set_network(self._open(), ctypes.byref(_network(delay, jitter, loss, 0))) != 0:
            raise HapticError(f"delay {delay:g} and jitter {jitter:g} must be 0 to 1e6 s, loss {loss:g} 0 to 1")

    @property
    def ticks(self) -> np.ndarray:
        """All ticks so far, the latest 120,000 (100 MB), as records of what haptic_server's --log has, by its names."""
        return self.ticks_since(0)

    def ticks_since(self, begin: int) -> np.ndarray:
        """Those from the one of that number on."""
        names, words = _columns(self._library.haptic_virtual_columns().decode())
        count = self._library.haptic_virtual_ticks(self._open())
        begin = max(_arguments.integer(begin, "begin", 0), count - 120_000)
        numbers = np.zeros((max(0, count - begin), len(names)))
        self._library.haptic_virtual_copy_ticks(self._open(), begin, len(numbers), numbers.ctypes.data)
        ticks = np.zeros(len(numbers), [(name, "U24" if name in words else float) for name in names])
        for column, name in enumerate(names):
            ticks[name] = np.array(words[name])[numbers[:, column].astype(int)] if name in words else numbers[:, column]
        return ticks

    def _open(self) -> ctypes.c_void_p:
        if not self._server:
            raise HapticError("the server is closed")
        return self._server


@contextlib.contextmanager
def _script(hand: str | os.PathLike[str]) -> Iterator[list[str]]:
    """Arguments that name the file of a hand."""
    named = os.fsdecode(_arguments.text(hand, "hand"))
    if not isinstance(hand, str) or "\n" not in hand:
        yield ["--hand", named] if named else []
        return
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "hand.toml"
        file.write_bytes(os.fsencode(named))
        yield ["--hand", str(file)]


def _names_another_device(arguments: Iterable[Any]) -> bool:
    listed = [*arguments, ""]
    return any(one == "--device" and other != "simulated" or str(one).startswith("--device=") and one != "--device=simulated"
               for one, other in zip(listed, listed[1:]))


def _network(delay: float, jitter: float, loss: float, seed: int) -> Network:
    return Network(_arguments.number(delay, "delay"), _arguments.number(jitter, "jitter"), _arguments.number(loss, "loss"), seed)


def _columns(described: str) -> tuple[list[str], dict[str, list[str]]]:
    """Names, and the words of those whose numbers stand for words."""
    names, words = [], {}
    for column in described.split(","):
        name, _, listed = column.partition("=")
        names.append(name)
        if listed:
            words[name] = listed.split("|")
    return names, words
