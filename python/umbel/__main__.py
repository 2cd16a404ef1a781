"""`python -m umbel` is the command `umbel`."""

from umbel.cli import main

if __name__ == "__main__":
    main()
