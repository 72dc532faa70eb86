"""Which command runs, and what becomes of its errors."""

import atexit
import difflib
import gc
import importlib
import os
import shlex
import sys
import time
from collections.abc import Sequence

from jaxsfs.cli._interruption import interruptible
from jaxsfs.cli._terminal import CannotRun, command_line, quiet, started

# name → module, function, one line for `jaxsfs --help`
COMMANDS: dict[str, tuple[str, str, str]] = {
    "reconstruct": ("jaxsfs.cli._reconstruct", "reconstruct", "a surface from one photograph"),
    "video": ("jaxsfs.cli._video", "video", "the surfaces of all frames of a video or a folder"),
    "watch": ("jaxsfs.cli._watch", "watch", "depth over a live picture, a video or a folder"),
    "render": ("jaxsfs.cli._render", "render", "a synthetic endoscope view with its exact range and normals"),
    "evaluate": ("jaxsfs.cli._evaluate", "evaluate", "errors of a range or depth map against the truth"),
    "measure": ("jaxsfs.cli._measure", "measure", "lengths and areas on a reconstructed surface"),
    "photograph": ("jaxsfs.cli._photograph", "photograph", "a synthetic photograph of a calibration target"),
    "calibrate circles": ("jaxsfs.cli._calibrate", "circles", "a camera from photographs of printed circles"),
    "calibrate grid": ("jaxsfs.cli._calibrate", "grid", "a camera from straight lines, sizes unknown"),
    "calibrate checkerboard": ("jaxsfs.cli._calibrate", "checkerboard", "a camera from a checkerboard"),
    "calibrate dots": ("jaxsfs.cli._calibrate", "dots", "a camera from a grid of dots"),
    "calibrate white": ("jaxsfs.cli._calibrate_white", "white", "response, fall-off and gain from white paper"),
    "specular": ("jaxsfs.cli._specular", "specular", "a photograph without its highlights"),
    "rectify": ("jaxsfs.cli._rectify", "rectify", "a wide-angle photograph as a perspective one"),
    "convert": ("jaxsfs.cli._convert", "convert", "camera files of other programs, both ways"),
    "target circles": ("jaxsfs.cli._target", "circles", "a printable page of concentric circles"),
    "target grid": ("jaxsfs.cli._target", "grid", "a printable page of lines"),
    "target checkerboard": ("jaxsfs.cli._target", "checkerboard", "a printable checkerboard"),
    "target dots": ("jaxsfs.cli._target", "dots", "a printable page of dots"),
    "doctor": ("jaxsfs.cli._doctor", "doctor", "versions, devices, cache, and one self-test"),
    "completion": ("jaxsfs.cli._completion", "completion", "lets a shell complete commands and options"),
}

_USAGE = """usage: jaxsfs COMMAND [OPTIONS]

Near-light shape from shading: a 3-D surface from one endoscope image.

commands:
{commands}

  jaxsfs COMMAND --help     the options of a command, with an example
  jaxsfs COMMAND --quiet    no progress and no summary; errors, warnings and data (--json) are still printed
  jaxsfs --version

example:
  jaxsfs render wavy-wall --out view
  jaxsfs reconstruct view/image.png --camera view/camera.json --out result
  jaxsfs evaluate result view --align none

exit codes: 0 good, 2 bad input, 3 the result is not to be trusted (it is written and says why), 130 interrupted
"""

# Compilers leave millions of small objects: looked through for rings of garbage as often as Python does by default, and
# once more when the process ends, they take a tenth of a short command's time.
_YOUNG = 50_000  # objects between looks (Python: 700)
atexit.register(gc.freeze)

_BAD_INPUT = 2
_QUIET = "--quiet"
_INTERRUPTED = 130  # 128 + SIGINT, as shells count


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command and returns the exit code: 0 good, 2 bad input, 3 result not trustworthy, 130 interrupted.

    `argv`: the words after `jaxsfs`, by default the process's. Data goes to stdout, progress and errors to stderr.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    try:
        with interruptible():
            code = _run(words)
        sys.stdout.flush()  # so that a broken pipe shows here
        return code
    except KeyboardInterrupt:
        print("jaxsfs: interrupted; nothing was written", file=sys.stderr)
        return _INTERRUPTED
    except BrokenPipeError:  # `jaxsfs … --json | head`: whoever read has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except ValueError as error:  # files.InputError is one
        if os.environ.get("JAXSFS_TRACEBACK"):
            raise
        print(f"jaxsfs: error: {_one_line(error)}", file=sys.stderr)
        return _BAD_INPUT


def _run(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help", "help"):
        print(_usage(), file=sys.stdout if words else sys.stderr)
        return 0 if words else _BAD_INPUT
    if words[0] == "--version":
        from importlib.metadata import version

        print(f"jaxsfs {version('jaxsfs')}")
        return 0
    started.set(time.perf_counter())
    gc.set_threshold(_YOUNG)
    name, words = _command(words)
    if name not in COMMANDS:
        return _group_usage(name)
    import tyro

    module, function, _ = COMMANDS[name]
    command_line.set(shlex.join(["jaxsfs", *name.split(), *words]))
    quiet.set(_QUIET in words)
    words = [word for word in words if word != _QUIET]
    command = getattr(importlib.import_module(module), function)
    try:
        outcome = tyro.cli(
            command,
            prog=f"jaxsfs {name}",
            args=words,
            config=(tyro.conf.FlagCreatePairsOff,),
            use_underscores=False,
        )
    except SystemExit as stop:  # tyro has printed help (0) or what is wrong with the words (2)
        return stop.code if isinstance(stop.code, int) else _BAD_INPUT
    return outcome if isinstance(outcome, int) else 0


def _command(words: list[str]) -> tuple[str, list[str]]:
    """The command's name and the words after it. Some names have two words: `calibrate circles`; the first word alone,
    or before --help, stands for the group."""
    group = [name for name in COMMANDS if name.split()[0] == words[0] and " " in name]
    name = " ".join(words[: 2 if group else 1])
    if name in COMMANDS:
        return name, words[len(name.split()) :]
    if group and (len(words) == 1 or words[1] in ("-h", "--help")):
        return words[0], words[1:]
    near = difflib.get_close_matches(name, COMMANDS, 1)
    hint = f"did you mean {near[0]!r}?" if near else f"commands: {', '.join(group or COMMANDS)}"
    raise CannotRun(f"there is no command {name!r}; {hint} (jaxsfs --help)")


def _group_usage(group: str) -> int:
    print(f"usage: jaxsfs {group} KIND [OPTIONS]\n\nkinds:\n{_listed(group + ' ')}\n")
    print(f"  jaxsfs {group} KIND --help     the options of a kind, with an example")
    return 0


def _usage() -> str:
    return _USAGE.format(commands=_listed(""))


def _listed(prefix: str) -> str:
    """The commands whose names begin with `prefix`, a line each."""
    width = max(map(len, COMMANDS))
    chosen = {name: line for name, (_, _, line) in COMMANDS.items() if name.startswith(prefix)}
    return "\n".join(f"  {name:<{width}}  {line}" for name, line in chosen.items())


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())
