"""Files, pictures, tables, and what Python gets."""
