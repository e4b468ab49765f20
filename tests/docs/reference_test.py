"""Checks the API reference that the site is built with: it has every function of the headers and every public name of the
package, each with its words.

Usage: reference_test.py PROJECT_FOLDER
"""

import ast
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(sys.argv[1])


def sections(language):
    """{title: [what stands below it, code left out]}"""
    text = subprocess.run([sys.executable, ROOT / "docs/site/api.py", ROOT, language], check=True,
                          capture_output=True, text=True).stdout
    found = {}
    for section in re.split(r"^#+ ", text, flags=re.M)[1:]:
        title, _, rest = section.partition("\n")
        found.setdefault(title, []).append(re.sub(r"^```.*?^```$", "", rest, flags=re.M | re.S).strip())
    return found


def listed_names():
    tree = ast.parse((ROOT / "client/python/haptic_local_model/__init__.py").read_text())
    return next(ast.literal_eval(node.value) for node in tree.body
                if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__")


wrong = []
c = sections("c")
for name in re.findall(r"^HAPTIC_API [^;]*?(\w+)\(", (ROOT / "client/haptic.h").read_text(), re.M):
    if not any(name in title.split(", ") and any(texts) for title, texts in c.items()):
        wrong.append(f"C: {name} is not there, or without a word")
python = sections("python")
wrong += [f"Python: {title} is without a word" for title, texts in python.items()
          if not all(texts) and title not in ("Constants", "API reference: Python")]
source = subprocess.run([sys.executable, ROOT / "docs/site/api.py", ROOT, "python"], check=True, capture_output=True,
                        text=True).stdout
wrong += [f"Python: {name} is not there" for name in listed_names() if not re.search(rf"\b{name}\b", source)]
for title in ("Session.send", "Session.drive", "from_mujoco", "Link", "HapticError"):
    if title not in python:
        wrong.append(f"Python: {title} is not there")
if wrong:
    sys.exit("\n".join(wrong))
print(f"{len(c)} sections on C and {sum(map(len, python.values()))} on Python have their words")
