"""`python -m hfsim` is the command line."""

from hfsim.cli import main

main()
