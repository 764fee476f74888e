"""Options of `motoremi import` that take several files: `--short a.csv b.csv` means `--short a.csv --short b.csv`."""

from __future__ import annotations

from collections.abc import Sequence

# Options of `motoremi import` that take one or more files, and those that take one value; all others take none.
SEVERAL_FILES = ("--short", "--open", "--spectrum")
ONE_VALUE = (
    *("--analyser", "--motor", "--serial", "--operator", "--ambient", "--fixture", "--band", "--accuracy", "--corrections", "--limit"),
    *("--condition", "--value", "--unit"),
)


def expanded(arguments: Sequence[str]) -> list[str]:
    """Arguments of `motoremi import` as the parser needs them: the folder first, and the option repeated before each file.

    The folder may be the last word, behind the files of an option, since such an option takes at least one file. Arguments of other commands are
    not changed.
    """
    if not arguments or arguments[0] != "import":
        return list(arguments)
    folders: list[str] = []
    options: list[str] = []
    # The option that the next words are files of, and how many it has so far; whether the next word is the value of another option.
    files_of, files = "", 0
    value_follows = False
    for word in arguments[1:]:
        if word in SEVERAL_FILES:
            files_of, files = word, 0
        elif word.startswith("-") and word != "-":
            options.append(word)
            files_of, value_follows = "", word in ONE_VALUE
        elif files_of:
            options += [files_of, word]
            files += 1
        elif value_follows:
            options.append(word)
            value_follows = False
        else:
            folders.append(word)
    if files_of and files > 1 and not folders:
        # `import --short a.csv --open b.csv OUT`: the last file is the folder.
        *options, _, folder = options
        folders.append(folder)
    if files_of and not files:
        options.append(files_of)  # an option without a file, for which the parser raises an error
    return ["import", *folders, *options]
