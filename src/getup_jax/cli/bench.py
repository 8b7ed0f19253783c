"""`getup-bench`: how well anybody's policy gets up, by several rules."""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from getup_jax.core.output_file import write_text
from getup_jax.evaluation import bench, bench_report
from getup_jax.evaluation.bench import Result
from getup_jax.runtime.console import Display


def bench_command(args: argparse.Namespace) -> int:
    """The command line of `getup-bench`; returns the exit code.

    What has been run when it is interrupted is printed and written all the same.
    """
    begin = time.monotonic()
    entry = bench.find_entry(args.policy)
    number = bench.check(entry, args.quick, args.engine)  # a mistake is said before anything is run
    result = None
    try:
        with Display(number, unit="episodes") as display:
            for result in bench.run_bench(entry, args.quick, args.engine, display):
                if args.json is not None:
                    _write(args.json, result)
    finally:
        if result is not None:
            print(bench_report.table(result))
    print(f"{number} episodes in {time.monotonic() - begin:.0f} s")
    return 0


def _write(path: Path, result: Result) -> None:
    text = json.dumps(bench_report.to_json(result), indent=2)
    write_text(path, text + "\n")
