"""Help, version, and the examples that it shows: they run as pasted."""

import re
import shlex
import subprocess
import sys

import pytest
from cli_folders import SMALL

from jaxsfs.cli import main
from jaxsfs.cli._main import COMMANDS


class TestHelp:
    @pytest.mark.parametrize("words", [["--help"], ["-h"], ["help"]])
    def test_lists_the_commands(self, words, capsys):
        assert main(words) == 0
        text = capsys.readouterr().out
        assert all(f"  {name} " in text for name in COMMANDS)
        assert "exit codes: 0 good, 2 bad input, 3" in text

    def test_nothing_at_all_is_bad_input(self, capsys):
        assert main([]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert "usage: jaxsfs" in said.err

    def test_version(self, capsys):
        assert main(["--version"]) == 0
        assert re.fullmatch(r"jaxsfs \d+\.\d+\S*\n", capsys.readouterr().out)

    def test_a_misspelt_command(self, capsys):
        assert main(["reconstuct"]) == 2
        assert capsys.readouterr().err == (
            "jaxsfs: error: there is no command 'reconstuct'; did you mean 'reconstruct'? (jaxsfs --help)\n"
        )

    @pytest.mark.parametrize(
        "name",
        # their commands run in test_cli_calibrate.py too
        [
            pytest.param(n, marks=pytest.mark.slow if n.startswith("calibrate") else ())
            for n in COMMANDS
            if n not in ("video", "watch")  # they need a video; test_video.py and test_watch.py make one
        ],
    )
    def test_every_example_runs_as_pasted(self, name, capsys, tmp_path, monkeypatch):
        assert main([*name.split(), "--help"]) == 0
        lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
        pasted = [shlex.split(line)[1:] for line in lines if line.startswith("jaxsfs ")]
        assert pasted
        assert " ".join(pasted[-1]).startswith(name)
        monkeypatch.chdir(tmp_path)
        for words in pasted:
            # smaller than a user's, to save time
            assert main(words + (SMALL if words[0] == "render" else [])) == 0

    def test_the_examples_of_the_first_page_run_too(self, capsys, tmp_path, monkeypatch):
        main(["--help"])
        examples = capsys.readouterr().out.split("example:")[1].split("exit codes")[0].strip().splitlines()
        assert len(examples) == 3
        monkeypatch.chdir(tmp_path)
        for line in examples:
            words = shlex.split(line)[1:]
            assert main(words + (SMALL if words[0] == "render" else [])) == 0

    def test_needs_no_jax(self):
        """What makes the help fast."""
        code = "import sys, jaxsfs.cli as c; c.main(['--help']); c.main(['reconstruct', '--help'])"
        code += "; print('jax' in sys.modules, 'cv2' in sys.modules)"
        run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert run.stdout.endswith("False False\n")
