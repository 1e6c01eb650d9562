"""Error against run time: one scene with many methods, tolerances, models and meshes.

The truth is computed, not assumed.  For each model and mesh (a `Cell`) the same equations are solved by
two methods, ever tighter, until they agree; what is left between them is the error floor, below which no
error is a number.  With several meshes a second truth, on a mesh twice as fine as the finest, splits the
error of each point into that of time and that of the mesh.

Nothing is printed or written here.
"""
