"""libhaptic.so, as haptic.h declares it."""

from __future__ import annotations

import ctypes
import functools
import os
import pathlib

ABI = 1
MAX_DOF, MAX_CONFIGURATION, MAX_CONTACTS, MAX_BODIES, MAX_TEXT = 16, 17, 192, 16, 240
NO_LIMIT = 1e9  # rad or m: a joint's limit that is none

_double, _int, _size = ctypes.c_double, ctypes.c_int32, ctypes.c_size_t


class Link(ctypes.Structure):
    _fields_ = [("parent", _int), ("joint", _int), ("position", _double * 3), ("rotation", _double * 4),
                ("axis", _double * 3), ("mass", _double), ("centre", _double * 3), ("inertia", _double * 9),
                ("lower", _double), ("upper", _double)]


class Options(ctypes.Structure):
    _fields_ = [("server", ctypes.c_char_p), ("key_file", ctypes.c_char_p), ("links", ctypes.POINTER(Link)),
                ("link_count", _size), ("hand_link", _int), ("hand_position", _double * 3),
                ("hand_rotation", _double * 4), ("gravity", _double * 3), ("length", _double),
                ("q", _double * MAX_CONFIGURATION), ("rate", _double), ("epsilon", _double),
                ("clears_fault", _int)]


class Impulse(ctypes.Structure):
    _fields_ = [("body", ctypes.c_uint32), ("reserved", ctypes.c_uint32), ("impulse", _double * 6)]


class State(ctypes.Structure):
    _fields_ = [("connected", _int), ("began", _int), ("lost", _int), ("fresh", _int),
                ("step", ctypes.c_uint64), ("acknowledged", ctypes.c_uint64), ("q_count", _int),
                ("v_count", _int), ("q", _double * MAX_CONFIGURATION), ("v", _double * MAX_DOF),
                ("contact_wrench", _double * 6), ("command", _double * 6), ("device_position", _double * 3),
                ("device_rotation", _double * 4), ("server", _int), ("active", _int), ("predicted", _int),
                ("buttons", ctypes.c_uint32), ("gripper", _double), ("round_trip", _double),
                ("servo_rate", _double), ("message", ctypes.c_char * MAX_TEXT)]


def _candidates():
    if named := os.environ.get("HAPTIC_LIBRARY"):
        return [named]
    beside = pathlib.Path(__file__).resolve().parent / "libhaptic.so.1"
    return ([str(beside)] if beside.exists() else []) + ["libhaptic.so.1"]


@functools.lru_cache(maxsize=None)
def load() -> ctypes.CDLL:
    """The library. Raises OSError that says where it was looked for."""
    errors = []
    for name in _candidates():
        try:
            library = ctypes.CDLL(name)
        except OSError as error:
            errors.append(str(error))
            continue
        return _declared(library, name)
    raise OSError("libhaptic is not found; install it or set HAPTIC_LIBRARY to its file: " + "; ".join(errors))


def _declared(library: ctypes.CDLL, name: str) -> ctypes.CDLL:
    if library.haptic_abi() != ABI:
        raise OSError(f"{name} has the interface {library.haptic_abi()}, this package needs {ABI}")
    session, address = ctypes.c_void_p, ctypes.c_void_p
    for function, result, *arguments in (
            ("haptic_default_options", Options),
            ("haptic_open", session, ctypes.POINTER(Options), ctypes.c_char_p, _size),
            ("haptic_close", None, session),
            ("haptic_poll", None, session, address),
            ("haptic_take_impulses", _size, session, _double, ctypes.POINTER(Impulse)),
            ("haptic_sample", ctypes.c_int, session, address, address, _double),
            ("haptic_track", None, session, address, _size, address, _size),
            ("haptic_send", ctypes.c_int64, session, address, _size, address, _size),
            ("haptic_error", ctypes.c_char_p, session)):
        declared = getattr(library, function)
        declared.restype, declared.argtypes = result, arguments
    return library
