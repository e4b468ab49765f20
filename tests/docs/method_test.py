"""Checks the method document: docs/method.md lists every section of docs/method/, what the tree cites exists, and so do the
tests that are named there and in docs/safety.md.

Usage: method_test.py PROJECT_FOLDER
"""

import os
import re
import sys

SKIPPED_FOLDERS = {".git", "build", "out", "node_modules", ".venv"}
# A citation may be wrapped, with the marks of a comment before its number: "docs/method.md 2 and 4.1".
NUMBER = r"\d+(?:\.\d+)?"
CITATION = re.compile(rf"docs/method\.md`?[\s/#*]+({NUMBER}(?:(?:,| and| to) {NUMBER})*)")
SECTION = re.compile(rf"^##+ (({NUMBER})\.? (.+))$", re.M)
LISTED = re.compile(rf"^ *- ({NUMBER})\.? \[(.+)\]\(method/(\w+\.md)#(\S+)\)$", re.M)
NAMED_TEST = re.compile(r"`(\w+_test\.cc): ([^`]+)`")
TEST_CASE = re.compile(r'TEST_CASE\(\s*((?:"(?:[^"\\]|\\.)*"\s*)+)')
LITERAL = re.compile(r'"((?:[^"\\]|\\.)*)"')


def read(path):
    with open(path, encoding="utf-8", errors="ignore") as file:
        return file.read()


def files(root):
    for folder, folders, names in os.walk(root):
        folders[:] = [name for name in folders if name not in SKIPPED_FOLDERS]
        yield from (os.path.join(folder, name) for name in names)


def anchor(heading):
    """As GitHub makes it."""
    return re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", heading.lower()).strip())


def find_wrong_entries(index, parts):
    """[a line for each difference between the list of sections and the headings of the files]"""
    listed = {number: (title, file, place) for number, title, file, place in LISTED.findall(index)}
    there = {number: (title, file, anchor(heading))
             for file, text in parts.items() for heading, number, title in SECTION.findall(text)}
    return [f"docs/method.md lists {number} as {listed.get(number)}, it is {there.get(number)}"
            for number in sorted(listed.keys() | there.keys()) if listed.get(number) != there.get(number)]


def find_missing_sections(root, sections):
    """([a line for each citation of a section that does not exist], how many citations are right)"""
    cited = []
    for path in files(root):
        for numbers in CITATION.findall(read(path)):
            name = os.path.relpath(path, root)
            cited += [(name, number) for number in re.findall(NUMBER, numbers)]
    wrong = [f"{name}: docs/method.md has no section {n}" for name, n in cited if n not in sections]
    return wrong, len(cited) - len(wrong)


def find_missing_tests(root, document):
    """([a line for each test that is named and does not exist], how many names are right)"""
    cases = {}
    for path in files(os.path.join(root, "tests")):
        literals = (LITERAL.findall(case) for case in TEST_CASE.findall(read(path)))
        cases.setdefault(os.path.basename(path), set()).update("".join(case) for case in literals)
    named = [(file, " ".join(case.split())) for file, case in NAMED_TEST.findall(document)]
    wrong = [f"docs/method, docs/safety.md: no test '{case}' in {file}"
             for file, case in named if case not in cases.get(file, ())]
    return wrong, len(named) - len(wrong)


def main():
    root = sys.argv[1]
    index = read(os.path.join(root, "docs", "method.md"))
    folder = os.path.join(root, "docs", "method")
    parts = {name: read(os.path.join(folder, name)) for name in os.listdir(folder)}
    headings = [number for text in parts.values() for _, number, _ in SECTION.findall(text)]
    wrong = find_wrong_entries(index, parts)
    wrong += [f"docs/method has section {n} twice" for n in sorted(set(headings)) if headings.count(n) > 1]
    wrong_sections, sections = find_missing_sections(root, set(headings))
    safety = read(os.path.join(root, "docs", "safety.md"))
    wrong_tests, tests = find_missing_tests(root, "\n".join([*parts.values(), safety]))
    if wrong or wrong_sections or wrong_tests:
        sys.exit("\n".join(wrong + wrong_sections + wrong_tests))
    if not sections or not tests:
        sys.exit("docs/method.md is not cited, or names no tests: the patterns no longer fit")
    print(f"{len(headings)} sections, {sections} citations of them and {tests} names of tests are right")


if __name__ == "__main__":
    main()
