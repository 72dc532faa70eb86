"""How fast `jaxsfs video` is, on how many workers, in how much memory, and how still a locked scale stands.

    python experiments/video.py --out out/video
    python experiments/video.py --long 2000          # memory over many frames; takes minutes
    python experiments/video.py --quick

A scope moves forwards and back in the folded colon of `data_synth`: an MP4 with highlights, noise and clipping, whose
exact surfaces are known. Each row is one run of the command, start-up included: frames a second by the clock and per
CPU second, the rate between the first batch stored and the last (what a long video runs at), and the largest memory of
a process. Threads in one process, one and two processes of a Dask cluster; each twice, in turn, the better one counts,
because other programs slow a run down and nothing speeds it up. Below: mean relative error of range, nothing scaled,
and the standard deviation over the frames of their median range over the true one. Prints a Markdown table and writes
it with the command that made it.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import zarr
from tables import write_tables

from data_synth import FoldedColon, render_scene
from jaxsfs import files

COLUMNS = ("run", "frames", "s", "frames/s", "CPU s", "frames/CPU s", "frames/s, steady", "MiB", "growth MiB")


def film(folder: Path, size: int, views: int, frames: int) -> np.ndarray:
    """Writes video.mp4 and camera.json; the exact ranges of the views."""
    ranges, shown, camera = [], [], None
    for k in range(views):
        share = k / views
        scene = FoldedColon(first=1.3 + 0.4 * share, x0=0.15 - 0.1 * share)
        noise = {"read_noise": 0.002, "shot_noise": 2e-5, "seed": k}
        view = render_scene(scene, camera=camera, width=size, height=size, shine=0.2, **noise)
        if camera is None:
            files.write_camera(folder / "camera.json", view.camera_file, force=True)
        camera = view.camera_file.camera
        ranges.append(view.range)
        shown.append(np.ascontiguousarray(view.photo.stored[..., ::-1]))
    video = cv2.VideoWriter(str(folder / "video.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 25, (size, size))
    for index in range(frames):
        video.write(shown[place(index, views)])
    video.release()
    return np.stack(ranges)


def place(index: int, views: int) -> int:
    """Forwards and back."""
    period = max(1, 2 * views - 2)
    return min(index % period, period - index % period)


def measured(folder: Path, name: str, words: list[str], frames: int) -> dict[str, object]:
    """One run of the command."""
    store = folder / "result.zarr"
    line = [sys.executable, "-m", "jaxsfs.cli", "video", str(folder / "video.mp4"), "--frames", f":{frames}", "--quiet"]
    line += ["--camera", str(folder / "camera.json"), "--out", str(store), "--force", *words]
    start = time.perf_counter()
    process = subprocess.Popen(line)
    sizes: list[int] = []
    while (done := os.wait4(process.pid, os.WNOHANG))[0] == 0:
        sizes.append(resident(process.pid))
        time.sleep(0.2)
    seconds, usage = time.perf_counter() - start, done[2]
    process.returncode = os.waitstatus_to_exitcode(done[1])
    if process.returncode not in (0, 3):
        raise SystemExit(f"{name}: jaxsfs video ended with {process.returncode}")
    cpu = usage.ru_utime + usage.ru_stime
    times = sorted(path.stat().st_mtime for path in (store / "status" / "c").iterdir())
    batch = json.loads((store / "status" / "zarr.json").read_text())["chunk_grid"]["configuration"]["chunk_shape"][0]
    steady = batch * (len(times) - 1) / (times[-1] - times[0]) if len(times) > 3 else float("nan")
    half, end = (np.median(part) if len(part) else 0 for part in (sizes[len(sizes) // 2 :][:9], sizes[-12:-3]))
    figures = (f"{seconds:.1f}", f"{frames / seconds:.2f}", f"{cpu:.1f}", f"{frames / cpu:.2f}", f"{steady:.2f}")
    growth = f"{(end - half) / 1024:.0f}"  # from the middle of the run to its end
    return dict(zip(COLUMNS, (name, frames, *figures, usage.ru_maxrss // 1024, growth), strict=True))


def resident(pid: int) -> int:
    """KiB in memory; 0 where the system does not tell."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) for line in lines if line.startswith("VmRSS")), 0)


def accuracy(store: Path, truth: np.ndarray) -> str:
    """Against the exact surfaces."""
    ranges = zarr.open_group(str(store), mode="r")["range"]
    errors, levels = [], []
    for index in range(min(ranges.shape[0], 2 * len(truth))):
        ratio = np.asarray(ranges[index]) / truth[place(index, len(truth))]
        errors.append(float(np.nanmean(np.abs(ratio - 1))))
        levels.append(float(np.nanmedian(ratio)))
    return (
        f"Mean relative error of range {np.mean(errors):.4f}, nothing scaled; the frames' median range over the true "
        f"one is {np.mean(levels):.4f} with a standard deviation of {np.std(levels):.5f} over {len(levels)} frames."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/video"))
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--long", type=int, default=0, help="one run of so many frames by threads alone")
    parser.add_argument("--quick", action="store_true", help="96 px, 24 frames, one run each")
    options = parser.parse_args()
    size, frames, views = (96, 24, 3) if options.quick else (options.size, options.long or options.frames, 16)
    options.out.mkdir(parents=True, exist_ok=True)
    truth = film(options.out, size, views, frames)
    runs = {"threads": []} if options.long else {"threads": [], "1 worker": ["--processes", "1"]}
    runs |= {} if options.long else {"2 workers": ["--processes", "2"]}
    batch = ["--batch", "4"] if options.quick else []
    measured(options.out, "warm-up", batch, min(frames, 16))  # compiled programs are kept from then on
    found: dict[str, dict[str, object]] = {}
    for _ in range(1 if options.quick or options.long else 2):
        for name, more in runs.items():
            row = measured(options.out, name, batch + more, frames)
            print(row, file=sys.stderr)
            if name not in found or float(str(row["s"])) < float(str(found[name]["s"])):
                found[name] = row
    rows = list(found.values())
    words = accuracy(options.out / "result.zarr", truth)
    if "2 workers" in found:
        one, two = (float(str(found[name]["frames/s, steady"])) for name in ("1 worker", "2 workers"))
        words += f"\nTwo workers: {two / one:.2f} times one, at the steady rate."
    print(write_tables(options.out, "video", {f"{size} x {size} px": rows}, words))


if __name__ == "__main__":
    main()
