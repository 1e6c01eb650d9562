"""Refinement to a target: elements, degrees, method and tolerance for a stated total error of one scene.

The error of a run is that of its mesh and that in time.  Each is found by refining one thing at a time (the
elements or the degree of a beam, the tolerance) and looking at how far the channels move: the `change` of a
move is the error it took away, and what is left of a falling series of changes is that of a geometric one
(Richardson's argument, with the ratio that was observed).  The part with the most left is refined next, by
the way that took away most for its work so far.  An earlier level is the answer if its distance to the finest
one, plus what that one has left, keeps the target: its error is measured then, save for the small rest.  The
finest level itself is taken only with a factor of safety, as its error is extrapolated.

Where the deck leaves the method open, others are raced against the default one (`hfsim.studies.methods`) as
soon as an error in time has been measured, and again when the mesh has become much finer or the error much
smaller; whatever the search comes to, races have taken no more than a stated part of its time.  A method that
wins is raced on the current mesh too before it is gone on with.

Choices rest on counts of work (evaluations times unknowns), not on times, so that they repeat; that of the
method cannot, and has a margin instead.
Nothing is printed or written here.
"""
