"""The page of a run, and of a comparison: whole, escaped, and without anything from elsewhere."""

import json
from html.parser import HTMLParser

from called import call

import hfsim
from hfsim.output.plots import comparison as overlays
from hfsim.scene.shipped import CASES


class Reader(HTMLParser):
    """Collects what opens and closes, and what is loaded."""

    def __init__(self):
        super().__init__()
        self.open, self.sources, self.words = [], [], []

    def handle_starttag(self, tag, attrs):
        if tag not in ("meta", "img"):
            self.open.append(tag)
        self.sources += [value for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def test_the_page_of_a_run_is_whole_and_safe(tmp_path):
    deck = tmp_path / "deck.yaml"
    deck.write_text("# <script>alert(1)</script> & more\n" + (CASES / "pendulum.yaml").read_text())
    options = ["--report", "--set", "solve.duration=0.05", "--no-diagnosis", "-q", "-o", str(tmp_path / "a")]
    for force in ([], ["--force"]):
        result = call("run", str(deck), *options, *force)
        assert result.exit_code == 0, result.output
    text = (tmp_path / "a/report.html").read_text()
    reader = Reader()
    reader.feed(text)
    assert reader.open == []
    assert "<script" not in text
    told = "".join(reader.words)
    assert "<script>alert(1)</script> & more" in told
    summary = json.loads((tmp_path / "a/summary.json").read_text())
    assert "report.html" in summary["files"]
    pictures = [name for name in summary["files"] if name.endswith(".png")]
    assert len(reader.sources) == len(pictures) > 0
    assert all(source.startswith("data:image/png;base64,") for source in reader.sources)
    for words in ("What is doubtful", *summary["warnings"], *summary["channels"], "solve.duration=0.05"):
        assert words in told


def test_the_page_of_a_comparison_has_verdict_tables_and_overlays(tmp_path):
    folder = tmp_path / "a"
    argv = ["compare", "linear", "--case", "pendulum", "--repeats", "1", "--set", "solve.duration=0.05"]
    result = call(*argv, "--report", "-q", "-o", str(folder))
    assert result.exit_code == 0, result.output
    reader = Reader()
    reader.feed((folder / "report.html").read_text())
    assert reader.open == []
    facts, told = json.loads((folder / "compare.json").read_text()), "".join(reader.words)
    pictures = [name for name in facts["files"] if name.endswith(".png")]
    assert "report.html" in facts["files"]
    assert len(reader.sources) == len(pictures) == len(facts["scales"]) + 1
    for words in ("Models", "Differences", *facts["scales"], "linear leaves its range", argv[-1]):
        assert words in told
    assert facts["sentence"].removeprefix("verdict: ") in told


def test_overlays_go_through_the_steps_of_each_run(monkeypatch):
    figures = {}
    monkeypatch.setattr(overlays, "save", lambda drawn, folder: figures.update(drawn) or list(drawn))
    found = hfsim.compare("pendulum", ["linear"], {"solve.duration": 0.1, "output.interval": 0.05}, repeats=1)
    overlays.draw_comparison(list(found.runs.values()), found, None)
    linear, exact = figures["b1.angular_velocity"].panels[0].curves
    for line, model in ((linear, "linear"), (exact, "exact")):
        run = found.runs[model]
        assert len(run.t) == 3
        curve = dict(line.points.tolist())
        assert len(curve) > 40
        assert [curve[t] for t in run.t] == run["b1.angular_velocity"].tolist()
