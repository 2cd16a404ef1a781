"""`python -m umbel` is the command `umbel`."""

from .cli import main

main()
