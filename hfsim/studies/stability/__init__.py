"""Where methods and models hold: points of a map, each held against references and put into a class."""
