"""`hfsim` and `python -m hfsim` are the command line."""

import sys


def main() -> None:
    """Call the command line; an interruption while it is imported leaves no traceback either."""
    try:
        from hfsim.cli import main as command_line

        command_line()
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(130)


if __name__ == "__main__":
    main()
