"""Published values against what hfsim finds: a table that convinces, a regression test of one's own scenes.

A deck states what it is checked against (`hfsim.scene.published`).  Each variant of each deck is solved in a
worker process, runs twice, the second time with a tenth of the tolerance and so on until the error in time
is small beside the bounds.

Nothing is printed or written here.
"""

from hfsim.studies.verify.result import Row, Verification, as_facts
from hfsim.studies.verify.shipped import published_decks
from hfsim.studies.verify.study import Entry, entries_of, entry_of, verify

__all__ = ["Entry", "Row", "Verification", "as_facts", "entries_of", "entry_of", "published_decks", "verify"]
