"""The README's Python example runs as it stands, and its figures are those that its command prints."""

import re
from pathlib import Path

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def test_python_example_runs(capsys):
    (example,) = re.findall(r"```python\n(.*?)```", README, flags=re.S)
    # the tests run with strict promotion and 64 bit; the example is what a user types
    exec(compile(example, "README.md", "exec"), {})
    assert "explains the image" in capsys.readouterr().out


def test_commands_name_existing_ones():
    from jaxsfs.cli import main

    commands = set(re.findall(r"^jaxsfs ([a-z]+)", README, flags=re.M))
    assert {"reconstruct", "render", "evaluate", "rectify"} <= commands
    for command in commands:
        assert main([command, "--help"]) == 0
