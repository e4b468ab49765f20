"""Arguments of the Python scripts in this folder: what is wrong with one is said in one line."""

import argparse
import pathlib
import sys


class Arguments(argparse.ArgumentParser):
    def __init__(self, description):
        super().__init__(prog=f"scripts/{pathlib.Path(sys.argv[0]).name}", description=description,
                         formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False)

    def parse_args(self, args=None, namespace=None):
        """An unknown option is named before what is missing."""
        args = sys.argv[1:] if args is None else args
        for argument in args:
            if argument.startswith("--") and argument.partition("=")[0] not in self._option_string_actions:
                self.error(f"'{argument}' is unknown")
        return super().parse_args(args, namespace)

    def error(self, message):
        usage = " ".join(self.format_usage().split())
        print(f"{self.prog}: {message}; {usage}", file=sys.stderr)
        sys.exit(2)
