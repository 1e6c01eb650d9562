"""From a deck to an assembled scene."""
