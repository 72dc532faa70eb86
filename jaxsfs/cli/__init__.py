"""The command line: `jaxsfs COMMAND …`. With `jaxsfs.files` the only code that touches files, arguments, the terminal.

Nothing here imports JAX or a command's module before that command runs: `--help` stays fast.
"""

from jaxsfs.cli._main import main as main
