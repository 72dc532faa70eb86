"""How every command behaves: quiet, fast help, data alone on stdout, completion, and the doctor."""

import json
import os
import resource
import subprocess
import sys

import pytest

from jaxsfs.cli import main
from jaxsfs.cli._main import COMMANDS
from jaxsfs.cli._terminal import quiet


@pytest.fixture(autouse=True)
def not_quiet():
    token = quiet.set(False)
    yield
    quiet.reset(token)


TARGET = ["target", "grid", "--pitch", "5", "--out"]


class TestQuiet:
    def test_no_summary(self, tmp_path, capsys):
        assert main([*TARGET, str(tmp_path / "a.pdf")]) == 0
        assert "print it at 100 %" in capsys.readouterr().out
        assert main([*TARGET, str(tmp_path / "b.pdf"), "--quiet"]) == 0
        assert capsys.readouterr() == ("", "")
        assert (tmp_path / "b.pdf").stat().st_size > 500

    def test_data_is_still_printed(self, tmp_path, capsys):
        assert main([*TARGET, str(tmp_path / "a.pdf"), "--quiet", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["paper"] == "A4"

    def test_errors_are_still_printed(self, tmp_path, capsys):
        assert main(["target", "--quiet", "grid"]) == 2
        assert main(["rectify", "no.png", "--camera", "no.json", "--out", "o.png", "--quiet"]) == 2
        assert "there is no file no.json" in capsys.readouterr().err

    def test_no_progress(self, tmp_path, monkeypatch, capsys):
        from jaxsfs.cli._terminal import progress

        monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
        progress("solving")
        quiet.set(True)
        progress("writing")
        assert capsys.readouterr().err == "jaxsfs: solving …\n"


def test_the_help_is_there_in_no_time():
    """Processor time of the whole process: what waits for a disk or another program is not the command's doing."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = subprocess.run([sys.executable, "-m", "jaxsfs.cli", "--help"], capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 0.6
    assert "--quiet" in run.stdout


class TestCompletion:
    def complete(self, *words: str) -> set[str]:
        """What bash would offer for the last word."""
        script = (
            'source <("$0" -m jaxsfs.cli completion bash); COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _jaxsfs; '
            'printf "%s\\n" "${COMPREPLY[@]}"'
        )
        words = ("bash", "-c", script, sys.executable, "jaxsfs", *words)
        return set(subprocess.run(words, capture_output=True, text=True, check=True).stdout.split())

    def test_of_commands_options_and_choices(self):
        assert self.complete("re") == {"reconstruct", "render", "rectify"}
        assert self.complete("calibrate", "") == {"circles", "grid", "checkerboard", "dots", "white"}
        assert self.complete("reconstruct", "--sol") == {"--solver"}
        assert self.complete("reconstruct", "--solver", "") == {"sweeping", "level-set"}

    def test_of_files(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "photo.png").touch()
        assert self.complete("reconstruct", "pho") == {"photo.png"}

    def test_for_fish_has_every_command(self, capsys):
        assert main(["completion", "fish"]) == 0
        said = capsys.readouterr().out
        assert all(f" -a {name.split()[-1]} " in said for name in COMMANDS)
        assert "-l solver -x -a 'sweeping level-set'" in said

    def test_needs_no_jax(self):
        code = "import sys, jaxsfs.cli as c; c.main(['completion', 'zsh']); print('jax' in sys.modules)"
        run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert run.stdout.endswith("False\n")


class TestDoctor:
    def test_of_a_sound_machine(self, capsys):
        assert main(["doctor", "--json"]) == 0
        said = json.loads(capsys.readouterr().out)
        assert said["self_test"]["good"] is True
        assert said["self_test"]["mean_error"] < 1e-3
        assert said["devices"]["devices"]
        assert said["devices"]["cores"] == os.cpu_count()
        assert {"jax", "python", "jaxsfs"} <= said["versions"].keys()
        assert said["extras"].keys() == {"fast", "dicom", "exr", "cluster"}

    def test_of_a_machine_that_computes_wrong(self, monkeypatch, capsys):
        import equinox as eqx

        from jaxsfs import reconstruction

        sound = reconstruction.reconstruct
        broken = lambda *given: eqx.tree_at(lambda r: r.surface.range, sound(*given), replace_fn=lambda r: 1.1 * r)  # noqa: E731
        monkeypatch.setattr(reconstruction, "reconstruct", broken)
        assert main(["doctor"]) == 3
        assert "self-test               WRONG: mean error of range 0.1," in capsys.readouterr().out

    def test_of_an_incomplete_installation(self, monkeypatch, capsys):
        from importlib.metadata import PackageNotFoundError

        def missing():
            raise PackageNotFoundError("jaxlib")

        monkeypatch.setattr("jaxsfs.cli._doctor.versions", missing)
        assert main(["doctor"]) == 2
        assert "jaxsfs cannot run here" in capsys.readouterr().err
