# ruff: noqa: E501
"""Imports point downwards only; what is heavy is imported where it is needed."""

import ast
import re
import shlex
import subprocess
import sys
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "hfsim"
ROOMS = (
    *("__init__", "errors", "maths", "deck", "mechanics", "integrators"),
    *("parts", "parts.elements", "parts.bodies", "parts.joints", "parts.forces", "parts.channels"),
    *("scene", "marching", "trust", "simulate", "studies", "output", "commands", "cli", "__main__"),
)
"""From the ground up: what stands in a room imports from its own room and from those before it."""
MOST_ENTRIES = 16
MOST_LINES = 400


def files():
    return sorted(path for path in PACKAGE.rglob("*.py") if "cases" not in path.parts)


@cache
def parsed(path):
    return ast.parse(path.read_text())


def named(path):
    """Return the dotted name of a module inside the package."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" and len(parts) > 1 else parts)


def room(name):
    """Return the place of a module's room in the order; the longest name that fits."""
    fitting = [k for k, one in enumerate(ROOMS) if f"{name}.".startswith(f"{one}.")]
    assert fitting, f"say in ROOMS where {name} stands"
    return max(fitting, key=lambda k: len(ROOMS[k]))


@cache
def graph():
    """Return the modules of the package that each one imports, those for type checkers included.

    The package itself, on which all stand, tells type checkers alone what users find in it.
    """
    names = {named(path): path for path in files()}
    found = {}
    for name, path in names.items():
        targets = set()
        for target, _, typing_only in imports(parsed(path)):
            if name == "__init__" and typing_only:
                continue
            short = target.removeprefix("hfsim.")
            if short != target or target == "hfsim":
                targets.add(short if short in names else "__init__")
        found[name] = targets - {name}
    return found


def imports(node, at_module=True, typing_only=False):
    """Yield (module, at module level?, for type checkers only?) of every import."""
    if isinstance(node, ast.ImportFrom):
        assert node.level == 0, "write absolute imports"
        names = [f"hfsim.{a.name}" for a in node.names] if node.module == "hfsim" else [node.module]
        yield from ((name, at_module, typing_only) for name in names)
    elif isinstance(node, ast.Import):
        yield from ((alias.name, at_module, typing_only) for alias in node.names)
    at_module = at_module and not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    typing_only = typing_only or (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test))
    for inner in ast.iter_child_nodes(node):
        if isinstance(inner, ast.stmt | ast.excepthandler | ast.match_case):
            yield from imports(inner, at_module, typing_only)


def cases():
    return [pytest.param(path, id=str(path.relative_to(PACKAGE))) for path in files()]


@pytest.mark.parametrize("path", cases())
def test_imports_point_downwards(path):
    name = named(path)
    for target in graph()[name]:
        assert room(target) <= room(name), f"{name} must not import {target}"


def reached(name):
    """Return all that a module imports, directly or not."""
    found, new = set(), {name}
    while new:
        new = set().union(*(graph()[one] for one in new)) - found
        found |= new
    return found


def test_no_circle_of_imports():
    below = {name: reached(name) for name in graph()}
    circles = {tuple(sorted(one for one in names if name in below[one])) for name, names in below.items()}
    assert not circles - {()}


def test_the_house_stays_small():
    entries = {path.relative_to(PACKAGE).parts[0] for path in files()}
    assert len(entries) <= MOST_ENTRIES, sorted(entries)
    long = {named(path): n for path in files() if (n := len(path.read_text().splitlines())) > MOST_LINES}
    assert not long


def siblings():
    names = [(path, named(path)) for path in files()]
    kinds = tuple(f"parts.{room}." for room in ("joints", "forces", "channels"))
    return [pytest.param(path, id=name) for path, name in names if name.startswith(kinds)]


@pytest.mark.parametrize("path", siblings())
def test_siblings_share_only_a_base(path):
    """Files of a package of parts import no other one, save its bases."""
    parts = path.relative_to(PACKAGE).parts
    for name, _, _ in imports(parsed(path)):
        if name.startswith(f"hfsim.parts.{parts[1]}."):
            assert name.split(".")[-1].startswith("_"), name


def mentioned(tree):
    """Yield the names that some code reads, imports or spells out in a text."""
    texts = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if id(node) in texts:
            continue
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, ast.ImportFrom):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from re.findall(r"\w+", node.value)


def defined(tree):
    """Yield (node, name) of what a module and its classes define, save what is registered or overridden."""
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            yield from ((node, one.id) for one in targets if isinstance(one, ast.Name))
        elif isinstance(node, ast.ClassDef):
            yield node, node.name
            if not any(isinstance(base, ast.Attribute) for base in node.bases):
                yield from (pair for pair in defined(node) if isinstance(pair[0], ast.FunctionDef))
        elif isinstance(node, ast.FunctionDef) and set(map(ast.unparse, node.decorator_list)) <= CALLED_BY_NAME:
            yield node, node.name


CALLED_BY_NAME = {"property", "cached_property", "classmethod", "staticmethod", "abstractmethod", "cache"}


def test_nothing_stands_there_unused():
    """What only tests use, or nobody, is dead; that another thing has its name may hide it from this test.

    What the manual's page on Python names is there for users.
    """
    own = {path: Counter(mentioned(parsed(path))) for path in files()}
    counts = Counter[str]()
    for names in own.values():
        counts.update(names)
    counts.update(re.findall(r"\w+", (PACKAGE / "manual" / "python.md").read_text()))
    dead = [
        f"{named(path)}.{name}"
        for path in files()
        for node, name in defined(parsed(path))
        if not name.startswith(("__", "model_"))
        and counts[name] == own[path][name] == Counter(mentioned(node))[name]
    ]
    assert not dead


@pytest.mark.parametrize("path", cases())
def test_heavy_packages_stay_where_they_belong(path):
    for name, at_module_level, typing_only in imports(parsed(path)):
        package = name.split(".")[0]
        if package == "matplotlib":
            assert path.is_relative_to(PACKAGE / "output" / "plots")
        if package == "scipy":
            assert not at_module_level or typing_only


def modules_after(code):
    script = f"import atexit, sys\natexit.register(lambda: print(*sys.modules))\n{code}"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.splitlines()[-1].split())


def test_the_package_itself_imports_nothing():
    assert not modules_after("import hfsim") & {"click", "numpy", "yaml", "hfsim.output.api", "hfsim.errors"}


def test_help_imports_only_click():
    loaded = modules_after(
        "from hfsim.cli import COMMANDS, app\n"
        "for command in ('', *COMMANDS):\n"
        "    try:\n"
        "        app([*command.split(), '--help'])\n"
        "    except SystemExit:\n"
        "        pass"
    )
    assert "hfsim.commands.run" in loaded
    assert not loaded & {"numpy", "scipy", "matplotlib", "pydantic", "yaml", "logging", "hfsim.deck"}


NOT_NEEDED = {
    *("scipy", "matplotlib", "numpy.ma", "numpy.random", "numpy.testing", "numpy.typing", "numpy._typing._array_like"),
    *("ssl", "http", "multiprocessing", "concurrent", "unittest"),
    *("importlib.metadata", "email", "logging", "shutil"),
    *("hfsim.studies", "hfsim.output.plots", "hfsim.commands.bench", "hfsim.commands.compare"),
    *("hfsim.deck.laws", "hfsim.parts.joints.driver", "hfsim.parts.joints.fixed", "hfsim.parts.forces.force", "hfsim.parts.forces.two_point"),
}
"""Modules that a run without plots and error estimate does without: each of them costs milliseconds."""


def test_a_run_imports_no_more_than_it_needs(tmp_path):
    code = (
        "from hfsim.cli import main\n"
        "sys.argv[1:] = 'run pendulum --set solve.duration=0.02 --no-plots --no-error-estimate -q'.split()\n"
        f"sys.argv += ['-o', {str(tmp_path / 'o')!r}]\n"
        "main()\n"
    )
    loaded = modules_after(code)
    assert "numpy" in loaded
    assert not loaded & NOT_NEEDED


def test_a_run_without_pictures_looks_for_no_edges_of_bodies(tmp_path):
    """That takes a package of 0.1 s; how far bodies reach is known without."""
    deck = tmp_path / "body.yaml"
    deck.write_text(
        "hfsim: 1\nname: body\nsolve: {duration: 0.01}\n"
        "bodies: {b: {type: rigid, mass: 1.0, inertia: [1.0, 1.0, 1.0], points: {p: [1, 0, 0], q: [0, 1, 0], r: [0, 0, 1]}}}\n"
    )
    code = f"from hfsim.cli import main\nsys.argv[1:] = ['run', {str(deck)!r}, '--no-plots', '-q', '-o', {str(tmp_path / 'o')!r}]\nmain()\n"
    loaded = modules_after(code)
    assert "numpy" in loaded and "scipy.spatial" not in loaded


def test_what_stands_in_for_a_module_gives_way_to_it():
    code = (
        "from hfsim.cli import _leave_out\n"
        "_leave_out('pydantic.plugin._loader', get_plugins=tuple)\n"
        "from pydantic.plugin._loader import get_plugins\n"
        "assert get_plugins is tuple\n"
        "stand_in = sys.modules['pydantic.plugin._loader']\n"
        "asked = stand_in.PYDANTIC_ENTRY_POINT_GROUP, sys.modules['pydantic.plugin._loader']\n"
        "assert asked[1] is not stand_in\n"
        "assert asked == (stand_in.PYDANTIC_ENTRY_POINT_GROUP, sys.modules['pydantic.plugin._loader'])\n"
    )
    assert "importlib.metadata" in modules_after(code)


def test_what_libraries_put_off_is_there_when_it_is_asked_for():
    code = (
        "import re, typing, typing_extensions\n"
        "kept = re.compile, typing.TypedDict, typing_extensions.TypedDict\n"
        "from hfsim.commands import import_libraries\n"
        "import_libraries()\n"
        "assert kept == (re.compile, typing.TypedDict, typing_extensions.TypedDict)\n"
        "import yaml\n"
        "found = yaml.safe_load('{a: 1.5, b: 12, c: no, d: 2020-02-01, e: null}')\n"
        "assert list(map(str, found.values())) == ['1.5', '12', 'False', '2020-02-01', 'None']\n"
        "assert yaml.safe_load(yaml.safe_dump(['1.5', 1.5])) == ['1.5', 1.5]\n"
        "try:\n"
        "    yaml.safe_load('\\x00')\n"
        "except yaml.reader.ReaderError:\n"
        "    pass\n"
        "else:\n"
        "    raise AssertionError\n"
    )
    modules_after(code)


def test_a_deck_builds_only_the_classes_it_uses():
    code = (
        "from hfsim.parts.bodies import BeamSpec, RigidSpec\n"
        "from hfsim.scene.loading import load_deck\n"
        f"load_deck({str(ROOT / 'cases' / 'pendulum.yaml')!r})\n"
        "print(*(spec.__name__ for spec in (BeamSpec, RigidSpec) if spec.__pydantic_complete__))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.split() == ["BeamSpec"]


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
    from hfsim.scene.loading import parse_deck
    from hfsim.simulate import simulate

    deck = re.search(r"```yaml\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert deck
    result = simulate(parse_deck(deck.group(1), "readme.yaml", ["solve.duration=0.05"]), error_estimate=False)
    assert result.status == "done"


def test_the_manual_names_all_there_is():
    from hfsim.cli import COMMANDS
    from hfsim.deck.law_specs import LAWS
    from hfsim.integrators import METHODS
    from hfsim.parts.bodies.models import MODELS
    from hfsim.parts.channels import CHANNELS

    pages = (PACKAGE / "manual").glob("*.md")
    text = "\n".join(page.read_text() for page in pages if page.stem != "keys")
    cases = [path.stem for path in (ROOT / "cases").glob("*.yaml")]
    for name in [*METHODS, *MODELS, *LAWS, *cases]:
        assert f"`{name}`" in text, name
    for name in CHANNELS:
        assert f".{name}" in text, name
    for name in COMMANDS:
        assert f"hfsim {name}" in text, name
