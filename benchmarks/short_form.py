"""`is_short`: the option `--quick` of benchmarks without other options."""

from __future__ import annotations

import argparse


def is_short(description: str | None) -> bool:
    """Return True if the command line asks for the short form of a benchmark.

    `--help` and unknown options end the program.

    Args:
        description: Text of the help, the docstring of the benchmark.
    """
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="measure a short form")
    return bool(parser.parse_args().quick)
