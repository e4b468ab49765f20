"""libhaptic.so, as haptic.h declares it."""

from __future__ import annotations

import ctypes
import functools
import os
import pathlib
from typing import Any, Iterable

ABI = 5
MAX_DOF, MAX_CONFIGURATION, MAX_CONTACTS, MAX_BODIES, MAX_POSES, MAX_TEXT = 16, 17, 192, 16, 64, 240
CURVE_TERMS = 10
NO_LIMIT = 1e9  # rad or m: a joint's limit that is none

_double, _int, _size = ctypes.c_double, ctypes.c_int32, ctypes.c_size_t


class Link(ctypes.Structure):
    """A link of the virtual tool, as haptic_link in haptic.h. haptic.box() and haptic.sphere() make one."""
    __slots__ = ()  # A field that is misspelt is an error.
    _fields_ = [("parent", _int), ("joint", _int), ("position", _double * 3), ("rotation", _double * 4),
                ("axis", _double * 3), ("mass", _double), ("centre", _double * 3), ("inertia", _double * 9),
                ("lower", _double), ("upper", _double)]


class Curve(ctypes.Structure):
    """How a guided link moves, as haptic_curve in haptic.h."""
    __slots__ = ()
    _fields_ = [("link", _int), ("leader", _int), ("armature", _double), ("terms", _double * 7 * CURVE_TERMS)]


class Drive(ctypes.Structure):
    """What drives a joint of the tool, as haptic_drive in haptic.h."""
    __slots__ = ()
    _fields_ = [("link", _int), ("follows_device", _int), ("target", _double), ("closed", _double), ("open", _double),
                ("stiffness", _double), ("damping", _double), ("most", _double)]


class Options(ctypes.Structure):
    _fields_ = [("server", ctypes.c_char_p), ("key_file", ctypes.c_char_p), ("links", ctypes.POINTER(Link)),
                ("link_count", _size), ("hand_link", _int), ("hand_position", _double * 3),
                ("hand_rotation", _double * 4), ("gravity", _double * 3), ("length", _double),
                ("q", _double * MAX_CONFIGURATION), ("rate", _double), ("epsilon", _double),
                ("clears_fault", _int), ("made_of_defaults", ctypes.c_uint32), ("curves", ctypes.POINTER(Curve)),
                ("curve_count", _size)]


class Impulse(ctypes.Structure):
    _fields_ = [("body", ctypes.c_uint32), ("reserved", ctypes.c_uint32), ("impulse", _double * 6)]


class Shape(ctypes.Structure):
    """As haptic_shape in haptic.h. haptic.shapes makes one."""
    _fields_ = [("kind", _int), ("side", _int), ("index", ctypes.c_uint32), ("group", ctypes.c_uint32),
                ("mask", ctypes.c_uint32), ("vertex_count", ctypes.c_uint32), ("size", _double * 3),
                ("vertices", ctypes.c_void_p), ("triangles", ctypes.c_void_p), ("triangle_count", _size)]


class State(ctypes.Structure):
    """The latest news of the server, as haptic_state in haptic.h."""
    _fields_ = [("connected", _int), ("began", _int), ("lost", _int), ("fresh", _int),
                ("step", ctypes.c_uint64), ("acknowledged", ctypes.c_uint64), ("q_count", _int),
                ("v_count", _int), ("q", _double * MAX_CONFIGURATION), ("v", _double * MAX_DOF),
                ("contact_wrench", _double * 6), ("command", _double * 6), ("device_position", _double * 3),
                ("device_rotation", _double * 4), ("server", _int), ("active", _int), ("predicted", _int),
                ("buttons", ctypes.c_uint32), ("scene", _int), ("holds", _int), ("gripper", _double), ("grip", _double), ("round_trip", _double),
                ("servo_rate", _double), ("message", ctypes.c_char * MAX_TEXT)]


class Network(ctypes.Structure):
    """As haptic_network in haptic_virtual.h."""
    _fields_ = [("delay", _double), ("jitter", _double), ("loss", _double), ("seed", ctypes.c_uint64)]


def _candidates(stem: str, variable: str) -> list[str]:
    if named := os.environ.get(variable):
        return [named]
    if stem != "libhaptic" and (named := os.environ.get("HAPTIC_LIBRARY")):
        return [str(pathlib.Path(named).with_name(f"{stem}.so.{ABI}"))]
    here = pathlib.Path(__file__).resolve().parent
    # Next to this package, in a wheel, and in PREFIX/lib or PREFIX/lib/ARCHITECTURE of PREFIX/lib/python3/dist-packages.
    near = [here, here / "lib", *(here.parents[3].glob("lib*") if len(here.parents) > 3 else ())]
    found = [path for folder in near for path in (folder / f"{stem}.so.{ABI}", *folder.glob(f"*-linux-gnu/{stem}.so.{ABI}"))]
    return [str(path) for path in found if path.exists()] + [f"{stem}.so.{ABI}"]


def _found(stem: str, variable: str) -> tuple[ctypes.CDLL, str]:
    errors = []
    for name in _candidates(stem, variable):
        try:
            return ctypes.CDLL(name), name
        except OSError as error:
            errors.append(str(error))
    raise OSError(f"{stem} is not found; install it or set {variable} to its file: " + "; ".join(errors))


@functools.lru_cache(maxsize=None)
def load() -> ctypes.CDLL:
    """The library. Raises OSError that says where it was looked for."""
    return _loaded("libhaptic", "HAPTIC_LIBRARY", _functions())


@functools.lru_cache(maxsize=None)
def load_virtual() -> ctypes.CDLL:
    """The one with servers in virtual time, too. Raises OSError likewise."""
    return _loaded("libhaptic_virtual", "HAPTIC_VIRTUAL_LIBRARY", (*_functions(), *_virtual_functions()))


def _loaded(stem: str, variable: str, functions: Iterable[tuple[Any, ...]]) -> ctypes.CDLL:
    library, name = _found(stem, variable)
    abi = _declared(library, name, [("haptic_abi", ctypes.c_int)]).haptic_abi()
    if abi != ABI:
        raise OSError(f"{name} has the interface {abi}, this package needs {ABI}")
    return _declared(library, name, functions)


def _functions() -> Iterable[tuple[Any, ...]]:
    """Of libhaptic.so: name, type of the result, types of the arguments."""
    session, address = ctypes.c_void_p, ctypes.c_void_p
    return (
        ("haptic_default_options", Options),
        ("haptic_open", session, ctypes.POINTER(Options), ctypes.c_char_p, _size),
        ("haptic_own_server", ctypes.c_char_p, session),
        ("haptic_show", ctypes.c_char_p, session, ctypes.c_uint16, ctypes.c_int),
        ("haptic_close", None, session),
        ("haptic_offer", ctypes.c_int, session, ctypes.POINTER(Shape), address, address, _size, address, _size,
         address, _size),
        ("haptic_place", ctypes.c_int, session, address, _size),
        ("haptic_poll", None, session, address),
        ("haptic_now", _double, session),
        ("haptic_session_id", ctypes.c_uint64, session),
        ("haptic_take_steps", ctypes.c_int, session, _double),
        ("haptic_take_held", _size, session, address),
        ("haptic_tool_pushes", ctypes.c_int, session),
        ("haptic_take_impulses", _size, session, _double, ctypes.POINTER(Impulse)),
        ("haptic_sample", ctypes.c_int, session, address, address, _double),
        ("haptic_track", None, session, address, _size, address, _size),
        ("haptic_external_wrench", ctypes.c_int, session, ctypes.c_int32, address),
        ("haptic_drive_joints", ctypes.c_int, session, ctypes.POINTER(Drive), _size),
        ("haptic_send", ctypes.c_int64, session, address, _size, address, _size),
        ("haptic_hold", ctypes.c_int, session, address, address),
        ("haptic_release", None, session),
        ("haptic_error", ctypes.c_char_p, session))


def _virtual_functions() -> Iterable[tuple[Any, ...]]:
    """Of libhaptic_virtual.so besides."""
    server = ctypes.c_void_p
    return (
        ("haptic_virtual_open", server, ctypes.POINTER(ctypes.c_char_p), _size, ctypes.POINTER(Network), ctypes.c_char_p, _size),
        ("haptic_virtual_address", ctypes.c_char_p, server),
        ("haptic_virtual_warnings", ctypes.c_char_p, server),
        ("haptic_virtual_now", _double, server),
        ("haptic_virtual_stop", None, server),
        ("haptic_virtual_wait", ctypes.c_int, server, _double),
        ("haptic_virtual_set_frame", None, server, _double),
        ("haptic_virtual_set_network", ctypes.c_int, server, ctypes.POINTER(Network)),
        ("haptic_virtual_columns", ctypes.c_char_p),
        ("haptic_virtual_ticks", _size, server),
        ("haptic_virtual_copy_ticks", _size, server, _size, _size, ctypes.c_void_p),
        ("haptic_virtual_close", None, server))


def _declared(library: ctypes.CDLL, name: str, functions: Iterable[tuple[Any, ...]]) -> ctypes.CDLL:
    for function, result, *arguments in functions:
        declared = getattr(library, function, None)
        if declared is None:
            raise OSError(f"{name} has no {function}(): it is another library, or older than this package")
        declared.restype, declared.argtypes = result, arguments
    return library
