"""What matrix separation saves: forms of one elastic force, measured side by side (the paper's Table 1)."""
