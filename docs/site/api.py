"""The API reference as Markdown, from what stands in the sources.

Usage: api.py REPOSITORY python|c
"""

import ast
import pathlib
import re
import sys
import textwrap

PACKAGE = "client/python/haptic_local_model"
MODULES = {"haptic": "__init__.py", "haptic.dataset": "dataset/__init__.py", "haptic.mujoco": "mujoco.py", "haptic.shapes": "shapes.py", "haptic.virtual": "virtual.py"}
HEADERS = ("client/haptic.h",)


def words(text):
    """A docstring or comment as Markdown: indented lines are code already."""
    return re.sub(r"(?m)^(\s*)\* ", r"\1\\* ", text.strip("\n"))


def code(text, language=""):
    return f"```{language}\n{text.rstrip()}\n```\n"


# Python


def documented(name, signature, node, level):
    """A section on a function or a class; its text must not be empty."""
    text = ast.get_docstring(node)
    return [f"{'#' * level} {name}\n", code(signature, "python"), f"{words(text or '')}\n"]


def signature_of(node, name):
    arguments = node.args
    own = [each for each in arguments.args if each.arg not in ("self", "cls")]
    arguments = ast.arguments(**{**vars(arguments), "args": own})
    returns = f" -> {ast.unparse(node.returns)}" if node.returns and name[:1].islower() else ""
    line = re.sub(r"(?<=[\w\]])=(?=\S)", " = ", f"{name}({ast.unparse(arguments)}){returns}")
    return textwrap.fill(line, 100, subsequent_indent=" " * (len(name) + 1), break_long_words=False)


def decorated(node, decorator):
    return any(getattr(each, "id", "") == decorator for each in node.decorator_list)


def attributes_of(source, init):
    """[(name, text)] of `self.name … #: text`."""
    return re.findall(r"^ +self\.([a-z]\w*)[^#\n]*#: (.+)$", ast.get_source_segment(source, init) or "", re.M)


def class_of(source, node, level):
    methods = [each for each in node.body if isinstance(each, ast.FunctionDef)]
    init = next((each for each in methods if each.name == "__init__"), None)
    fields = re.search(r"_fields_ = \[(.*?)\]\n?$", ast.get_source_segment(source, node) or "", re.S)
    out = documented(node.name, signature_of(init, node.name) if init else f"class {node.name}", node, level)
    if fields:
        out.append("Fields: " + ", ".join(f"`{name}`" for name in re.findall(r'\("(\w+)"', fields.group(1))) + ".\n")
    if init and (attributes := attributes_of(source, init)):
        out += ["| attribute | |\n|---|---|"] + [f"| `{name}` | {text} |" for name, text in attributes] + [""]
    for each in methods:
        if each.name.startswith("_"):
            continue
        shown = each.name if decorated(each, "property") else signature_of(each, each.name)
        out += documented(f"{node.name}.{each.name}", shown, each, level + 1)
    return out


def constants_of(source, body, wanted):
    """The assignments of these names as they stand in the source, with their comments."""
    lines = source.splitlines()
    shown = []
    for node in body:
        if isinstance(node, ast.Assign):
            targets = [name.id for target in node.targets for name in ast.walk(target) if isinstance(name, ast.Name)]
            if set(targets) & wanted:
                first = node.lineno - 1
                while lines[first - 1].startswith("#"):
                    first -= 1
                shown.append("\n".join(lines[first:node.end_lineno]))
    return shown


def python_reference(root):
    out = ["# API reference: Python\n", "Made from the docstrings of [the package](../client/python/haptic_local_model). "
           "[First ten minutes](first_ten_minutes.md#your-first-client) has a whole client, "
           "[Adapters](adapter.md) say what to send.\n"]
    library = (root / PACKAGE / "_library.py").read_text()
    arguments = (root / PACKAGE / "_arguments.py").read_text()
    imported = {node.name: (text, node) for text in (library, arguments) for node in ast.parse(text).body
                if isinstance(node, ast.ClassDef)}
    for module, file in MODULES.items():
        source = (root / PACKAGE / file).read_text()
        tree = ast.parse(source)
        out += [f"## {module}\n", f"{words(ast.get_docstring(tree))}\n"]
        listed = next((set(ast.literal_eval(node.value)) for node in tree.body if isinstance(node, ast.Assign)
                       and getattr(node.targets[0], "id", "") == "__all__"), None)
        public = lambda name: name in listed if listed else not name.startswith("_")
        if listed:
            constants = constants_of(source, tree.body, listed)
            constants += constants_of(library, ast.parse(library).body, listed)
            out += ["### Constants\n", code("\n".join(constants), "python")]
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and public(node.name):
                out += documented(node.name, signature_of(node, f"{module}.{node.name}"), node, 3)
            elif isinstance(node, ast.ClassDef) and public(node.name):
                out += class_of(source, node, 3)
        if listed:
            for name in sorted(listed & imported.keys() | {"State"}):
                out += class_of(*imported[name], 3)
    return "\n".join(out)


# C


def uncommented(comment):
    """The text of a block comment."""
    inner = re.sub(r"^/\*+ ?|\s*\*/$", "", comment.strip())
    return textwrap.dedent("\n".join(re.sub(r"^ ?\* ?", "", line) for line in inner.splitlines()))


def declarations(header):
    """[(comment or "", declaration)], in order."""
    body = header[header.index("extern"):header.rindex("#ifdef __cplusplus")]
    pattern = re.compile(r"(?P<comment>^/\*.*?\*/\n)?(?P<declared>^(?:enum|typedef|HAPTIC_API)\b(?:[^;{]|\{[^{}]*\})*?;"
                         r"[^\n]*|^(?:#define[^\n]*\n)+)", re.M | re.S)
    return [(match["comment"] or "", match["declared"]) for match in pattern.finditer(body)]


def name_of(declared):
    if declared.startswith("#define"):
        return "Limits" if "MAX" in declared else "Version"
    if declared.startswith("HAPTIC_API"):
        return re.search(r"(\w+)\(", declared).group(1)
    return re.search(r"(?:enum|struct) (\w+)", declared).group(1)


def c_reference(root):
    out = ["# API reference: C\n", "Made from the comments of [haptic.h](../client/haptic.h). [The example](../examples/mujoco) is a whole adapter.\n"]
    for path in HEADERS:
        header = (root / path).read_text()
        top = uncommented(header[:header.index("*/") + 2])
        out += [f"## {pathlib.Path(path).name}\n", f"{words(re.sub(r'(?m)^  ', '    ', top))}\n"]
        found = declarations(header)
        texts = "\n".join(comment for comment, _ in found)
        sections = []  # [name, declarations, text]
        for comment, declared in found:
            function = declared.startswith("HAPTIC_API")
            if not comment and function and sections and sections[-1][1][-1].startswith("HAPTIC_API"):
                sections[-1][0] += f", {name_of(declared)}"
                sections[-1][1].append(declared)
                continue
            text = uncommented(comment) if comment else ""
            if not text and function and f"{name_of(declared)}()" in texts:
                text = next(uncommented(each) for each, _ in found if f"{name_of(declared)}()" in each)
            sections.append([name_of(declared), [declared], text])
        for name, declared, text in sections:
            out += [f"### {name}\n", code("\n".join(declared), "c"), f"{words(text)}\n"]
    return "\n".join(out)


def main():
    root, language = pathlib.Path(sys.argv[1]), sys.argv[2]
    print({"python": python_reference, "c": c_reference}[language](root))


if __name__ == "__main__":
    main()
