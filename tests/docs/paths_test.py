"""Checks that what documents and sources name is there: paths, links, modules of headers, options, experiments, test programs.

Usage: paths_test.py PROJECT_FOLDER

In a document a path is what stands first between backticks and has a folder or the ending of a source file. In CONTRIBUTING.md it
counts from the project's folder; in the others a file's name alone may be that of any file. {h,cc} stands for both; of a path with
a word in capitals, which a reader replaces, the folder must exist. In sources a path begins with a folder of the project.
"""

import os
import re
import sys

SKIPPED_FOLDERS = {".git", ".venv", "build", "out", "node_modules", "__pycache__"}
EXACT = {"CONTRIBUTING.md"}
QUOTED = re.compile(r"`([^`\n]+)`")
PATH = re.compile(r"[\w.{},/-]+")
SOURCE = re.compile(r"\.(?:h|cc|py|js|mjs|lua|sdf|md|txt|{h,cc})$")
PLACEHOLDER = re.compile(r"(?<![A-Z])(?:NAME|TARGET|VARIANT|PROGRAM|FILE|COMMAND)(?![A-Z])")
LINK = re.compile(r"\]\(([^)\s]+)\)")
FENCED = re.compile(r"^```.*?^```|^    [^\n]*$", re.M | re.S)
# What files of users and of other projects are called.
OTHERS = {"model.sdf", "config.txt", "device.txt", ".sdf", "haply_teleoperation.py"}
READ = re.compile(r"\.(?:h|cc|c|py|js|mjs|sh|cmake|lua|md)$|CMakeLists\.txt$|^scripts/[\w-]+$")
# Made by a build or a setup.
MADE = {"docs/api_python.md", "docs/api_c.md", "docs/site/node_modules/.installed", "experiments/commit.h"}
# No paths of ours: a setting of a vendor's service, and what is named from its own folder.
NONE = {"devices/force_scale", "page/node_modules/axe-core/axe.min.js"}
# Options of programs that are not ours.
FOREIGN = {"cap-add", "ulimit", "system-site-packages", "name-match", "ignore-scripts", "reload", "now"}
TEST_PROGRAM = re.compile(r"`(test_\w+)[` ]")


def read(root, path):
    with open(os.path.join(root, path), encoding="utf-8", errors="ignore") as file:
        return file.read()


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
    if path in NONE:
        return True
    return path in paths or (not exact and "/" not in path and path in names)


def check_document(root, document, paths, names):
    """([a line for each path or link that leads nowhere], how many lead somewhere)"""
    tops = {path.split("/")[0] for path in paths}
    wrong, right = [], 0
    text = FENCED.sub("", read(root, document))
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
    return wrong, right


def check_sources(sources, paths):
    """Paths and modules, wherever they are named."""
    tops = "|".join(re.escape(path) for path in sorted(paths) if "/" not in path and f"{path}/" in " ".join(paths))
    named = re.compile(rf"(?<![\w/.$}}*<-])((?:{tops})/[\w./-]+)(?![\w{{}}$./-])")
    wrong = []
    for source, text in sources.items():
        if source == "CHANGELOG.md" or source.startswith("tests/docs/"):
            continue
        wrong += [f"{source}: {path} is not there" for path in map(lambda path: path.rstrip(".,/-"), named.findall(text))
                  if path not in MADE and not is_there(path, paths, (), True)]
        wrong += [f"{source}: hlm/{path} is not there" for path in re.findall(r"(?<![\w/-])hlm/([\w/]+(?:\.h)?)", text)
                  if not is_there(path, paths, (), True)]
    return wrong


def check_words(root, sources):
    """Options, experiments and test programs that the documents name."""
    code = "\n".join(text for path, text in sources.items() if not path.endswith(".md"))
    scripts = "\n".join(text for path, text in sources.items() if path.startswith("scripts/") or path.endswith(".py"))
    # A number of an option is named in words: "fade time" is --fade-time.
    options = {name.replace(" ", "-") for name in re.findall(r'"(?:--)?([a-z][a-z0-9 -]+)"', code)} | FOREIGN
    options |= set(re.findall(r"--([a-z][a-z-]+)", scripts))
    experiments = set(re.findall(r'^    {"(\w+)", \w+, [\d.]+', sources["experiments/sweep.cc"], re.M))
    programs = set(re.findall(r"(?:hlm_test|add_executable)\((test_\w+)", code))
    wrong = []
    for document in documents(root):
        text = sources[document]
        for kind, there, said in (("option --", options, re.findall(r"(?<![\w-])--([a-z][a-z0-9-]+)", text)),
                                  ("experiment ", experiments, re.findall(r"reproduce --only (\w+)", text)),
                                  ("test program ", programs, TEST_PROGRAM.findall(text))):
            wrong += [f"{document}: there is no {kind}{name}" for name in said if name not in there]
    if len(experiments) < 5 or len(programs) < 5:
        wrong.append(f"{len(experiments)} experiments and {len(programs)} test programs: the patterns no longer fit")
    return wrong


def main():
    root = sys.argv[1]
    paths, names = tree(root)
    sources = {path: read(root, path) for path in sorted(paths)
               if READ.search(path) and os.path.isfile(os.path.join(root, path))}
    wrong, right = check_sources(sources, paths) + check_words(root, sources), 0
    for document in documents(root):
        missing, found = check_document(root, document, paths, names)
        wrong += missing
        right += found
    if wrong:
        sys.exit("\n".join(wrong))
    if right < 100:
        sys.exit(f"only {right} paths and links were found: the patterns no longer fit")
    print(f"{right} paths and links lead somewhere, and what {len(sources)} sources name is there")


if __name__ == "__main__":
    main()
