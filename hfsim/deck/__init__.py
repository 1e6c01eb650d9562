"""What decks are read with: YAML with positions, units, field types, materials, laws of time."""
