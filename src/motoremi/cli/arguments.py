"""Options that take several files: `--short a.csv b.csv` means `--short a.csv --short b.csv`."""

from __future__ import annotations

from collections.abc import Sequence

SEVERAL = ("--short", "--open", "--spectrum")
_ONE_VALUE = (
    *("--analyser", "--motor", "--serial", "--operator", "--ambient", "--fixture", "--band", "--accuracy", "--corrections", "--limit"),
    *("--condition", "--value"),
)


def expanded(arguments: Sequence[str]) -> list[str]:
    """Arguments of `motoremi import` with the option repeated before each file; other commands are not changed."""
    if not arguments or arguments[0] != "import":
        return list(arguments)
    result: list[str] = [arguments[0]]
    positional: list[str] = []
    option = ""
    taken = 0
    for word in arguments[1:]:
        if word in SEVERAL:
            option, taken = word, 0
        elif word.startswith("-") and word != "-":
            result.append(word)
            option = "value" if word in _ONE_VALUE else ""
        elif option in SEVERAL:
            result += [option, word]
            taken += 1
        elif option == "value":
            result.append(word)
            option = ""
        else:
            positional.append(word)
    if not positional and taken > 1:
        # `import --short a.csv --open b.csv OUT`: the last word is the folder.
        positional.append(result.pop())
        result.pop()
    if option in SEVERAL and not taken:
        result.append(option)  # an option without a file, for which the parser raises an error
    return [result[0], *positional, *result[1:]]
