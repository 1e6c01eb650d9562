"""What the JSON of every study says, under the same keys: of what it is, how it ended, what it wrote."""

import json

import pytest
from click.testing import CliRunner
from wheel import WHEEL

from hfsim.cli import app

EVERY = {"name", "status", "deck", "deck_sha256", "overrides", "versions", "files"}
STUDIES = {
    "run": ("run", "wheel.yaml"),
    "static": ("static", "wheel.yaml"),
    "modes": ("modes", "wheel.yaml"),
    "compare": ("compare", "rigid", "--reference", "rigid", "--case", "wheel.yaml", "--repeats", "1"),
    "bench": ("bench", "wheel.yaml", "--methods", "gauss", "--tolerances", "1e-3"),
    "stability": ("stability", "wheel.yaml", "--methods", "gauss", "--models", "exact"),
    "sweep": ("sweep", "wheel.yaml", "--vary", "bodies.hub.mass=1,2"),
}


@pytest.mark.parametrize("study", STUDIES)
def test_every_study_has_the_facts_of_all(study, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wheel.yaml").write_text(WHEEL)
    told = CliRunner().invoke(app, [*STUDIES[study], "--set", "solve.duration=0.1", "--no-plots", "--json"])
    assert told.exit_code == 0, told.stderr
    facts = json.loads(told.stdout)
    assert EVERY - set(facts) == set()
    assert (facts["name"], facts["status"], facts["deck"]) == ("wheel", "done", "wheel.yaml")
