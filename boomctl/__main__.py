"""The command line as ``python -m boomctl``."""

from boomctl.cli import main

if __name__ == "__main__":
    main()
