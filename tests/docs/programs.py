#!/usr/bin/python3
"""Writes the programs that a document shows to a folder: what is indented below a heading "Hello world in …".

Usage: programs.py DOCUMENT FOLDER
"""

import pathlib
import re
import sys

FILES = {"C": "hello.c", "C++": "hello.cc"}

document, folder = (pathlib.Path(argument) for argument in sys.argv[1:3])
text = document.read_text()
for language, file in FILES.items():
    found = re.search(rf"^### Hello world in {re.escape(language)}\n\n((?:    .*\n|\n)+)", text, re.M)
    if not found:
        sys.exit(f"{document} has no program below 'Hello world in {language}'")
    (folder / file).write_text(re.sub(r"^    ", "", found.group(1), flags=re.M))
