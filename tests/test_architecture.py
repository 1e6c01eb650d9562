# ruff: noqa: E501
"""Imports point downwards only; what is heavy is imported where it is needed."""

import ast
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from hfsim.arrays import random_signs

PACKAGE = Path(__file__).parent.parent / "hfsim"
GROUND = {
    "arrays",
    "errors",
    "rotations",
    "shapes",
    "spec",
    "units",
    "deck_source",
    "solution",
    "parts",
    "matrices",
    "reduction",
    "linearized",
    "__init__",
}
ALLOWED = {
    "__init__": set(),
    "__main__": {"cli"},
    "arrays": set(),
    "errors": set(),
    "rotations": {"arrays"},
    "shapes": {"arrays"},
    "units": set(),
    "solution": {"arrays"},
    "deck_source": {"errors", "units"},
    "spec": {"deck_source", "units", "errors"},
    "matrices": {"arrays"},
    "reduction": {"arrays", "matrices"},
    "linearized": {"arrays", "matrices"},
    "parts": {"arrays", "matrices"},
    "rules": set(),
    "plan": GROUND | {"bodies", "build", "culprit", "deck", "models", "rules"},
    "progress": set(),
    "clock": set(),
    "laws": GROUND,
    "materials": GROUND,
    "markers": GROUND,
    "constraints": GROUND | {"laws", "markers"},
    "elements": GROUND | {"materials"},
    "models": GROUND | {"elements", "materials", "markers"},
    "bodies": GROUND | {"models", "markers", "materials"},
    "joints": GROUND | {"constraints", "laws", "markers"},
    "forces": GROUND | {"laws", "markers"},
    "integrators": GROUND | {"deck"},
    "equations": GROUND | {"constraints", "markers"},
    "elimination": GROUND | {"bodies", "constraints", "markers", "models"},
    "system": GROUND | {"constraints", "equations", "models"},
    "deck": GROUND | {"bodies", "forces", "joints", "laws", "materials", "rules"},
    "start": GROUND | {"bodies", "constraints", "deck"},
    "build": GROUND
    | {"bodies", "constraints", "deck", "elements", "elimination", "equations"}
    | {"forces", "markers", "models", "rank", "rules", "start", "system"},
    "channels": GROUND | {"build"},
    "culprit": GROUND | {"build"},
    "integration": GROUND | {"build", "culprit", "deck", "integrators", "runaway"},
    "validity": GROUND | {"bodies", "build", "models"},
    "quasistatic": GROUND | {"bodies", "build", "culprit", "markers", "validity"},
    "turns": GROUND | {"build", "integrators"},
    "handover": GROUND | {"bodies", "build", "integrators", "quasistatic", "system", "turns", "validity"},
    "adaptive": GROUND
    | {"bodies", "build", "deck", "handover", "integration", "integrators", "quasistatic", "validity"},
    "diagnosis": GROUND
    | {
        "balance",
        "bodies",
        "build",
        "culprit",
        "deck",
        "growth",
        "integration",
        "integrators",
        "rank",
        "validity",
    },
    "rank": {"arrays"},
    "growth": GROUND | {"build", "deck", "integration"},
    "balance": GROUND | {"integrators", "system"},
    "runaway": GROUND | {"models", "system"},
    "simulate": GROUND
    | {"adaptive", "balance", "build", "channels", "clock", "deck", "diagnosis", "handover"}
    | {"integration", "integrators", "plan", "system", "turns", "validity"},
    "writers": GROUND,
    "runfolder": GROUND | {"clock", "writers", "plots"},
    "plots": GROUND | {"studies"},
    "studies": GROUND
    | {"adaptive", "balance", "bodies", "build", "channels", "clock", "deck", "diagnosis", "elements", "growth"}
    | {"integration", "integrators", "models", "plan", "rules", "simulate", "writers"},
    "cli": {"__init__", "commands", "errors"},
    "commands": None,
}
"""What each module or sub-package may import; None: everything. Layers as in the README: ground, parts, assembly, front."""


def files():
    return sorted(path for path in PACKAGE.rglob("*.py") if "cases" not in path.parts)


def area(path):
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def imports(tree):
    """Yield (module, at module level?, for type checkers only?) of every import."""
    deferred, typing_only = set(), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            deferred |= {id(child) for child in ast.walk(node)}
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            typing_only |= {id(child) for child in ast.walk(node)}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, "write absolute imports"
            names = [f"hfsim.{a.name}" for a in node.names] if node.module == "hfsim" else [node.module]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        for name in names:
            yield name, id(node) not in deferred, id(node) in typing_only


def cases():
    return [pytest.param(path, id=str(path.relative_to(PACKAGE))) for path in files()]


@pytest.mark.parametrize("path", cases())
def test_imports_point_downwards(path):
    assert area(path) in ALLOWED, "say in the table what this module may import"
    allowed = ALLOWED[area(path)]
    for name, _, typing_only in imports(ast.parse(path.read_text())):
        if not name.startswith("hfsim.") or typing_only:
            continue
        target = name.split(".")[1]
        target = target if (PACKAGE / target).is_dir() or (PACKAGE / f"{target}.py").exists() else "__init__"
        assert allowed is None or target in allowed | {area(path)}, f"{area(path)} must not import {target}"


@pytest.mark.parametrize("path", cases())
def test_siblings_share_only_a_base(path):
    """Files of a package of parts import no other one, save its bases."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    if parts[0] not in ("joints", "forces", "channels") or parts[-1] == "__init__":
        return
    for name, _, _ in imports(ast.parse(path.read_text())):
        if name.startswith(f"hfsim.{parts[0]}."):
            assert name.split(".")[-1].startswith("_"), name


@pytest.mark.parametrize("path", cases())
def test_heavy_packages_stay_where_they_belong(path):
    for name, at_module_level, typing_only in imports(ast.parse(path.read_text())):
        package = name.split(".")[0]
        if package == "matplotlib":
            assert area(path) == "plots"
        if package == "scipy":
            assert not at_module_level or typing_only


def test_the_table_is_not_circular():
    done, left = {"commands"}, {key for key, value in ALLOWED.items() if value is not None}
    # integrators know the deck's solve entry by type only, which the table counts all the same
    while left:
        ready = {
            k
            for k in left
            if (ALLOWED[k] & ALLOWED.keys()) - {k} <= done | (GROUND if k not in GROUND else set())
        }
        assert ready, f"a circle among {sorted(left)}"
        done, left = done | ready, left - ready


def modules_after(code):
    script = f"import sys\n{code}\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    return set(done.stdout.splitlines()[-1].split())


def test_help_imports_only_click():
    loaded = modules_after(
        "from hfsim.cli import app\ntry:\n    app(['--help'])\nexcept SystemExit:\n    pass"
    )
    assert "click" in loaded
    assert not loaded & {"numpy", "scipy", "matplotlib", "pydantic", "yaml"}


NOT_NEEDED = {
    *("scipy", "matplotlib", "numpy.ma", "numpy.random", "numpy.testing"),
    *("ssl", "http", "multiprocessing", "concurrent", "unittest"),
    *("hfsim.studies", "hfsim.plots", "hfsim.commands.bench", "hfsim.commands.compare"),
    *("hfsim.laws", "hfsim.joints.driver", "hfsim.joints.fixed", "hfsim.forces.force", "hfsim.forces.two_point"),
}
"""Modules that a run without plots and error estimate does without: each of them costs milliseconds."""


def test_a_run_imports_no_more_than_it_needs(tmp_path):
    code = (
        "from hfsim.cli import app\n"
        "try:\n"
        f"    app(['run', 'pendulum', '--set', 'solve.duration=0.02', '--no-plots', '--no-error-estimate', '-q', '-o', {str(tmp_path / 'o')!r}])\n"
        "except SystemExit as stop:\n"
        "    assert stop.code == 0"
    )
    loaded = modules_after(code)
    assert "numpy" in loaded
    assert not loaded & NOT_NEEDED


def test_a_deck_builds_only_the_classes_it_uses():
    code = (
        "from hfsim.bodies import BeamSpec, RigidSpec\n"
        "from hfsim.deck import load_deck\n"
        f"load_deck({str(ROOT / 'cases' / 'pendulum.yaml')!r})\n"
        "print(*(spec.__name__ for spec in (BeamSpec, RigidSpec) if spec.__pydantic_complete__))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.split() == ["BeamSpec"]


def test_signs_in_no_order_are_both_there_and_always_the_same():
    signs = random_signs((7, 30))
    assert signs.shape == (7, 30) and set(signs.ravel()) == {-1.0, 1.0}
    assert abs(signs.sum()) < 60 and (signs == random_signs((7, 30))).all()


# README and .ci/run ----------------------------------------------------------------------------------

ROOT = PACKAGE.parent


def test_ci_runs_the_commands_of_the_readme():
    set_up = re.findall(r"```sh\n(.*?)\n```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert len(set_up) == 2
    script = (ROOT / ".ci" / "run").read_text()
    run = [" ".join(line.split()) for line in script.splitlines()]
    called = {shlex.split(line)[-1] for line in run if line.startswith("timed bash -c ")}
    assert called == set(set_up)
    assert "set -euo pipefail" in run


def test_the_deck_of_the_readme_runs():
    from hfsim.deck import parse_deck
    from hfsim.simulate import simulate

    deck = re.search(r"```yaml\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert deck
    result = simulate(parse_deck(deck.group(1), "readme.yaml", ["solve.duration=0.05"]), error_estimate=False)
    assert result.status == "done"


def test_the_readme_names_all_there_is():
    from hfsim.channels import CHANNELS
    from hfsim.cli import COMMANDS
    from hfsim.integrators import METHODS
    from hfsim.laws import LAWS
    from hfsim.models import MODELS

    text = (ROOT / "README.md").read_text()
    cases = [path.stem for path in (ROOT / "cases").glob("*.yaml")]
    for name in [*METHODS, *MODELS, *LAWS, *cases]:
        assert f"`{name}`" in text, name
    for name in CHANNELS:
        assert f".{name}" in text, name
    for name in COMMANDS:
        assert f"hfsim {name}" in text, name
