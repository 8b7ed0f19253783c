"""`getup-bench`: how well anybody's policy gets up, by several rules."""

from __future__ import annotations

import argparse
import json
import time

from getup_jax.evaluation import bench, bench_report
from getup_jax.runtime.console import Display


def bench_command(args: argparse.Namespace) -> int:
    """The command line of `getup-bench`; returns the exit code."""
    begin = time.monotonic()
    entry = bench.find_entry(args.policy)
    number = bench.check(entry, args.quick, args.engine)  # a mistake is said before anything is run
    with Display(number, unit="episodes") as display:
        result = bench.run_bench(entry, args.quick, args.engine, display)
    print(bench_report.table(result))
    print(f"{number} episodes in {time.monotonic() - begin:.0f} s")
    if args.json is not None:
        text = json.dumps(bench_report.to_json(result), indent=2)
        args.json.write_text(text + "\n", encoding="utf-8")
    return 0
