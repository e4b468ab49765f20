#!/usr/bin/python3
"""The version is the same wherever it stands.

Usage: version_test.py SOURCE
"""

import pathlib
import re
import sys

SOURCE = pathlib.Path(sys.argv[1])
PLACES = {  # file, and what stands around the version or its beginning
    "CMakeLists.txt": r"project\(haptic_local_model VERSION (\S+)",
    "CITATION.cff": r"^version: (\S+)$",
    "CHANGELOG.md": r"^## \[(\d\S*)\]",
    "client/python/haptic_local_model/__init__.py": r'^__version__ = "(\S+)"$',
    "examples/bullet/CMakeLists.txt": r"find_package\(haptic_local_model (\S+) ",
    "examples/client/CMakeLists.txt": r"find_package\(haptic_local_model (\S+) ",
    "examples/mujoco_cpp/CMakeLists.txt": r"find_package\(haptic_local_model (\S+) ",
    "examples/mujoco/CMakeLists.txt": r"find_package\(haptic_local_model (\S+) ",
}

found = {file: re.search(pattern, (SOURCE / file).read_text(), re.M).group(1) for file, pattern in PLACES.items()}
version = found["CMakeLists.txt"]
wrong = {file: other for file, other in found.items() if not f"{version}.".startswith(f"{other}.")}
if wrong:
    sys.exit(f"the version is {version}, but: {wrong}")
