"""`jaxsfs completion`: what a shell needs to complete commands and options."""

import dataclasses
import importlib
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from tyro.conf import Positional

from jaxsfs.cli._options import FLAT, value

_POSITIONAL = get_args(Positional[Path])[1]
_BASH = """# jaxsfs: Tab completes commands, options and their choices. bash: source this file; zsh: so too, after
# `autoload -U bashcompinit && bashcompinit`
_jaxsfs() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} words=""
  case "${{COMP_WORDS[1]}} ${{COMP_WORDS[2]}}" in
{groups}
  esac
  if [ "$COMP_CWORD" -eq 1 ]; then words="{first}"; fi
  COMPREPLY=($(compgen -W "$words" -- "$word"))
  if [ -z "$words" ] || {{ [ "${{word#-}}" = "$word" ] && [ ${{#COMPREPLY[@]}} -eq 0 ]; }}; then
    COMPREPLY=($(compgen -f -- "$word"))
  fi
}}
complete -o filenames -F _jaxsfs jaxsfs
"""


@dataclasses.dataclass(frozen=True)
class CompletionOptions:
    # The shell that is to complete.
    shell: Annotated[Positional[Literal["bash", "zsh", "fish"]], value("SHELL")]


def completion(options: Annotated[CompletionOptions, FLAT]) -> int:
    """Prints the script with which a shell completes jaxsfs's commands, options and choices after the Tab key.

    For example:
      jaxsfs completion bash

    bash and zsh: put source <(jaxsfs completion bash) into ~/.bashrc, in ~/.zshrc after autoload -U bashcompinit &&
    bashcompinit. fish: jaxsfs completion fish > ~/.config/fish/completions/jaxsfs.fish
    """
    print(_fish() if options.shell == "fish" else _bash(), end="")
    return 0


def _options() -> dict[str, dict[str, list[str]]]:
    """command → option → choices, where it has any."""
    from jaxsfs.cli._main import COMMANDS

    found = {}
    for name, (module, function, _) in COMMANDS.items():
        hints = get_type_hints(getattr(importlib.import_module(module), function), include_extras=True)
        declared, *_ = get_args(hints["options"])
        found[name] = {"--help": [], **_declared(declared)}
    return found


def _declared(options: type) -> dict[str, list[str]]:
    """The options that a dataclass declares, as tyro names them."""
    found = {}
    hints = get_type_hints(options, include_extras=True)
    for field in dataclasses.fields(options):
        kind, *notes = (
            get_args(hints[field.name]) if get_origin(hints[field.name]) is Annotated else [hints[field.name]]
        )
        if isinstance(kind, type) and dataclasses.is_dataclass(kind):
            found |= _declared(kind)
        elif not any(note is _POSITIONAL for note in notes):
            own = next((note.name for note in notes if getattr(note, "name", None)), None)
            name = (own or field.name).replace("_", "-")
            found["--no-" + name if field.default is True else "--" + name] = _choices(kind)
    return found


def _choices(kind: Any) -> list[str]:
    """The words of a Literal, alone or beside None."""
    if get_origin(kind) is Literal:
        return [str(word) for word in get_args(kind)]
    return [word for part in get_args(kind) for word in _choices(part)]


def _bash() -> str:
    cases = []
    options = _options()
    for name, own in options.items():
        pattern = f'"{name}"' if " " in name else f'"{name} "*'
        inner = [f'{option}) words="{" ".join(choices)}" ;;' for option, choices in own.items() if choices]
        inner.append(f'*) words="{" ".join([*own, "--quiet"])}" ;;')
        cases.append(f'    {pattern}) case "$before" in {" ".join(inner)} esac ;;')
    for group in sorted({name.split()[0] for name in options if " " in name}):
        kinds = " ".join(name.split()[1] for name in options if name.startswith(f"{group} "))
        cases.append(f'    "{group} "*) words="{kinds}" ;;')
    return _BASH.format(groups="\n".join(cases), first=" ".join(dict.fromkeys(name.split()[0] for name in options)))


def _fish() -> str:
    from jaxsfs.cli._main import COMMANDS

    lines = ["# jaxsfs: Tab completes commands, options and their choices"]
    for name, own in _options().items():
        *group, last = name.split()
        unseen = "__fish_use_subcommand" if not group else f"__fish_seen_subcommand_from {group[0]}"
        lines.append(f"complete -c jaxsfs -n '{unseen}' -a {last} -d {_quoted(COMMANDS[name][2])}")
        for option, choices in own.items():
            chosen = f" -x -a {_quoted(' '.join(choices))}" if choices else ""
            lines.append(f"complete -c jaxsfs -n '__fish_seen_subcommand_from {last}' -l {option[2:]}{chosen}")
    for group in sorted({name.split()[0] for name in COMMANDS if " " in name}):
        lines.append(f"complete -c jaxsfs -n __fish_use_subcommand -a {group}")
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "\\'") + "'"
