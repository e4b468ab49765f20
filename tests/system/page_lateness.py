#!/usr/bin/python3
"""How late the servo's ticks are while pages look on, against ticks of the same session without any.

Usage: page_lateness.py SERVER CLIENT WORLDS [--seconds S] [--rounds N]

Each round has three phases: no page, two pages, and two pages one of which hangs. Prints the medians,
the 90th and the 99th percentiles and the ratio to no page.
"""

import argparse
import contextlib
import csv
import pathlib
import statistics
import tempfile
import time

from live_session import EXPERT, browser, hang, live_session, show

SETTLE = 2  # s after a page was opened or closed that are not counted
PHASES = ("no page", "two pages", "one of two hangs")
PERCENTILES = (50, 90, 99)


class Pages:
    """Two browsers of their own, so that neither is a tab in the background."""

    def __init__(self, stack, url):
        self.url = url
        self.browsers = [browser() for _ in range(2)]
        for driver in self.browsers:
            stack.callback(driver.quit)

    def enter(self, phase, seconds):
        if phase == PHASES[0]:
            for driver in self.browsers:
                driver.get("about:blank")
        elif phase == PHASES[1]:
            for driver in self.browsers:
                show(driver, self.url)
        else:
            hang(self.browsers[1], seconds)


def lines_of(log):
    return sum(1 for _ in log.open()) - 1


def measure(arguments, log):
    """{phase: [(first, last line of the log)]}"""
    spans = {phase: [] for phase in PHASES}
    with contextlib.ExitStack() as stack:
        session = stack.enter_context(live_session(arguments.server, arguments.client,
                                                   arguments.worlds, "--log", log, "--log-level",
                                                   "warn"))
        pages = Pages(stack, session.url + EXPERT)
        for _ in range(arguments.rounds):
            for phase in PHASES:
                pages.enter(phase, SETTLE + arguments.seconds)
                time.sleep(SETTLE)
                first = lines_of(log)
                time.sleep(arguments.seconds)
                spans[phase].append((first, lines_of(log)))
    return spans


def percentiles(values):
    steps = statistics.quantiles(values, n=100)
    return [steps[p - 1] for p in PERCENTILES]


def report(spans, log):
    with log.open() as file:
        lateness = [float(row["lateness_s"]) * 1e6 for row in csv.DictReader(file)]
    measured = {}
    for phase, parts in spans.items():
        measured[phase] = percentiles([value for first, last in parts for value in lateness[first:last]])
    print(f"{'lateness':18}" + "".join(f"{f'p{p}':>12}{'ratio':>8}" for p in PERCENTILES))
    for phase, values in measured.items():
        cells = (f"{value:9.1f} us{value / base:8.2f}"
                 for value, base in zip(values, measured[PHASES[0]]))
        print(f"{phase:18}" + "".join(cells))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("server")
    parser.add_argument("client")
    parser.add_argument("worlds")
    parser.add_argument("--seconds", type=float, default=10, help="of each phase (10)")
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        log = pathlib.Path(folder) / "ticks.csv"
        report(measure(arguments, log), log)


if __name__ == "__main__":
    main()
