"""Commands as they are called from a shell, in this process."""

from click.testing import CliRunner

from hfsim.cli import app


def call(*words):
    """What a command says, with its exit code."""
    return CliRunner().invoke(app, [str(word) for word in words])
