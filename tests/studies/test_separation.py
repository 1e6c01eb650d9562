"""`hfsim bench --separation`, `solve.elastic_form` and the quadratic maps behind the elastic law."""

import csv
import json
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from element_laws import gradient_of

from hfsim.cli import app
from hfsim.deck.materials import BeamProperties
from hfsim.errors import DeckError
from hfsim.marching.integration import run_integration
from hfsim.marching.stop import Budget
from hfsim.parts.elements import ELASTIC_FORMS, ELEMENTS, elastic_form, join_laws
from hfsim.parts.elements._base import QuadraticMap
from hfsim.parts.elements.forces import ElasticForce
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.scene.shipped import CASES
from hfsim.studies.separation.beams import KINDS, STEPS, Beams
from hfsim.studies.separation.measure import held_bytes, measure
from hfsim.studies.separation.results import CSV_COLUMNS, as_facts, as_rows
from hfsim.studies.separation.separated import SeparatedStiffness

STIFFNESS = BeamProperties(
    axial_stiffness=1260.0, bending_stiffness=8.5e-3, lame_lambda=1e5, lame_mu=3.5e5, height=0.009, width=0.2
)


def close(a, b, tolerance):
    np.testing.assert_allclose(a, b, rtol=0, atol=tolerance * np.abs(b).max())


# quadratic maps and the Gram law ----------------------------------------------------------------------


@pytest.mark.parametrize("scaled", [False, True])
def test_a_quadratic_map_sums_all_products(scaled, rng):
    full, constant = rng.normal(size=(4, 4, 5)), rng.normal(size=(3, 5))
    full[1, 2] = full[2, 1] = 0.0
    scale = rng.uniform(1.0, 9.0, size=(3, 1)) if scaled else None
    x = rng.normal(size=(2, 3, 4))
    expected = np.einsum("cdo,bec,bed->beo", full, x, x) + constant
    mine = replace(QuadraticMap.of(full, constant), scale=scale)
    assert len(mine.first) == 9  # ten pairs, one of them never used
    close(mine(x), expected * (scale if scaled else 1.0), 1e-13)


@pytest.mark.parametrize("name", list(ELEMENTS))
@pytest.mark.parametrize("lengths", [(0.3, 0.3), (0.3, 0.2)])
def test_gradient_and_hessian_of_the_gram_law_are_those_of_its_formula(name, lengths, rng):
    if name == "continuum" and lengths[0] != lengths[1]:
        pytest.skip("such beams share no law")
    law = join_laws([ELEMENTS[name](le).gram_law(STIFFNESS, 2) for le in lengths])
    n = len(ELEMENTS[name](1.0).differences())
    V = rng.normal(size=(3, 4, n, 2))
    C = law.quadratic.reshape(n, n, n, n)
    G = V @ V.swapaxes(-1, -2)
    linear = law.linear_at_zero.reshape(4, n, n)
    H = 2.0 * law.scale[:, None, None] * (np.einsum("abcd,xecd->xeab", C, G) + linear)
    close(gradient_of(law, V), H @ V, 1e-13)
    own = 4.0 * law.scale[:, None, None, None, None] * np.einsum("abcd,xebi,xedj->xeaicj", C, V, V)
    whole = own + np.einsum("xeac,ij->xeaicj", H, np.eye(2))
    close(law.hessian(V), whole.reshape(3, 4, 2 * n, 2 * n), 1e-13)


# forms in scenes --------------------------------------------------------------------------------------

DECK = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {rubber: {density: 5540.0, youngs_modulus: 7.0e5}}
sections: {strip: {area: 1.8e-3, second_moment: 1.215e-8}}
bodies:
  a: {type: beam, material: rubber, section: strip, length: 1.0, elements: 2, element: ELEMENT}
  b: {type: beam, material: rubber, section: strip, length: 0.7, elements: 2, element: ELEMENT}
  c: {type: beam, material: rubber, section: strip, length: 0.7, elements: 2, element: ELEMENT}
joints:
  pin: {type: revolute, between: [ground, a.root]}
  elbow: {type: revolute, between: [a.tip, b.root]}
  wrist: {type: revolute, between: [b.tip, c.root]}
solve: {duration: 0.02, step: 0.002, method: gauss, stages: 4}
"""


@pytest.mark.parametrize("element", list(ELEMENTS))
def test_a_scene_runs_alike_with_every_form(element):
    ends, energies, slopes = [], [], []
    for form in ELASTIC_FORMS:
        scene = build(parse_deck(DECK.replace("ELEMENT", element), "d.yaml", [f"solve.elastic_form={form}"]))
        done = run_integration(scene, scene.deck.solve)
        assert done.stop is None
        ends.append(done.trajectory.q)
        x = scene.system.absolute(done.trajectory.q[None])
        energies.append(scene.system.strain_energy(x)[0])
        slopes.append(scene.system.linearized(0.0, scene.q, scene.v).stiffness)
    for end, energy, slope in zip(ends, energies, slopes, strict=True):
        close(end, ends[-1], 1e-11)
        close(slope, slopes[-1], 1e-9)
        assert energy == pytest.approx(energies[-1], rel=1e-8)


SPATIAL = """
hfsim: 1
gravity: [0.0, -3.0, -9.81]
materials: {rubber: {density: 5540.0, youngs_modulus: 7.0e5, poisson_ratio: POISSON}}
sections: {strip: {shape: rectangle, height: 0.05, width: 0.05}}
bodies:
  a: {type: beam, material: rubber, section: strip, length: 1.0, elements: 2, element: ELEMENT}
  b: {type: beam, material: rubber, section: strip, length: 0.7, elements: 2, element: ELEMENT}
joints:
  pin: {type: spherical, between: [ground, a.root]}
  elbow: {type: spherical, between: [a.tip, b.root]}
initial: {a: {angular_velocity: [0.0, 2.0, 1.0]}, b: {orientation: {axis: [0, 1, 0], angle: 0.5}}}
solve: {duration: 0.02, step: 0.002, method: gauss, stages: 4}
"""


@pytest.mark.parametrize("element", list(ELEMENTS))
def test_a_spatial_scene_runs_alike_with_every_form(element):
    text = SPATIAL.replace("ELEMENT", element).replace("POISSON", "0.3")
    ends, slopes = [], []
    for form in ELASTIC_FORMS:
        scene = build(parse_deck(text, "d.yaml", [f"solve.elastic_form={form}"]))
        done = run_integration(scene, scene.deck.solve)
        assert done.stop is None
        ends.append(done.trajectory.q)
        slopes.append(scene.system.linearized(0.0, scene.q, scene.v).stiffness)
    for end, slope in zip(ends, slopes, strict=True):
        close(end, ends[-1], 1e-11)
        close(slope, slopes[-1], 1e-9)


def test_all_forms_of_the_paper_s_24_coordinates_give_one_force(rng):
    """Eq. (27), eq. (39) and products of vectors, at random coordinates, Poisson's ratio 0.3."""
    element = ELEMENTS["continuum"].of(0.3, 3, n_dim=3)
    own = STIFFNESS._replace(breadth=0.2)
    p = rng.normal(size=(24, 5))
    ways = {name: elastic_form(name).of(element, own, 3) for name in ELASTIC_FORMS}
    results = {k: (*way.force_and_tangent(p), way.stiffness(p), way.force(p)) for k, way in ways.items()}
    for result in results.values():
        for mine, direct in zip(result, results["direct"], strict=True):
            close(mine, direct, 1e-12)
    force, _, stiffness, _ = results["direct"]
    close(force.T, (stiffness @ p.T[..., None])[..., 0], 1e-13)


def test_gram_is_the_default_and_shares_one_law():
    scene = build(parse_deck(DECK.replace("ELEMENT", "cable")))
    assert scene.deck.solve.elastic_form == "gram"
    assert sum(isinstance(f, ElasticForce) for f in scene.system.forces) == 1


def test_decks_name_the_forms_of_the_registry():
    with pytest.raises(DeckError) as refused:
        parse_deck(DECK.replace("ELEMENT", "cable"), "d.yaml", ["solve.elastic_form=grim"])
    assert all(form in str(refused.value) for form in ELASTIC_FORMS)


def test_other_forms_need_a_polynomial_energy():
    overrides = ["solve.elastic_form=direct", "bodies.b1.curvature=exact"]
    with pytest.raises(DeckError, match=r"needs strain: green, curvature: linear"):
        load_deck(CASES / "pendulum.yaml", overrides)


# the study --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("element", list(ELEMENTS))
def test_the_beam_of_the_study_is_the_pendulum_of_the_paper(element):
    overrides = ["solve.model=ancf", f"bodies.b1.element={element}"]
    pendulum = build(load_deck(CASES / "pendulum.yaml", overrides)).system
    scene = Beams(element, 4).scene("gram")
    state = np.zeros(1), scene.q[None], scene.v[None]
    close(scene.system.acceleration(*state), pendulum.acceleration(*state), 1e-12)


@pytest.mark.parametrize("element", list(KINDS))
def test_the_forms_are_measured_on_the_elements_of_the_scene(element):
    beams = Beams(element, 3, 2)
    scene = beams.scene("direct")
    forces = [force for force in scene.system.forces if isinstance(force, ElasticForce)]
    assert len(forces) == 1
    x = scene.system.absolute(scene.q[None])
    p = forces[0].elements.rows(x)
    assert beams.components == pytest.approx(p.reshape(-1, p.shape[-1]), abs=1e-15)


@pytest.mark.parametrize("count", [2, 24])
def test_beams_of_a_batch_move_one_by_one(count):
    batch, one = Beams("continuum", count, 3).scene("gram"), Beams("continuum", count).scene("gram")
    done = [run_integration(scene, scene.deck.solve).trajectory for scene in (batch, one)]
    ends = [
        scene.system.absolute(run.at(run.step_ends())[0])
        for scene, run in zip((batch, one), done, strict=True)
    ]
    assert len(ends[1]) == STEPS + 1
    close(ends[0][:, : ends[1].shape[1]], ends[1], 1e-10)
    first, second = np.split(ends[0], 3, axis=1)[:2]
    assert np.abs(second - first).max() > 0.1


def test_a_whole_run_keeps_the_energy():
    scene = Beams("cable", 4).scene("gram")
    run = run_integration(scene, scene.deck.solve).trajectory
    q, v = run.at(run.step_ends())
    system = scene.system
    x, u = system.absolute(q), system.absolute_velocity(q, v)
    kinetic = system.kinetic_energy(x, u)
    total = kinetic + system.strain_energy(x) + system.potential_energy(run.step_ends(), x)
    assert np.ptp(total) < 1e-6 * np.ptp(kinetic)


def shorten(patch):
    """Let whole runs be of three steps: no test asks how long a form takes."""
    for name in ("beams", "measure"):
        patch.setattr(f"hfsim.studies.separation.{name}.STEPS", 3)


@pytest.fixture
def short(monkeypatch):
    shorten(monkeypatch)


@pytest.fixture(scope="module")
def result():
    with pytest.MonkeyPatch.context() as patch:
        shorten(patch)
        return measure((1, 3), tuple(KINDS), 2, Budget(60.0))


def test_all_forms_are_measured_and_agree(result):
    assert result.status == "done"
    assert [(cell.element, cell.elements) for cell in result.cells] == [
        (kind, count) for kind in KINDS for count in (1, 3)
    ]
    for cell in result.cells:
        assert [form.form for form in cell.forms] == list(ELASTIC_FORMS)
        assert cell.repeats == 2
        assert 0.0 < cell.share <= 1.0
        direct = cell.forms[0]
        for form in cell.forms:
            assert form.worst_difference < 1e-10
            assert form.run_ratio == form.run.median / direct.run.median
            assert 0.0 < form.force.least <= form.force.median <= form.force.most
            assert form.tables > 0 and form.peak > 0
    assert not result.disagreements


def test_rows_and_facts_hold_what_was_measured(result):
    rows, facts = as_rows(result), as_facts(result)
    assert len(rows) == 2 * len(KINDS) * len(ELASTIC_FORMS)
    assert all(set(row) == set(CSV_COLUMNS) for row in rows)
    assert len(facts["verdicts"]) == 2
    json.dumps(facts, allow_nan=False)


def test_a_spent_budget_leaves_cells_out_and_says_so():
    result = measure((1, 2), ("cable",), 3, Budget(1e-6))
    assert [(cell.status, cell.repeats) for cell in result.cells] == [("done", 1), ("skipped", 0)]
    assert result.cells[1].reason == "the budget is used up"
    assert [row.get("status") for row in as_rows(result)][-1] == "skipped"


def test_memory_of_tables_counts_what_is_kept_after_use():
    form = SeparatedStiffness.of(ELEMENTS["cable"](0.3), STIFFNESS)
    before = held_bytes(form)
    assert before == 8 * (8**4 + 8**2), "the paper's two tables, dense"
    SeparatedStiffness.of(ELEMENTS["cable"](0.3), STIFFNESS).force(np.zeros((8, 1)))
    tracemalloc.start()
    form.force(np.zeros((8, 1)))
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 0 <= kept - (held_bytes(form) - before) < 4096, "objects around the numbers are not counted"


class Broken(SeparatedStiffness):
    def force(self, p):
        return super().force(p) * (1.0 + 1e-6)


def test_a_broken_form_is_found_out(monkeypatch):
    monkeypatch.setitem(ELASTIC_FORMS, "separated", Broken)
    result = measure((2,), ("cable",), 1, Budget(60.0))
    assert result.status == "wrong"
    assert "separated differs from direct by" in result.disagreements[0]


# the command ------------------------------------------------------------------------------------------


def call(*arguments):
    return CliRunner().invoke(app, ["bench", *map(str, arguments)])


@pytest.mark.usefixtures("short")
def test_the_command_writes_table_csv_json_and_plot(tmp_path):
    folder = tmp_path / "o"
    done = call("--separation", "--elements", "1,2", "--element", "cable", "--repeats", 1, "-o", folder)
    assert done.exit_code == 0
    for words in ("cable:", "tabulated", "the paper reports 10 %", "goal 3 %"):
        assert words in done.stdout
    with (folder / "bench.csv").open() as file:
        rows = list(csv.DictReader(file))
    sizes = [(row["elements"], row["states"]) for row in rows]
    assert sizes == [(n, b) for b in ("1", "64") for n in ("1", "2") for _ in range(4)]
    facts = json.loads((folder / "bench.json").read_text())
    assert facts["status"] == "done"
    assert facts["files"] == ["bench.csv", "bench.json", "plots/separation_cable.png"]
    assert (folder / "plots" / "separation_cable.png").stat().st_size > 10_000
    again = call("--separation", "--elements", "1", "-o", folder)
    assert again.exit_code == 2
    assert "--force" in again.output


@pytest.mark.usefixtures("short")
def test_the_command_prints_json_and_nothing_else(tmp_path):
    done = call("--separation", "--elements", 1, "--element", "cable", "--repeats", 1, "--no-plots", "-q",
                "--json", "-o", tmp_path / "o")  # fmt: skip
    assert done.exit_code == 0
    assert json.loads(done.output)["cells"][0]["forms"][0]["form"] == "direct"


@pytest.mark.usefixtures("short")
def test_forms_that_disagree_give_exit_code_4(tmp_path, monkeypatch):
    monkeypatch.setitem(ELASTIC_FORMS, "separated", Broken)
    done = call("--separation", "--elements", 1, "--element", "cable", "--repeats", 1, "--no-plots", "-o",
                tmp_path / "o")  # fmt: skip
    assert done.exit_code == 4
    assert "separated differs from direct" in done.stderr
    assert json.loads((tmp_path / "o" / "bench.json").read_text())["status"] == "wrong"


@pytest.mark.usefixtures("short")
def test_an_interruption_keeps_what_was_measured(tmp_path, monkeypatch):
    class Interrupting(SeparatedStiffness):
        def force(self, p):
            if p.shape[1] == 2:
                raise KeyboardInterrupt
            return super().force(p)

    monkeypatch.setitem(ELASTIC_FORMS, "separated", Interrupting)
    done = call(
        *("--separation", "--elements", "1,2", "--states", 1, "--element", "cable", "--repeats", 1),
        *("-o", tmp_path / "o"),
    )
    assert done.exit_code == 130
    cells = json.loads((tmp_path / "o" / "bench.json").read_text())["cells"]
    assert [cell["status"] for cell in cells] == ["done", "skipped"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--separation", "pendulum"], "DECK does not go with --separation"),
        (["--separation", "--methods", "gauss"], "--methods does not go"),
        (["--separation", "--element", "truss"], "there is no element 'truss'"),
        (["pendulum", "--element", "cable"], "goes with --separation only"),
        (["pendulum", "--states", "2"], "goes with --separation only"),
        ([], "Missing argument 'DECK'"),
    ],
)
def test_options_that_do_not_fit_are_refused(arguments, words, tmp_path):
    done = call(*arguments, "-o", tmp_path / "o")
    assert done.exit_code == 2
    assert words in done.output
    assert not (tmp_path / "o").exists()
