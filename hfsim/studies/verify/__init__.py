"""Published values against what hfsim finds: a table that convinces, a regression test of one's own scenes.

A deck states what it is checked against (`hfsim.scene.published`).  Each variant of each deck is solved in a
worker process, runs twice, the second time with a tenth of the tolerance and so on until the error in time
is small beside the bounds.

Nothing is printed or written here.
"""
