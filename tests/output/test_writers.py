"""Files and folders: full precision, no NaN, nothing of somebody else's removed."""

import json
import math
import os
from dataclasses import replace

import numpy as np
import pytest
import yaml

from hfsim.errors import LimitReached
from hfsim.marching.solution import Channel, Run
from hfsim.output.disk import History, WriteError, read_history, write_json
from hfsim.output.extras import Extras
from hfsim.output.recording import Recording, save_run
from hfsim.output.runfolder import FolderError, RunLog, Stopwatch, claim, folder_name
from hfsim.output.writers import Provenance, differences, json_ready, table_text

RESOLVED = {"name": "case", "solve": {"duration": 1.0}}
PROVENANCE = Provenance("case.yaml", "0" * 64, ("solve.model=exact",), RESOLVED)
DOCUMENTED = {
    *("status", "reason", "model", "method", "cpu_s", "wall_s", "steps", "rejected", "newton_iterations"),
    *("evaluations", "factorisations", "unknowns", "multipliers", "energy_drift", "constraint_position"),
    *("constraint_velocity", "error_estimate", "channels", "deck_sha256", "versions", "kernel"),
    *("failure", "name", "exit_code", "warnings", "overrides"),
}


def make_run(values, status="done", **changes):
    t = np.linspace(0.0, 1.0, len(values))
    run = Run(
        name="case",
        model="exact",
        method="gauss",
        status=status,
        reason="" if status == "done" else "it broke",
        t=t,
        channels=(
            Channel("b1.tip.x", "m", np.asarray(values, dtype=float)),
            Channel("b1.angle", "rad", 0.1 * t),
        ),
        outline_t=t,
        outlines={"b1": np.zeros((len(values), 3, 2))},
        statistics={"cpu_s": {"build": 0.1, "solve": 0.2}, "wall_s": {"solve": 0.3}, "steps": 7},
        failure=None,
        exit_code=0 if status == "done" else 3,
    )
    return replace(run, **changes)


def save(path, run, force=False, plots=False):
    return save_run(claim(path, force), run, PROVENANCE, Stopwatch(), RunLog(), Extras(plots))


def test_history_reads_back_bit_for_bit(tmp_path):
    rng = np.random.default_rng(1)
    table = rng.standard_normal((9001, 3)) * 10.0 ** rng.integers(-300, 300, (9001, 3))
    history = History(tmp_path / "h.csv", ("b1.tip.x", "b1.angle"))
    history.add(table[:4000])
    there = history.there
    history.add(table[4000:])
    assert (tmp_path / "h.csv").read_text().splitlines()[0] == "t,b1.tip.x,b1.angle"
    assert np.array_equal(np.genfromtxt(tmp_path / "h.csv", delimiter=",", skip_header=1), table)
    assert np.array_equal(read_history(tmp_path / "h.csv", there), table[:4000])


def test_a_history_goes_on_where_it_was_cut_off(tmp_path):
    first = History(tmp_path / "h.csv", ("x",))
    first.add(np.array([[0.0, 1.0]]))
    there = first.there
    first.add(np.array([[1.0, 2.0], [2.0, 3.0]]))
    again = History(tmp_path / "h.csv", ("x",), there)
    again.add(np.array([[5.0, 6.0]]))
    assert read_history(tmp_path / "h.csv", again.there).tolist() == [[0.0, 1.0], [5.0, 6.0]]
    assert (tmp_path / "h.csv").read_text() == "t,x\n0.0,1.0\n5.0,6.0\n"


def test_a_full_disk_leaves_whole_rows(tmp_path, monkeypatch):
    history, write = History(tmp_path / "h.csv", ("x",)), os.write
    history.add(np.array([[0.0, 1.0]]))

    def full(file, data):
        if len(data) < 4:
            raise OSError(28, "No space left on device")
        return write(file, data[: len(data) // 2])

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(OSError, match="No space"):
        history.add(np.array([[1.0, 2.0], [2.0, 3.0]]))
    assert (tmp_path / "h.csv").read_text() == "t,x\n0.0,1.0\n1.0,2.0\n", "as many as it took"
    assert (history.rows, history.there.size) == (2, 20)


def test_writers_refuse_what_is_not_finite(tmp_path):
    with pytest.raises(ValueError, match="finite"):
        History(tmp_path / "h.csv", ("x",)).add(np.array([[0.0, math.nan]]))
    assert (tmp_path / "h.csv").read_text() == "t,x\n"
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "s.json", {"a": math.inf})
    assert [path.name for path in tmp_path.iterdir()] == ["h.csv"]


def test_non_finite_numbers_in_json_become_null_and_are_named():
    bad = []
    facts = {"a": np.float64("nan"), "b": [np.inf, np.int64(2)], "c": np.array([1.0, np.nan])}
    plain = json_ready(facts, lost=bad)
    assert plain == {"a": None, "b": [None, 2], "c": [1.0, None]}
    assert bad == ["a", "b.0", "c.1"]


def test_table_leaves_unknown_cells_empty_and_quotes_commas_and_ends_of_lines():
    rows = [{"a": 1.5, "b": None, "c": 'x, "y"'}, {"a": math.nan, "b": True}, {"a": 1, "c": "x\ny"}]
    assert table_text(rows, ("a", "b", "c")) == 'a,b,c\n1.5,,"x, ""y"""\n,True,\n1,,"x\ny"\n'


def test_run_folder_has_all_files_and_the_documented_keys(tmp_path):
    _, summary = save(tmp_path / "out", make_run([1.0, 2.0], statistics={"energy_drift": math.nan}))
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"history.csv", "summary.json", "resolved.yaml", "run.log"}
    assert json.loads((tmp_path / "out/summary.json").read_text()) == summary
    assert set(summary) >= DOCUMENTED
    assert summary["energy_drift"] is None
    assert summary["warnings"] == ["energy_drift is not finite: written as null"]
    assert summary["channels"] == {"b1.tip.x": "m", "b1.angle": "rad"}
    resolved = yaml.safe_load((tmp_path / "out/resolved.yaml").read_text())
    assert resolved == {"name": "case", "solve": {"duration": 1.0, "model": "exact"}}


def test_summary_has_the_time_of_every_phase(tmp_path):
    _, summary = save(tmp_path / "out", make_run([1.0, 2.0]))
    for times in (summary["cpu_s"], summary["wall_s"]):
        assert {"solve", "write", "total"} <= set(times)
        assert times["total"] >= times["write"] >= 0.0


def test_plots_are_drawn_and_listed(tmp_path):
    _, summary = save(tmp_path / "out", make_run([1.0, 2.0, 0.5]), plots=True)
    drawn = {f"plots/{path.name}" for path in (tmp_path / "out/plots").glob("*.png")}
    assert {"plots/position.png", "plots/angle.png", "plots/shapes.png"} <= drawn
    assert drawn < set(summary["files"])


def test_an_empty_run_can_be_saved(tmp_path):
    empty = make_run([], status="failed", outlines={})
    _, summary = save(tmp_path / "out", empty, plots=True)
    assert summary["status"] == "failed"
    assert (tmp_path / "out/history.csv").read_text() == "t,b1.tip.x,b1.angle\n"


def test_a_finished_run_is_protected_and_force_removes_only_its_own_files(tmp_path):
    out = tmp_path / "out"
    save(out, make_run([1.0, 2.0]), plots=True)
    (out / "notes.txt").write_text("mine")
    (out / "plots/mine.png").write_text("mine too")
    with pytest.raises(FolderError, match="--force"):
        claim(out, force=False)
    save(out, make_run([3.0, 4.0]), force=True)
    assert {p.name for p in (out / "plots").iterdir()} == {"mine.png"}
    assert (out / "notes.txt").read_text() == "mine"


def test_a_failed_run_may_be_replaced_without_force(tmp_path):
    save(tmp_path / "out", make_run([1.0], status="failed"))
    assert "failed" in claim(tmp_path / "out", force=False).replaces


def test_files_of_unknown_origin_are_protected(tmp_path):
    (tmp_path / "history.csv").write_text("somebody else's")
    with pytest.raises(FolderError, match=r"history\.csv"):
        claim(tmp_path, force=False)


def test_results_of_any_study_are_protected_from_a_run(tmp_path):
    (tmp_path / "data.json").write_text("[1, 2]")
    assert claim(tmp_path, force=False).stale == ()
    (tmp_path / "race.json").write_text(json.dumps({"versions": {"hfsim": "1"}, "files": ["race.json"]}))
    with pytest.raises(FolderError, match=r"race\.json"):
        claim(tmp_path, force=False)
    assert claim(tmp_path, force=True, marker="race.json").stale == ("race.json",)


def test_force_replaces_results_of_any_kind_whole(tmp_path):
    save(tmp_path, make_run([1.0, 2.0]), plots=True)
    drawn = {f"plots/{one.name}" for one in (tmp_path / "plots").iterdir()}
    (tmp_path / "data.json").write_text(json.dumps({"versions": {}, "files": ["data.json"]}))
    (tmp_path / "mine.json").write_text(json.dumps({"versions": {"hfsim": "1"}, "files": ["history.csv"]}))
    (tmp_path / "package.json").write_text(json.dumps({"versions": {"x": 1}, "files": ["package.json"]}))
    stale = set(claim(tmp_path, force=True, marker="race.json").stale)
    assert drawn and stale == {"history.csv", "summary.json", "resolved.yaml", "run.log", *drawn}
    (tmp_path / "race.json").write_text(json.dumps({"versions": {"hfsim": "1"}, "files": ["race.json"]}))
    assert set(claim(tmp_path, force=True).stale) == {*stale, "race.json"}


def test_an_edited_summary_cannot_make_force_remove_other_files(tmp_path):
    victim = tmp_path / "precious.csv"
    victim.write_text("keep")
    out = tmp_path / "out"
    out.mkdir()
    listed = ["../precious.csv", str(victim), "history.csv", 3, "plots/../../precious.csv"]
    (out / "summary.json").write_text(json.dumps({"status": "done", "files": listed}))
    claim(out, force=True).prepare()
    assert victim.exists()
    assert not (out / "summary.json").exists()


def test_an_interrupted_write_never_looks_finished(tmp_path, monkeypatch):
    save(tmp_path / "out", make_run([1.0, 2.0]))

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(History, "add", stop)
    with pytest.raises(KeyboardInterrupt):
        save(tmp_path / "out", make_run([1.0, 2.0]), force=True)
    assert json.loads((tmp_path / "out/summary.json").read_text())["status"] == "running"


def test_a_full_disk_is_told_in_plain_words(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(History, "add", full)
    with pytest.raises(LimitReached, match=r"history\.csv: No space left"):
        save(tmp_path / "out", make_run([1.0, 2.0]))
    monkeypatch.setattr("hfsim.output.disk.os.replace", full)
    with pytest.raises(WriteError, match="No space left"):
        save(tmp_path / "other", make_run([1.0, 2.0]))


def test_two_processes_do_not_write_into_one_folder(tmp_path):
    first = claim(tmp_path / "out", force=False)
    second = claim(tmp_path / "out", force=False)
    first.prepare()
    for late in (second.prepare, lambda: claim(tmp_path / "out", force=True)):
        with pytest.raises(FolderError, match="another hfsim is writing"):
            late()
    first.release()
    second.prepare()


def test_pictures_of_somebody_else_are_left_alone(tmp_path):
    (tmp_path / "out/plots").mkdir(parents=True)
    (tmp_path / "out/plots/position.png").write_text("mine")
    run, summary = save(tmp_path / "out", make_run([1.0, 2.0]), plots=True)
    assert (tmp_path / "out/plots/position.png").read_text() == "mine"
    assert "position.png" in summary["warnings"][-1]
    assert (run.exit_code, summary["status"]) == (0, "done")
    assert not [name for name in summary["files"] if name.startswith("plots/")]


def test_pictures_that_cannot_be_drawn_cost_nothing(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/plots").write_text("a file")
    run, summary = save(tmp_path / "out", make_run([1.0, 2.0]), plots=True)
    assert (run.exit_code, summary["status"]) == (0, "done")
    assert "pictures were not drawn" in summary["warnings"][-1]


def test_a_link_is_not_written_through(tmp_path):
    victim = tmp_path / "victim.csv"
    (tmp_path / "out").mkdir()
    (tmp_path / "out/history.csv").symlink_to(victim)
    with pytest.raises(FolderError, match=r"history\.csv"):
        claim(tmp_path / "out", force=False)
    assert not victim.exists()


def test_a_file_in_the_way_is_refused(tmp_path):
    (tmp_path / "out").write_text("")
    for path in (tmp_path / "out", tmp_path / "out/deeper"):
        with pytest.raises(FolderError, match="is a file"):
            claim(path, force=True)


def test_a_link_to_nothing_is_no_folder(tmp_path):
    (tmp_path / "broken").symlink_to("nowhere")
    (tmp_path / "loop").symlink_to("loop")
    for name, target in (("broken", "nowhere"), ("broken/deeper", "nowhere"), ("loop", "loop")):
        with pytest.raises(FolderError, match=f"is a link to {target}, which is not there"):
            claim(tmp_path / name, force=True)


@pytest.mark.parametrize("name", ["../../etc", "/etc/passwd", "..", "", "a/b"])
def test_no_deck_name_leads_out_of_the_folder(name):
    assert "/" not in folder_name(name, ".out")
    assert not folder_name(name, "").startswith(".")


@pytest.mark.parametrize(("seconds", "some"), [(60.0, True), (0.25, False)])
def test_pictures_get_what_the_work_before_has_left_of_the_time(tmp_path, seconds, some):
    spent = {"build": 9.0, "solve": 9.0, "error_estimate": 0.2, "diagnosis": 0.05}
    run = make_run(np.linspace(0.0, 1.0, 5), statistics={"cpu_s": spent, "wall_s": spent, "steps": 7})
    recording = Recording(claim(tmp_path / "out", False), "case", "exact", PROVENANCE, Stopwatch(), RunLog())
    recording.begin([channel.name for channel in run.channels])
    recording.rows(run.table)
    finished, summary = recording.finish(run, Extras(pictures=True, after=seconds))
    told = [one for one in finished.statistics.get("warnings", ()) if "drawn until time was up" in one]
    assert bool(told) != some
    assert any(name.endswith(".png") for name in summary["files"]) == some


def test_differences_are_told_in_brief_and_as_what_they_are():
    told = list(differences({"a": "1,2" * 500, "b": "1", "c": [1]}, {"a": [1.5] * 500, "b": 1}))
    assert all(len(line) < 250 for line in told)
    assert told[1:] == ['  b: "1" then, 1 now', "  c: [1] then, not there now"]
