"""Checks that the recipes of CONTRIBUTING.md name every file of the product that names what they take as their example.

Usage: recipes_test.py PROJECT_FOLDER
"""

import os
import re
import sys

from paths_test import QUOTED, SKIPPED_FOLDERS, alternatives

# What each recipe takes as its example, and files that name it without a part in it.
RECIPES = {
    "Adding a shape": (r"ellipsoid", {"docs/adapter.md", "docs/method/detection.md", "worlds/mesh.sdf"}),
    "Adding a controller": (r"rotation.?coupler", set()),
    "Adding an option": (r"keep.?stiffness", set()),
}
# The past, the recipes themselves, and what is not the product.
OTHERS = {"CHANGELOG.md", "CONTRIBUTING.md"}
TESTS = {"tests"}


def files(root):
    for folder, folders, names in os.walk(root):
        top = folder == root
        folders[:] = [name for name in folders if name not in SKIPPED_FOLDERS and not (top and name in TESTS)]
        yield from (os.path.relpath(os.path.join(folder, name), root) for name in names)


def named_in(recipe):
    return {each for quoted in QUOTED.findall(recipe) for each in alternatives(quoted)}


def main():
    root = sys.argv[1]
    texts = {}
    for path in files(root):
        with open(os.path.join(root, path), encoding="utf-8", errors="ignore") as file:
            texts[path] = file.read()
    wrong = []
    for title, (example, without_part) in RECIPES.items():
        recipe = re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", texts["CONTRIBUTING.md"], re.M | re.S)
        named = named_in(recipe.group(1)) if recipe else set()
        there = {path for path, text in texts.items() if re.search(example, text, re.I)} - OTHERS
        if len(there) < 5:
            wrong.append(f"'{title}': {len(there)} files name {example}: the pattern no longer fits")
        wrong += [f"CONTRIBUTING.md, '{title}': {path} names {example} and is not in the recipe"
                  for path in sorted(there - without_part - named)]
        wrong += [f"'{title}': {path} does not name {example} any more" for path in sorted(without_part - there)]
    if wrong:
        sys.exit("\n".join(wrong))
    print(f"{len(RECIPES)} recipes name every file")


if __name__ == "__main__":
    main()
