"""Ctrl-C ends the loops of open sessions; once more, and it is what it is elsewhere, a KeyboardInterrupt."""

from __future__ import annotations

import signal
import threading
import weakref
from typing import Any

_sessions: weakref.WeakSet[Any] = weakref.WeakSet()  # with an attribute `running`


def watch(session: Any) -> None:
    """Only where Ctrl-C is not handled in some other way. Until forget()."""
    if threading.current_thread() is not threading.main_thread():
        return
    if not _sessions and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end_sessions)
    _sessions.add(session)


def forget(session: Any) -> None:
    _sessions.discard(session)
    if not _sessions:
        _give_back()


def _end_sessions(*_: Any) -> None:
    for session in list(_sessions):
        session.running = False
    _give_back()


def _give_back() -> None:
    if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGINT) is _end_sessions:
        signal.signal(signal.SIGINT, signal.default_int_handler)
