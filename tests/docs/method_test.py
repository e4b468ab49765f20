"""Checks docs/method.md: what the tree cites of it exists, and so do the tests that it names.

Usage: method_test.py PROJECT_FOLDER
"""

import os
import re
import sys

SKIPPED_FOLDERS = {".git", "build", "out", "node_modules"}
# A citation may be wrapped, with the marks of a comment before its number: "docs/method.md 2 and 4.1".
NUMBER = r"\d+(?:\.\d+)?"
CITATION = re.compile(rf"docs/method\.md[\s/#*]+({NUMBER}(?:(?:,| and| to) {NUMBER})*)")
SECTION = re.compile(rf"^##+ ({NUMBER})\.? ", re.M)
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


def find_missing_sections(root, document):
    """([a line for each citation of a section that does not exist], how many citations are right)"""
    sections = set(SECTION.findall(document))
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
    wrong = [f"docs/method.md: no test '{case}' in {file}"
             for file, case in named if case not in cases.get(file, ())]
    return wrong, len(named) - len(wrong)


def main():
    root = sys.argv[1]
    document = read(os.path.join(root, "docs", "method.md"))
    wrong_sections, sections = find_missing_sections(root, document)
    wrong_tests, tests = find_missing_tests(root, document)
    if wrong_sections or wrong_tests:
        sys.exit("\n".join(wrong_sections + wrong_tests))
    if not sections or not tests:
        sys.exit("docs/method.md is not cited, or names no tests: the patterns no longer fit")
    print(f"{sections} citations of sections and {tests} names of tests are right")


if __name__ == "__main__":
    main()
