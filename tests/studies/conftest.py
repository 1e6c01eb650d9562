"""What tests of several studies run."""

import pytest
from wheel import WHEEL


@pytest.fixture
def wheel(tmp_path, monkeypatch):
    """The current folder, with the deck of a wheel."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wheel.yaml").write_text(WHEEL)
    return tmp_path
