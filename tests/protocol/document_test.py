"""Checks PROTOCOL.md against itself: encodes its examples by its tables alone and compares the bytes.

The C++ tests compare the same bytes with the implementation. With --write the bytes are written
into the document instead.
"""

import math
import re
import struct
import sys

FORMATS = {"u8": "B", "i8": "b", "u16": "H", "u32": "I", "u64": "Q", "i64": "q", "f32": "f", "f64": "d"}
MAX_DATAGRAM = 1168  # of what a sender fills
HEADER = 40


def read_tables(document):
    """{table name: (message type or None, rows of (offset or None, type, count or None, field, meaning, allowed))}

    A count is a number, a field, or a product of them: `3·vertex_count`.
    """
    tables = {}
    for section in re.split(r"^### Table: ", document, flags=re.M)[1:]:
        name = section.split("\n", 1)[0].strip()
        section = re.split(r"^##", section, flags=re.M)[0]
        number = re.search(r"^Type (\d+),", section, flags=re.M)
        row = r"^\| (\d+|—) \| (\w+)(?:\[([\w·]+)\])? \| (\w+) \| (.*?) ?\| (.*) \|$"
        rows = re.findall(row, section, flags=re.M)
        if not rows:
            sys.exit(f"table {name} has no rows")
        fields = [(None if o == "—" else int(o), t, c or None, *rest) for o, t, c, *rest in rows]
        tables[name] = (int(number.group(1)) if number else None, fields)
    return tables


def read_kinds(document):
    """{table name: kind} of the records of the scene stream."""
    pairs = re.findall(r"^### Table: (\w+)\n\nKind (\d+),", document, flags=re.M)
    return {name: int(number) for name, number in pairs}


def read_examples(document):
    """[(message name, {field: text}, hex)]"""
    pattern = r"^### Example: (\w+)\n.*?```values\n(.*?)```\n\n```hex\n(.*?)```"
    examples = []
    for name, values, data in re.findall(pattern, document, flags=re.M | re.S):
        examples.append((name, dict(line.split(" = ", 1) for line in values.splitlines()), data))
    return examples


def encode_fields(tables, fields, values, prefix, data):
    """Appends the fields; returns where the first list begins, None without one."""
    lists = None
    for offset, kind, count, field, *_ in fields:
        if offset is not None and offset != len(data):
            sys.exit(f"field {field} is at {len(data)}, its table says {offset}")
        if kind in tables:
            lists = lists or len(data)
            encode_list(tables, kind, values, prefix + field, data)
            continue
        text = values[prefix + field]
        if kind == "char":
            data += text.encode()
            continue
        number = float if kind.startswith("f") else int
        numbers = [number(part) for part in text.split()]
        expected = math.prod(int(values.get(factor, factor)) for factor in (count or "1").split("·"))
        if len(numbers) != expected:
            sys.exit(f"field {field} has {len(numbers)} values, its table says {expected}")
        data += struct.pack(f"<{expected}{FORMATS[kind]}", *numbers)
    return lists


def encode_list(tables, kind, values, name, data):
    items = []
    for i in range(int(values[f"{name}.count"])):
        item = bytearray()
        encode_fields(tables, tables[kind][1], values, f"{name}.{i}.", item)
        items.append(item)
    values = dict(values, **{f"{name}.item_size": str(len(items[0]) if items else 0)})
    encode_fields(tables, tables["list"][1], values, f"{name}.", data)
    for item in items:
        data += item


def encode(tables, message, values):
    values = dict(values, magic="HLMI", version="2", flags="0", tool="0", reserved="0")
    values.update(type=str(tables[message][0]), length="0", block="0")
    data = bytearray()
    encode_fields(tables, tables["header"][1], values, "", data)
    lists = encode_fields(tables, tables[message][1], values, "", data)
    if len(data) > MAX_DATAGRAM:
        sys.exit(f"{message} has {len(data)} bytes")
    offsets = {field: offset for offset, _, _, field, *_ in tables["header"][1]}
    struct.pack_into("<H", data, offsets["length"], len(data))
    struct.pack_into("<H", data, offsets["block"], (lists or len(data)) - HEADER)
    return bytes(data)


def encode_record(tables, kind, name, values):
    data = bytearray()
    encode_fields(tables, tables["record"][1], dict(values, kind=str(kind), length="0"), "", data)
    encode_fields(tables, tables[name][1], values, "", data)
    struct.pack_into("<I", data, 1, len(data) - 5)
    return bytes(data)


def hash_of_shape(data):
    """FNV-1a of what stands behind the hash in a record."""
    value = 0xCBF29CE484222325
    for byte in data[13:]:
        value = (value ^ byte) * 0x100000001B3 % 2**64
    return value


def hex_lines(data):
    return "".join(data[i : i + 32].hex() + "\n" for i in range(0, len(data), 32))


def main():
    path = sys.argv[-1]
    document = open(path, encoding="utf-8").read()
    tables = read_tables(document)
    examples = read_examples(document)
    described = {name for name, (number, _) in tables.items() if number is not None}
    kinds = read_kinds(document)
    if {name for name, _, _ in examples} != described | set(kinds) or (len(described), len(kinds)) != (14, 7):
        sys.exit("each of the fourteen messages and seven records must have an example")
    for name, values, written in examples:
        data = encode_record(tables, kinds[name], name, values) if name in kinds else encode(tables, name, values)
        if name == "shape" and int(values["hash"]) != hash_of_shape(data):
            sys.exit(f"the hash of the shape is {hash_of_shape(data)}")
        computed = hex_lines(data)
        if sys.argv[1] == "--write":
            document = re.sub(
                rf"(### Example: {name}\n.*?```hex\n).*?```",
                lambda match: match.group(1) + computed + "```",
                document,
                count=1,
                flags=re.S,
            )
        elif computed != written:
            sys.exit(f"{name}: the tables give\n{computed}but the example says\n{written}")
    if sys.argv[1] == "--write":
        open(path, "w", encoding="utf-8").write(document)
    print(f"{len(examples)} examples agree with the tables")


if __name__ == "__main__":
    main()
