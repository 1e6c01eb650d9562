"""hfsim: flexible multibody dynamics with four models of one scene."""

__version__ = "0.1.0"
