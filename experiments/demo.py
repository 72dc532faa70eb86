"""The whole path on one page: an endoscope view with known truth, its reconstruction, and how far the two differ.

    python experiments/demo.py --out out/demo

Each printed command does the same when it is pasted into a shell.
"""

import argparse
import json
import shlex
import sys
from pathlib import Path

from jaxsfs.cli import main

# A wall of folds about 20 units away that opens towards the rim, as mucosa seen by a scope that faces it.
SCENE = {"name": "demo", "kind": "wavy-wall", "parameters": {"range0": 20, "a": 0.08, "k": 9, "b": 1.3}}


def demo(out: Path) -> int:
    """Renders, reconstructs and evaluates into the folder `out`; the first exit code that is not 0, else 0."""
    view, result = out / "view", out / "result"
    out.mkdir(parents=True, exist_ok=True)
    (out / "scene.json").write_text(json.dumps(SCENE, indent=2) + "\n", encoding="utf-8")
    camera = ["--camera", str(view / "camera.json")]
    photograph = ["--half-field", "55", "--falloff", "cos:1", "--blur", "0.7", "--read-noise", "0.002", "--seed", "1"]
    steps = [
        ("an 8-bit photograph with fall-off, blur and noise, and the exact surface behind it",
         ["render", str(out / "scene.json"), *photograph, "--force", "--out", str(view)]),
        ("the surface, from the photograph and the camera file alone",
         ["reconstruct", str(view / "image.png"), *camera, "--smooth", "1", "--force", "--out", str(result)]),
        ("the errors; lengths are compared as they are, nothing is fitted",
         ["evaluate", str(result), str(view), *camera, "--align", "none"]),
    ]  # fmt: skip
    for purpose, words in steps:
        print(f"# {purpose}\n$ {shlex.join(['jaxsfs', *words])}", flush=True)
        code = main(words)
        if code != 0:
            return code
        print(flush=True)
    print(f"To look at: {view / 'image.png'}, {result / 'depth.png'}, {result / 'shaded.png'}, {result / 'mesh.ply'}")
    return 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Renders an endoscope view, reconstructs it, evaluates it.")
    parser.add_argument("--out", type=Path, default=Path("out/demo"), help="folder for everything (default: out/demo)")
    sys.exit(demo(parser.parse_args().out))
