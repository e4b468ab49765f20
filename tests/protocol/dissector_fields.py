"""The fields in Wireshark's dissector are those of PROTOCOL.md's tables.

Usage: dissector_fields.py [--write] PROTOCOL.md haptic.lua

Compares the dissector's part between its two marks with what the tables give; with --write it is
written there instead.
"""

import re
import sys

from document_test import read_tables

UNITS = "ns|s|kg·m²|kg|rad or m|m/s²|m/s|m|N·m·s/rad|N·m/rad|N·m|N·s/m|N·s|N/m|N|Hz|J"
HEXADECIMAL = {"session", "nonce", "fingerprint", "identity", "bitmap"}
# What a hello says wrongly is answered, and the header is checked as a whole.
UNCHECKED = {"header", "list", "hello", "link", "curve"}
SEALING = {"initiation", "response", "sealed"}  # the dissector's own: packets, not messages
# Bytes of the scene stream, which chunks cut anywhere.
RECORDS = {"record", "shape", "placement", "removal", "apart", "commit", "inertia", "joint"}
BEGIN = "-- Fields: from protocol/PROTOCOL.md, by tests/protocol/dissector_fields.py --write.\n"
END = "-- End of fields.\n"


def quoted(text):
    return '"' + text.replace("`", "").replace('"', '\\"') + '"'


def codes_in(meaning):
    return re.findall(r"(?:^|[;:] )(\d+) ([a-z_]+)(?=$|[;:.])", meaning)


def demand_for(allowed):
    """What the first part of a row allows; `unit` is demanded of all components together."""
    first = allowed.split(";")[0]
    if first in ("length", "speed"):
        return first.upper()
    if first.startswith(("> 0", "≥")):
        return {"> 0": "POSITIVE", "≥ 0": "NOT_NEGATIVE", "≥ 1": "NOT_0"}.get(first)
    if within := re.match(r"within ±(\S+)$", first):
        return f"between(-{within[1]}, {within[1]})"
    if span := re.search(r"(?:^|, )(\d\S*) to (\d\S*)$", first):
        return f"between({span[1]}, {span[2]})"
    return None


def components_of(kind, count, field, meaning):
    if count == "6":
        if "Ixx" in meaning:
            return "INERTIA"
        return "WRENCH" if field.startswith("F") else "TWIST"
    return {"3": "XYZ", "4": "WORDS", "7": "POSE", "21": "TRIANGLE", "70": "CURVE"}[count]


def call(function, *arguments):
    arguments = list(arguments)
    while arguments[-1] is None:
        arguments.pop()
    return f"{function}({', '.join(a or 'nil' for a in arguments)})"


def node(table, row, codes):
    _, kind, count, field, meaning, allowed = row
    clause = re.split("[;:]", meaning)[0]
    said = None if not clause or clause[0].isdigit() else quoted(clause)
    unit = re.search(rf"(?:^|, )({UNITS})(?=$|[;:,]| \()", meaning)
    label = quoted(f"{field} [{unit[1]}]" if unit else field)
    checked = table not in UNCHECKED or field.endswith("_size")
    demand = demand_for(allowed) if checked else None
    wire = "HEX64" if field in HEXADECIMAL else kind.upper()
    if count == "list":
        most = re.search(r"to (\d+) in all", allowed)[1]
        return call("list", quoted(field), quoted(kind), most)
    if kind == "char":
        return call("text", label, count if count.isdigit() else quoted(count), said)
    if table == "header" and field == "type":
        return call("code", label, said, "TYPES")
    if allowed == "0 or 1":
        return call("flag", label, said or quoted(re.sub(r"^\d:? (if )?", "", meaning.split(";")[0])))
    if kind == "u8" and (names := codes_in(meaning) or codes.get(field)):
        values = ", ".join(f'[{number}] = "{name}"' for number, name in names)
        return call("code", label, said, "{" + values + "}")
    if count is None:
        return call("field", wire, label, said, demand)
    if count.endswith("_size") and kind == "u8":
        return call("data", label, quoted(count), said)
    if count.endswith("_size"):
        return call("coordinates", wire, label, quoted(count), said, demand)
    whole = {"unit": "UNIT", "unit quaternion": "UNIT_QUATERNION"}.get(allowed.split("; ")[-1])
    parts = components_of(kind, count, field, meaning)
    return call("numbers", wire, label, parts, said, demand, whole if checked else None)


def lua_of(tables):
    tables = {name: table for name, table in tables.items() if name not in SEALING | RECORDS}
    messages = sorted((number, name) for name, (number, _) in tables.items() if number)
    lines = ["local TYPES = {" + ", ".join(quoted(name) for _, name in messages) + "}"]
    codes = {}
    for _, rows in tables.values():
        for row in rows:
            if row[1] == "u8" and row[5] != "0 or 1" and (names := codes_in(row[4])):
                codes.setdefault(row[3], names)
    lines.append("local TABLES = {")
    for name, (_, rows) in tables.items():
        lines.append(f"  {name} = {{")
        appended = False
        for row in rows:
            is_newer = re.search("older (client|server)s? sends? none", row[4])
            appended = appended or is_newer
            text = node(name, row, codes)
            is_optional = is_newer if row[2] == "list" else appended
            lines.append(f"    {f'optional({text})' if is_optional else text},")
        lines.append("  },")
    return "\n".join(lines + ["}", ""])


def main():
    document, dissector = sys.argv[-2:]
    text = open(dissector, encoding="utf-8").read()
    before, rest = text.split(BEGIN)
    written, after = rest.split(END)
    computed = lua_of(read_tables(open(document, encoding="utf-8").read()))
    if sys.argv[1] == "--write":
        open(dissector, "w", encoding="utf-8").write(before + BEGIN + computed + END + after)
    elif computed != written:
        sys.exit(f"{dissector}: its fields are not those of {document}; --write makes them so")


if __name__ == "__main__":
    main()
