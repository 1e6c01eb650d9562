"""Results to pictures; the only package that imports matplotlib. Each kind is imported where it is drawn."""
