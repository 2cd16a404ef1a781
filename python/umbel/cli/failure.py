"""How a failure is worded: one sentence that names the file and the flags as users know them."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any


class Failure(Exception):
    """Ends a command with one sentence and an exit status."""

    def __init__(self, sentence: str, status: int, source: str | None = None) -> None:
        super().__init__(sentence)
        self.status = status
        #: the input at fault, where it is not the command's only one
        self.source = source


def one_line(text: str) -> str:
    """The text without line breaks."""
    return " ".join(text.split())


def with_flags(sentence: str, flags: Mapping[str, str], paths: Sequence[str] = ()) -> str:
    """A library's sentence with its arguments named as the flags that they come from. Names of
    several words are replaced anywhere but in paths, plain words only where they begin it."""
    kept = [re.escape(path) for path in paths if path]
    parts = re.split(f"({'|'.join(kept)})", sentence) if kept else [sentence]
    every = {**{f"{name}=True": flag for name, flag in flags.items()}, **flags}
    for name, flag in every.items():
        if re.search(r"\W|_", name):
            pattern = re.compile(rf"(?<![\w-]){re.escape(name)}(?!\w)")
            parts[::2] = [pattern.sub(flag, part) for part in parts[::2]]
        else:
            parts[0] = re.sub(rf"^{name}\b", flag, parts[0])
    return "".join(parts)


def naming_file(sentence: str, source: str | None, paths: Sequence[str]) -> str:
    """The sentence, which begins with the input unless it names one of the paths already."""
    if not source or any(path and path in sentence for path in paths):
        return sentence
    return f"{source}: {sentence}"


def failure_object(sentence: str, source: Any) -> str:
    """What `--json` prints of a failure."""
    from umbel.plain_json import plain

    return json.dumps({"error": plain(sentence), "input": plain(source)})


def input_of(arguments: Sequence[str], error: Any) -> str | None:
    """The input on a command line that could not be understood: the first word after the command
    that is neither a flag nor a flag's value."""
    context = getattr(error, "ctx", None)
    if hasattr(getattr(context, "command", None), "list_commands"):
        return None  # the command itself is missing or unknown
    options: dict[str, bool] = {}
    for parameter in getattr(getattr(context, "command", None), "params", []):
        for name in (*parameter.opts, *parameter.secondary_opts):
            options[name] = not getattr(parameter, "is_flag", False)
    depth = len(str(getattr(context, "command_path", "umbel")).split()) - 1
    words = iter(arguments)
    has_flags = True
    for word in words:
        if has_flags and word == "--":
            has_flags = False
        elif has_flags and word.startswith("-") and word != "-":
            if options.get(word, False):
                next(words, None)
        elif depth > 0:
            depth -= 1
        else:
            return word
    return None
