"""`python3 -m haptic_local_model.dataset`: see haptic_local_model.dataset."""

from __future__ import annotations

import argparse
import pathlib
import sys
from typing import Any, NoReturn, Optional, Sequence

from haptic_local_model import HapticError, dataset


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="haptic_dataset", description="Makes a data set of a server's recordings and the episodes that a simulator kept.",
        epilog="After -- come options of haptic_server as in the recording, for example --config server.toml.")
    parser.add_argument("inputs", nargs="*", metavar="FILE.pcap|FOLDER", help="recordings of haptic_server --record; folders of episodes")
    parser.add_argument("--to", choices=dataset.FORMATS, help="format")
    parser.add_argument("--out", help="file or folder to make; with --again the folder of all")
    parser.add_argument("--fps", type=float, default=30, help="frames in a second (default: 30)")
    parser.add_argument("--contacts", type=int, default=8, help="of how many contacts each frame tells (default: 8)")
    parser.add_argument("--state", default="", metavar="NAME[,NAME…]",
                        help="of --to lerobot: what its observation.state has besides, as force, or a logged stream")
    parser.add_argument("--again", action="append", default=[], metavar="NAME=VALUE[,VALUE…]",
                        help="the same hands with other values: delay in s or ms, or an option of the server; each combination")
    parser.add_argument("--check", metavar="SET", help="what a data set has in it, and what is missing")
    return parser


def _changes(given: Sequence[str]) -> dict[str, list[str]]:
    changes: dict[str, list[str]] = {}
    for text in given:
        name, equals, values = text.partition("=")
        if not (name and equals and all(values.split(","))):
            raise HapticError(f"--again {text} must be NAME=VALUE[,VALUE…]")
        changes.setdefault(name, []).extend(_seconds(value) if name == "delay" else value for value in values.split(","))
    return changes


def _seconds(text: str) -> str:
    try:
        return f"{float(text.removesuffix('ms')) / 1000:g}" if text.endswith("ms") else f"{float(text.removesuffix('s')):g}"
    except ValueError:
        raise HapticError(f"--again delay={text} must be a time, as 0.05 or 50ms") from None


def _make(options: argparse.Namespace, of_server: Sequence[str]) -> list[pathlib.Path]:
    """The sets that were made."""
    recordings: list[str] = []
    folders: list[str] = []
    for each in options.inputs:
        (folders if pathlib.Path(each).is_dir() else recordings).append(each)
    shared: dict[str, Any] = {"fps": options.fps, "contacts": options.contacts, "options": of_server,
                              "state": list(filter(None, options.state.split(",")))}
    if options.again:
        return dataset.again(recordings, folders, options.to, options.out, _changes(options.again), **shared)
    dataset.convert(recordings, folders, options.to, options.out, **shared)
    return [pathlib.Path(options.out)]


def main(arguments: Optional[Sequence[str]] = None) -> int:
    given = list(sys.argv[1:] if arguments is None else arguments)
    at = given.index("--") if "--" in given else len(given)
    parser = _parser()
    options = parser.parse_args(given[:at])
    if bool(options.check) == bool(options.to and options.out and options.inputs) or options.check and options.inputs:
        parser.error("give recordings, --to and --out; or --check SET alone")
    try:
        if options.check:
            print(*dataset.check(options.check), sep="\n")
        for place in _make(options, given[at + 1:]) if not options.check else ():
            summary, *more = dataset.check(place)
            print(summary)
            for line in more:
                if line.startswith(("left out", "missing")):
                    print(line, file=sys.stderr)
        return 0
    except HapticError as error:
        print(f"haptic_dataset: {error}", file=sys.stderr)
        return 2


def run() -> NoReturn:
    """The command haptic_dataset of a wheel."""
    sys.exit(main())


if __name__ == "__main__":
    run()
