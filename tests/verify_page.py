"""Write the tables of the manual's page on verification: ``python tests/verify_page.py`` (some minutes)."""

import sys

from hfsim.output.manual import FOLDER
from hfsim.output.verify import as_markdown
from hfsim.scene.loading import load_deck
from hfsim.studies.verify import entry_of, published_decks, verify

PAGE = FOLDER / "verify.md"
MARK = "\n## What is found\n"
"""Heading from which on the page is written by this script."""


def main() -> None:
    """Run everything and write the page."""
    result = verify([entry_of(load_deck(path)) for path in published_decks().values()], 2)
    head = PAGE.read_text(encoding="utf-8").partition(MARK)[0]
    PAGE.write_text(f"{head.rstrip()}\n{MARK}\n{as_markdown(result)}\n", encoding="utf-8")
    sys.exit(result.exit_code)


if __name__ == "__main__":
    main()
