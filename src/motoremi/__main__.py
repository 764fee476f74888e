"""`python -m motoremi`: the command, for environments whose scripts are not on the path."""

from motoremi.cli import main

main()
