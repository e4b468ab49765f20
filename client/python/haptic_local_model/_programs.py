"""The programs that come with this package, or are installed beside it: haptic_server, ve_client, haptic_doctor …"""

from __future__ import annotations

import os
import pathlib
import shutil
import sys
from typing import NoReturn

import haptic_local_model as haptic


def program(name: str) -> str:
    """The file of a program: in the folder that HAPTIC_PROGRAMS names, of this wheel, of the prefix that this package is
    installed in, or in PATH. Raises haptic.HapticError that says where it was looked for."""
    here = pathlib.Path(__file__).resolve().parent
    is_wheel = (here / "bin").is_dir()  # Its commands, in the prefix and in PATH, are run() below.
    if named := os.environ.get("HAPTIC_PROGRAMS"):
        places = [pathlib.Path(named)]
    elif is_wheel:
        places = [here / "bin"]
    else:  # PREFIX/lib/python3/dist-packages/haptic_local_model
        places = [parent / "bin" for parent in list(here.parents)[3:4]]
    for place in places:
        if os.access(place / name, os.X_OK):
            return str(place / name)
    if is_wheel and not named:
        raise haptic.HapticError(f"there is no {name}: this wheel is for systems with a glibc before 2.35, on which its library for "
                                 "world files does not run. Sessions of your own simulator do not need it")
    found = None if named else shutil.which(name)
    if found is None:
        searched = ", ".join(map(str, places)) + ("" if named else ", PATH")
        raise haptic.HapticError(f"there is no {name}: looked in {searched}. Install it, or set HAPTIC_PROGRAMS to its folder")
    return found


def run() -> NoReturn:
    """The program by whose name this was called, in place of this one: the commands of a wheel."""
    try:
        file = program(pathlib.Path(sys.argv[0]).name)
    except haptic.HapticError as error:
        sys.exit(f"haptic: {error}")
    os.execv(file, [file, *sys.argv[1:]])
