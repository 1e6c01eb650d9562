"""Several models of one scene held against a reference model: differences and the verdict.

Two errors in time stand in the way of a verdict on models: that of the model and that of the reference.
Both are measured, by a looser run of each, and taken out of the difference; where nothing is left, the
models are equal as far as can be told.  What differences are divided by, and which of them count, is said in
`hfsim.marching.distance`.

Nothing is printed or written here.
"""
