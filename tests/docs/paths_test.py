"""Checks that every path which the documents name is in the tree, and that their links lead to files.

Usage: paths_test.py PROJECT_FOLDER

A path is what stands first between backticks and has a folder or the ending of a source file. In CONTRIBUTING.md it counts from
the project's folder; in the others a file's name alone may be that of any file. {h,cc} stands for both; of a path with
a word in capitals, which a reader replaces, the folder must exist.
"""

import os
import re
import sys

SKIPPED_FOLDERS = {".git", ".venv", "build", "out", "node_modules", "__pycache__"}
EXACT = {"CONTRIBUTING.md"}
QUOTED = re.compile(r"`([^`\n]+)`")
PATH = re.compile(r"[\w.{},/-]+")
SOURCE = re.compile(r"\.(?:h|cc|py|js|mjs|lua|sdf|md|txt|{h,cc})$")
PLACEHOLDER = re.compile(r"(?<![A-Z])(?:NAME|TARGET|VARIANT|PROGRAM|FILE)(?![A-Z])")
LINK = re.compile(r"\]\(([^)\s]+)\)")
FENCED = re.compile(r"^```.*?^```|^    [^\n]*$", re.M | re.S)
# What users' files are called, not ours.
OTHERS = {"model.sdf", "config.txt", "device.txt", ".sdf"}


def documents(root):
    yield from ("README.md", "CONTRIBUTING.md", "protocol/PROTOCOL.md")
    for folder, folders, names in os.walk(os.path.join(root, "docs")):
        folders[:] = [name for name in folders if name not in SKIPPED_FOLDERS]
        yield from (os.path.relpath(os.path.join(folder, name), root) for name in names if name.endswith(".md"))


def alternatives(path):
    """a.{h,cc} -> a.h, a.cc"""
    found = re.search(r"{([^}]*)}", path)
    if not found:
        return [path]
    return [each for choice in found.group(1).split(",")
            for each in alternatives(path[:found.start()] + choice + path[found.end():])]


def tree(root):
    """(paths of files and folders from the root on, names of files)"""
    paths, names = set(), set()
    for folder, folders, files in os.walk(root):
        folders[:] = [name for name in folders if name not in SKIPPED_FOLDERS]
        paths.update(os.path.relpath(os.path.join(folder, name), root) for name in folders + files)
        names.update(files)
    return paths, names


def is_there(path, paths, names, exact):
    if PLACEHOLDER.search(path):
        return os.path.dirname(path[:PLACEHOLDER.search(path).start()]) in paths
    path = path.rstrip("/")
    return path in paths or (not exact and "/" not in path and path in names)


def main():
    root = sys.argv[1]
    paths, names = tree(root)
    tops = {path.split("/")[0] for path in paths}
    wrong, right = [], 0
    for document in documents(root):
        with open(os.path.join(root, document), encoding="utf-8") as file:
            text = FENCED.sub("", file.read())
        for quoted in QUOTED.findall(text):
            named = PATH.match(quoted)
            path = named.group(0).rstrip(",.") if named else ""
            top, slash, _ = path.partition("/")
            if path in OTHERS or not (slash and top in tops or not slash and SOURCE.search(path)):
                continue
            if quoted[len(path):].startswith(("(", "=", ":")) and not slash:
                continue
            missing = [each for each in alternatives(path) if not is_there(each, paths, names, document in EXACT)]
            wrong += [f"{document}: {each} is not there" for each in missing]
            right += not missing
        for link in LINK.findall(text):
            file = link.split("#")[0]
            if not file or re.match(r"[a-z]+:", link):
                continue
            there = os.path.exists(os.path.join(root, os.path.dirname(document), file))
            if not there:
                wrong.append(f"{document}: the link {link} leads nowhere")
            right += there
    if wrong:
        sys.exit("\n".join(wrong))
    if right < 100:
        sys.exit(f"only {right} paths and links were found: the patterns no longer fit")
    print(f"{right} paths and links lead somewhere")


if __name__ == "__main__":
    main()
