"""Runs every experiment, each into its own folder, and lists what they made.

    python experiments/run_all.py --quick
    python experiments/run_all.py --out out/experiments

Resumable: an experiment that has finished with the same options and the same source, of itself and of all that it can
import, is not run again (`--again` runs it). `--jobs` of them run at a time, sharing a cache of compiled programs.
Their output goes to log.txt in their folders; index.md lists folders, times and results. Exit code 1 if one failed.
"""

import argparse
import concurrent.futures
import functools
import hashlib
import importlib.util
import json
import os
import subprocess
import sys
import time
from pathlib import Path

from tqdm import tqdm

HERE = Path(__file__).parent
# the longest first, so that the last ones fill the gaps
EXPERIMENTS = (
    "convergence", "methods", "model_errors", "lights", "figure6", "figure5", "figure3", "figure2", "photographs",
    "occlusions", "figure4", "accuracy", "choosing",
    *(("crosscheck", "interreflection") if importlib.util.find_spec("mitsuba") else ()),
)  # fmt: skip


def key_of(name: str, quick: bool) -> str:
    """What a finished run is recognised by."""
    source = hashlib.sha256((HERE / f"{name}.py").read_bytes() + shared_source())
    return f"{'quick' if quick else 'full'} {source.hexdigest()[:16]}"


@functools.cache
def shared_source() -> bytes:
    """What every experiment may import: the package, the scenes, and the experiments' own helpers."""
    helpers = [path for path in HERE.glob("*.py") if path.stem not in (*EXPERIMENTS, "run_all")]
    packages = [HERE / "baselines", HERE / "baselines_specular", HERE.parent / "jaxsfs", HERE.parent / "data_synth"]
    files = helpers + [path for package in packages for path in package.rglob("*.py")]
    return b"".join(path.read_bytes() for path in sorted(files))


def finished(folder: Path, key: str) -> dict | None:
    """The record of an earlier run that need not be repeated."""
    path = folder / "run.json"
    if not path.is_file():
        return None
    record = json.loads(path.read_text(encoding="utf-8"))
    return record if record["key"] == key and record["exit"] == 0 else None


def run_one(name: str, folder: Path, quick: bool) -> dict:
    """Runs an experiment and leaves its record."""
    folder.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, str(HERE / f"{name}.py"), "--out", str(folder)] + ["--quick"] * quick
    cache = {"JAX_COMPILATION_CACHE_DIR": str(folder.parent / ".compiled"),
             "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.3"}  # fmt: skip
    clock = time.perf_counter()
    with (folder / "log.txt").open("w", encoding="utf-8") as log:
        process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env=cache | os.environ)
        exit_code, cpu = _waited(process)
    seconds = round(time.perf_counter() - clock, 1)
    record = {"key": key_of(name, quick), "exit": exit_code, "seconds": seconds, "cpu seconds": cpu}
    (folder / "run.json").write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
    return record


def _waited(process: subprocess.Popen) -> tuple[int, float | None]:
    """Exit code and, where the system tells, CPU seconds of a process."""
    if not hasattr(os, "wait4"):
        return process.wait(), None
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, round(usage.ru_utime + usage.ru_stime, 1)


def index(out: Path, records: dict[str, dict]) -> str:
    """Markdown list of the experiments and their files."""
    lines = ["| experiment | exit | seconds | CPU seconds | files |", "|---|---|---|---|---|"]
    for name in EXPERIMENTS:
        if name in records:
            made = sorted(p.name for p in (out / name).iterdir() if p.suffix in (".md", ".png", ".csv"))
            files = ", ".join(f"[{file}]({name}/{file})" for file in made)
            record = records[name]
            lines.append(f"| {name} | {record['exit']} | {record['seconds']} | {record['cpu seconds']} | {files} |")
    return "\n".join(lines) + "\n"


def run(out: Path, names: list[str], quick: bool, again: bool, jobs: int) -> dict[str, dict]:
    """Runs what is not finished; returns the records of all."""
    out = out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    records = {}
    for name in names:
        record = None if again else finished(out / name, key_of(name, quick))
        if record is not None:
            records[name] = record
    missing = [name for name in names if name not in records]
    with (
        concurrent.futures.ThreadPoolExecutor(jobs) as pool,
        tqdm(total=len(names), initial=len(records), file=sys.stderr, unit="experiment") as bar,
    ):
        running = {pool.submit(run_one, name, out / name, quick): name for name in missing}
        for future in concurrent.futures.as_completed(running):
            records[running[future]] = future.result()
            bar.set_postfix_str(running[future])
            bar.update()
            (out / "index.md").write_text(index(out, records), encoding="utf-8")
    (out / "index.md").write_text(index(out, records), encoding="utf-8")
    return records


def main() -> int:
    parser = argparse.ArgumentParser(description="Runs every experiment; resumable.")
    parser.add_argument("names", nargs="*", help=f"which (default all): {', '.join(EXPERIMENTS)}")
    parser.add_argument("--out", type=Path, default=Path("out/experiments"), help="folder of the results")
    parser.add_argument("--quick", action="store_true", help="small pictures, minutes in all")
    parser.add_argument("--again", action="store_true", help="run finished ones too")
    parser.add_argument("--jobs", type=int, default=2, help="how many at a time")
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in EXPERIMENTS]
    if unknown:
        parser.error(f"no experiment {unknown[0]!r}; choose from: {', '.join(EXPERIMENTS)}")
    names = options.names or list(EXPERIMENTS)
    records = run(options.out, names, options.quick, options.again, options.jobs)
    print(index(options.out.resolve(), records))
    failed = [name for name in names if records[name]["exit"]]
    for name in failed:
        print(f"{name} failed: see {options.out / name / 'log.txt'}", file=sys.stderr)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
