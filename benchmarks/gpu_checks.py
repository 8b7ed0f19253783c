"""What only a GPU can show, in at most ten minutes: one JSON line a check, and a summary.

    python benchmarks/gpu_checks.py [--policy flat] [--out FOLDER] [--minutes 9.5] [--quick]

  compile      a training iteration of 4,096 simulations on mjx-warp: seconds to compile
  speed        its control steps/s with T = 32
  engines      success of a shipped policy on native, mjx-warp and mjx, as getup-eval --json files
               that `getup-export POLICY OUT --eval FILE --eval FILE` puts side by side
  two          two processes that share the GPU: samples/s, or why they cannot
  moves        a checkpoint from the GPU goes on on the CPU

Each check is a process of its own with a time of its own, so that one that fails or hangs costs no
other. Those that no time is left for are skipped, and say so.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from support.command import command, duration

HERE = Path(__file__).parent
SIZES = ["ppo.num_envs=4096", "ppo.num_steps=32", "ppo.minibatch_size=2048"]
ITERATION = 4096 * 32
TRAIN = "import sys; from getup_jax.cli.main import train_main; sys.exit(train_main())"
EVALUATE = "import sys; from getup_jax.cli.main import eval_main; sys.exit(eval_main())"
SHORT_S = 45  # an evaluation or a resume that has compiled before


@dataclasses.dataclass(frozen=True)
class Check:
    """A command, and how long it may take."""

    name: str
    words: list[str]
    seconds: float
    variables: dict[str, str] = dataclasses.field(default_factory=dict)


def main() -> None:
    args = parse_args()
    if shutil.which("nvidia-smi") is None:
        print("skipped: no NVIDIA GPU here")
        return
    args.out.mkdir(parents=True, exist_ok=True)
    deadline = time.monotonic() + 60 * args.minutes
    found: dict[str, Any] = {}
    for check in checks(args)[: 1 if args.quick else None]:
        left = deadline - time.monotonic()
        found[check.name] = run(check, args.out, min(check.seconds, left))
        print(json.dumps({check.name: found[check.name]}), flush=True)
    left = 0.0 if args.quick else deadline - time.monotonic()
    found["two"] = two_processes(args.out, min(120.0, left))
    print(json.dumps({"two": found["two"]}), flush=True)
    for name in ("train", "two"):
        found[f"{name} steps/s"] = rate(args.out / name)
    (args.out / "summary.json").write_text(json.dumps(found, indent=2) + "\n")
    print(json.dumps(found, indent=2))


def checks(args: argparse.Namespace) -> list[Check]:
    """In the order of what matters most; training compiles what later checks find in the cache."""
    run_folder = str(args.out / "train")
    train = [sys.executable, "-c", TRAIN, "flat", "--run", run_folder, *SIZES]
    on_cpu = [sys.executable, "-c", TRAIN, "flat", "--run", str(args.out / "cpu"), *SIZES]
    on_cpu += [f"train.init_from={run_folder}", "train.init_learner=true"]
    on_cpu += [f"train.total_steps={2 * ITERATION}"]

    def evaluate(engine: str, episodes: int) -> list[str]:
        file = str(args.out / f"{engine}.json")
        words = ["--ckpt", args.policy, "--engine", engine, "--episodes", str(episodes)]
        return [sys.executable, "-c", EVALUATE, *words, "--json", file]

    return [
        Check("compile and speed", [*train, f"train.total_steps={10 * ITERATION}"], 240.0),
        Check("success on mjx-warp", evaluate("mjx-warp", 1000), 150.0),
        Check("success on native", evaluate("native", 1000), 90.0, {"JAX_PLATFORMS": "cpu"}),
        Check("goes on on a CPU", on_cpu, 150.0, {"JAX_PLATFORMS": "cpu"}),
        Check("success on mjx", evaluate("mjx", 200), 120.0),
    ]


def run(check: Check, out: Path, seconds: float) -> dict[str, Any]:
    """Exit code, seconds and the last lines; the whole output is in a file."""
    if seconds < SHORT_S:
        return {"skipped": f"{max(seconds, 0.0):.0f} s are left"}
    begin, log = time.monotonic(), out / f"{check.name.replace(' ', '_')}.log"
    with log.open("w") as output:
        try:
            variables = {**environment(out), **check.variables}
            done = subprocess.run(
                check.words, stdout=output, stderr=output, timeout=seconds, env=variables
            )
            code: int | str = done.returncode
        except subprocess.TimeoutExpired:
            code = f"ended after {seconds:.0f} s"
    lines = [line for line in log.read_text().splitlines() if line.strip()]
    compiled = [line for line in lines if line.startswith("compiled in")]
    return {
        "code": code,
        "seconds": round(time.monotonic() - begin, 1),
        "last": (compiled + lines[-2:])[:3],
    }


def two_processes(out: Path, seconds: float) -> dict[str, Any]:
    """A run of two processes on the same GPU; NCCL may refuse, which is an answer, too."""
    if seconds < SHORT_S:
        return {"skipped": f"{max(seconds, 0.0):.0f} s are left"}
    words = [sys.executable, "-c", TRAIN, "flat", "--run", str(out / "two"), *SIZES]
    words += [f"train.total_steps={6 * ITERATION}", "--coordinator", "127.0.0.1:47111"]
    words += ["--processes", "2", "--wait", "60", "--process"]
    share = {"XLA_PYTHON_CLIENT_MEM_FRACTION": "0.4", "NCCL_MULTI_RANK_GPU_ENABLE": "1"}
    logs = [out / f"two_{index}.log" for index in range(2)]
    started = []
    for index, log in enumerate(logs):
        output, variables = log.open("w"), {**environment(out), **share}
        command_words = [*words, str(index)]
        started.append(subprocess.Popen(command_words, stdout=output, stderr=output, env=variables))
    deadline = time.monotonic() + seconds
    codes: list[int | str] = []
    for process in started:
        try:
            codes.append(process.wait(max(deadline - time.monotonic(), 0.1)))
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            codes.append(f"ended after {seconds:.0f} s")
    return {"codes": codes, "last": [log.read_text().splitlines()[-2:] for log in logs]}


def environment(out: Path) -> dict[str, str]:
    """The variables of a check: what one compiles the next one finds."""
    cache = {"JAX_COMPILATION_CACHE_DIR": str(out / "compiled")}
    return {**os.environ, **cache}


def rate(folder: Path) -> float | None:
    """Control steps/s of a run's second half; None: it came to no iteration."""
    file = folder / "times.jsonl"
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.is_file() else []
    later = [row["steps_per_s"] for row in rows[len(rows) // 2 :]]
    return sum(later) / len(later) if later else None


def parse_args() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--policy", default="flat", help="a shipped policy, or a run (default: flat)")
    add("--out", type=Path, default=Path("runs/gpu_checks"), metavar="FOLDER")
    add("--minutes", type=duration, default=9.5, metavar="M", help="for all (default: 9.5)")
    add("--quick", action="store_true", help="the first check alone")
    return parser.parse_args()


if __name__ == "__main__":
    command(main)
