"""The rooms of the house: how large each is beside its budget, which it leans on, and how large functions are. The budgets
are the tables of CONTRIBUTING.md, which nothing may exceed: what is added must be made room for.

Usage: house_test.py PROJECT_FOLDER
"""

import ast
import pathlib
import re
import subprocess
import sys

import lizard

ROOT = pathlib.Path(sys.argv[1]).resolve()
SOURCES = {".h", ".cc", ".c", ".py", ".js", ".mjs", ".css", ".html", ".lua", ".sh", ".map"}
CPP = {".h", ".cc", ".c"}
MOST_LINES, MOST_BRANCHES = 40, 15  # Of a function.
MOST_TESTS = 0.9  # Lines of tests for each of the product.
SKIPPED = 77
SERVER = "haptic_server"  # Whose folders lean on each other as a table says.
SHOWN = 12  # Largest functions.
ANALYSER = lizard.FileAnalyzer(lizard.get_extensions(["modified"]))  # A switch is one branch.

wrong = []


def table(title, columns):
    """Rows of the table below a heading of CONTRIBUTING.md, each a list of cells."""
    text = (ROOT / "CONTRIBUTING.md").read_text().split(f"\n## {title}\n")[1].split("\n## ")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    return [row for row in rows[2:] if len(row) == columns], text


def number(cell):
    return int(cell.replace(",", ""))


def tracked():
    if not (ROOT / ".git").exists():
        print("no git here says what belongs to the project")
        sys.exit(SKIPPED)
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    paths = [pathlib.PurePosixPath(name) for name in names.split("\0") if name]
    return [path for path in paths if (ROOT / path).is_file() and not (ROOT / path).is_symlink() and is_source(path)]


def is_source(path):
    if path.suffix:
        return path.suffix in SOURCES or path.name == "CMakeLists.txt"
    with open(ROOT / path, "rb") as file:
        return file.read(2) == b"#!"


def text_of(path):
    return (ROOT / path).read_text()


def included(path):
    """Files of ours that a file includes or imports."""
    if path.suffix in CPP:
        for angled, name in re.findall(r'^\s*#include ([<"])([^>"]+)[>"]', text_of(path), re.M):
            places = [name.removeprefix("hlm/")] if name.startswith("hlm/") or angled == "<" else [name, path.parent / name]
            yield from (pathlib.PurePosixPath(place) for place in places if (ROOT / place).is_file())
    elif path.suffix == ".js":
        for name in re.findall(r'from "\./([\w.]+)"', text_of(path)):
            yield path.parent / name
    elif path.suffix == ".py" and path.is_relative_to("client/python"):
        for node in ast.walk(ast.parse(text_of(path))):
            if isinstance(node, ast.ImportFrom) and node.level:
                for name in [node.module] if node.module else [alias.name for alias in node.names]:
                    file = path.parent / f"{name}.py"
                    yield file if (ROOT / file).exists() else path.parent / "__init__.py"


def circles(arrows):
    """Sets of nodes that lead back to themselves."""
    def reached(start):
        found, left = set(), [start]
        while left:
            new = arrows.get(left.pop(), set()) - found
            found |= new
            left += new
        return found
    all_reached = {node: reached(node) for node in arrows}
    return {frozenset(other for other in all_reached[node] if node in all_reached.get(other, ())) for node in arrows
            if node in all_reached[node]}


def check_sizes(rooms, sources):
    lines = {room: 0 for room in rooms}
    for path in sources:
        if path.parts[0] in rooms:
            lines[path.parts[0]] += text_of(path).count("\n")
    print(f"{'room':15} {'lines':>7} {'at most':>8} {'due':>7}")
    for room, (most, due, _) in rooms.items():
        print(f"{room:15} {lines[room]:7,} {most:8,} {due or '':>7}")
        if lines[room] > most:
            wrong.append(f"{room}/: {lines[room]:,} lines, at most {most:,}: make room for what was added")
    product = sum(count for room, count in lines.items() if room not in ("tests", "experiments"))
    ratio = lines["tests"] / product
    print(f"product {product:,} lines, tests {ratio:.2f} of it, at most {MOST_TESTS}")
    if ratio > MOST_TESTS:
        wrong.append(f"tests/: {ratio:.2f} of the product's lines, at most {MOST_TESTS}")


def check_directions(rooms, server, sources):
    files, folders = {}, {}
    for path in sources:
        room = path.parts[0]
        if room not in rooms or room == "tests":
            continue
        for other in included(path):
            if other.parts[0] != room and other.parts[0] in rooms and other.parts[0] not in rooms[room][2]:
                wrong.append(f"{path} includes {other}: {room}/ does not lean on {other.parts[0]}/")
            leans = server.get(path.parent.name) if str(path.parent.parent) == str(other.parent.parent) == SERVER else None
            if leans is not None and other.parent != path.parent and other.parent.name not in leans:
                wrong.append(f"{path} includes {other}: {path.parent}/ does not lean on {other.parent}/")
            if other.with_suffix("") != path.with_suffix(""):
                files.setdefault(path.with_suffix(""), set()).add(other.with_suffix(""))
            if other.parent != path.parent:
                folders.setdefault(path.parent, set()).add(other.parent)
    for arrows in (files, folders):
        wrong.extend(f"a circle of includes: {', '.join(sorted(map(str, circle)))}" for circle in circles(arrows))


def check_functions(rooms, sources, most):
    found = []
    for path in sources:
        if path.parts[0] in rooms and path.parts[0] != "tests" and path.suffix in CPP | {".py", ".js"}:
            for function in ANALYSER(str(ROOT / path)).function_list:
                found.append((function.nloc, function.cyclomatic_complexity, f"{path}: {function.name}"))
    large = [one for one in found if one[0] > MOST_LINES or one[1] > MOST_BRANCHES]
    print(f"{len(found):,} functions, {len(large)} above {MOST_LINES} lines or {MOST_BRANCHES} branches, at most {most}:")
    for lines, branches, name in sorted(large, key=lambda one: -max(one[0] / MOST_LINES, one[1] / MOST_BRANCHES))[:SHOWN]:
        print(f"  {lines:4} lines {branches:3} branches  {name}")
    if len(large) > most:
        wrong.append(f"{len(large)} functions above {MOST_LINES} lines or {MOST_BRANCHES} branches, at most {most}")


def check_walk():
    """What the walk through the code names is there."""
    rows, _ = table("From a datagram to the hand", 3)
    for _, file, names in rows:
        path = file.strip("`")
        text = text_of(path) if (ROOT / path).is_file() else wrong.append(f"the walk names {path}, which is not there") or ""
        for name in re.findall(r"`([\w:]+)`", names):
            if text and not re.search(rf"\b{name}\(", text):
                wrong.append(f"the walk names {name} in {path}, which has no such function")
    if len({file for _, file, _ in rows}) < 3:
        wrong.append("the walk has lost its steps")


def main():
    rows, text = table("Rooms", 5)
    rooms = {row[0].strip("`/"): (number(row[1]), row[2], set(re.findall(r"\w+", row[3]))) for row in rows}
    sources = tracked()
    check_sizes(rooms, sources)
    server = {row[0].strip("`/").removeprefix(f"{SERVER}/"): set(re.findall(r"\w+", row[1]))
              for row in table("Rooms", 3)[0] if row[0].startswith(f"`{SERVER}/")}
    check_directions(rooms, server, sources)
    check_functions(rooms, sources, number(re.search(r"([\d,]+) functions are larger", text)[1]))
    check_walk()
    if wrong:
        sys.exit("\n".join(wrong))


if __name__ == "__main__":
    main()
