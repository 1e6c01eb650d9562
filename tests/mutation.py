"""Break one factor, sign, index or comparison of the mechanics and see which test turns red.

    python tests/mutation.py --sample 40 --seed 1

Works in copies of the tree, never in the tree itself.  Which tests run a line is measured once by `coverage`
(``pip install -e '.[dev]'``) and kept in a temporary file by the hash of the tree.  A mutant is shown to the
quickest of them first, until one is red twice; a test that takes far longer than it should is red too.  After
those that run the line come their neighbours in the same files, which may share what the first of them made.
Numbers with an exponent, such as 1e-12, and bare numbers with a name of their own are tolerances and limits:
choices, not mechanics.  Mutants proven equivalent stand, with the reason, in ``mutation_equivalent.yaml``.

Exit code 4 if fewer than 95 % (``--least 0.95``) are caught or proven equivalent.
"""

import argparse
import ast
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NamedTuple

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent
MECHANICS = (
    *("hfsim/maths", "hfsim/mechanics", "hfsim/integrators", "hfsim/parts"),
    *("hfsim/deck/laws.py", "hfsim/deck/materials.py", "hfsim/scene/start.py", "hfsim/scene/build.py"),
)
LEAST_CAUGHT = 0.95
PATIENCE = 5.0
"""A test may take so many times its time, and as many seconds more, before it counts as hanging."""
FIRST = 25
"""Tests that a mutant meets first; most are caught by one of them, and few files have to be read."""
OUTSIDE = ("test_architecture.py", "test_totality.py", "studies", "commands", "output", "benchmarks")
"""In tests/, what takes most of the time and says least of the mechanics: mutants do not meet it."""


# Mutants ---------------------------------------------------------------------------------------------


class Mutant(NamedTuple):
    """One change of one file: its text from `start` to `end`, in bytes, is replaced.

    What runs its `line` runs the `first` line of the statement too, and coverage may have seen that only.
    """

    file: str
    first: int
    line: int
    start: int
    end: int
    text: str
    in_function: bool

    def applied(self, source: bytes) -> bytes:
        return source[: self.start] + self.text.encode() + source[self.end :]

    def shown(self, source: bytes) -> tuple[str, str]:
        """Return the changed line before and after."""
        first = source.rfind(b"\n", 0, self.start) + 1
        last = source.find(b"\n", self.end)
        tail = source[self.end : last].decode()
        before = source[first:last].decode()
        after = source[first : self.start].decode() + self.text + tail
        return tuple(" ".join(text.split()) for text in (before, after))


OPPOSITE = {
    **{ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*")},
    **{ast.Lt: ("<", ">="), ast.GtE: (">=", "<"), ast.Gt: (">", "<="), ast.LtE: ("<=", ">")},
    **{ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="), ast.Is: ("is", "is not"), ast.IsNot: ("is not", "is")},
    **{ast.In: ("in", "not in"), ast.NotIn: ("not in", "in")},
}
EDGE = {ast.Lt: ("<", "<="), ast.GtE: (">=", ">"), ast.Gt: (">", ">="), ast.LtE: ("<=", "<")}
"""Off by one: only where a whole number is compared with, for no real number hits its bound."""
NOT_MECHANICS = (ast.Raise, ast.Assert, ast.JoinedStr, ast.arg, ast.Import, ast.ImportFrom)


class Breaker:
    """Finds all that can be broken in one file."""

    def __init__(self, file: str, source: bytes) -> None:
        self.file, self.source = file, source
        lines = source.splitlines(keepends=True)
        self.offsets = [0]
        for line in lines:
            self.offsets.append(self.offsets[-1] + len(line))

    def mutants(self) -> Iterator[Mutant]:
        yield from self._inside(ast.parse(self.source), 1, in_function=False)

    def _inside(self, node: ast.AST, first: int, in_function: bool) -> Iterator[Mutant]:
        first = node.lineno if isinstance(node, ast.stmt) else first
        for child in ast.iter_child_nodes(node):
            if isinstance(child, NOT_MECHANICS) or _is_bare_number(node, child) or _is_typing(node, child):
                continue
            for start, end, text in self._broken(child):
                mutant = Mutant(self.file, first, child.lineno, start, end, text, in_function)
                if _compiles(mutant.applied(self.source)):
                    yield mutant
            if isinstance(child, ast.UnaryOp) and isinstance(child.operand, ast.Constant):
                continue
            inner = in_function or isinstance(child, ast.FunctionDef | ast.Lambda)
            yield from self._inside(child, first, inner)

    def _broken(self, node: ast.AST) -> Iterator[tuple[int, int, str]]:
        if isinstance(node, ast.Constant):
            yield from self._number(node, node.value)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            start, end = self._span(node)
            if isinstance(node.operand, ast.Constant) and isinstance(node.operand.value, int):
                yield start, end, str(-node.operand.value - 1)
            else:
                yield start, start + 1, "+"
        elif isinstance(node, ast.BinOp):
            yield from self._operator(node.left, node.right, node.op, OPPOSITE)
            if isinstance(node.op, ast.Sub | ast.Div | ast.MatMult | ast.Pow):
                yield self._swapped(node)
        elif isinstance(node, ast.AugAssign):
            yield from self._operator(node.target, node.value, node.op, OPPOSITE)
        elif isinstance(node, ast.Compare) and len(node.ops) == 1:
            yield from self._operator(node.left, node.comparators[0], node.ops[0], OPPOSITE)
            if any(_is_whole(side) for side in (node.left, node.comparators[0])):
                yield from self._operator(node.left, node.comparators[0], node.ops[0], EDGE)
        elif isinstance(node, ast.Slice):
            for bound in (node.lower, node.upper):
                if bound is not None and not isinstance(bound, ast.Constant | ast.UnaryOp):
                    start, end = self._span(bound)
                    yield end, end, " + 1"

    def _number(self, node: ast.Constant, value: object) -> Iterator[tuple[int, int, str]]:
        start, end = self._span(node)
        if isinstance(value, bool) or b"e" in self.source[start:end]:
            return
        if isinstance(value, int):
            yield start, end, str(value + 1)
        elif isinstance(value, float):
            yield start, end, repr(2.0 * value or 1.0)

    def _operator(
        self, left: ast.AST, right: ast.AST, op: ast.AST, table: dict[type, tuple[str, str]]
    ) -> Iterator[tuple[int, int, str]]:
        if type(op) in table:
            old, new = (text.encode() for text in table[type(op)])
            start, end = self._span(left)[1], self._span(right)[0]
            gap = self.source[start:end]
            if gap.count(old) == 1:
                yield start, end, gap.replace(old, new).decode()

    def _swapped(self, node: ast.BinOp) -> tuple[int, int, str]:
        start, end = self._span(node)
        text = ast.unparse(ast.BinOp(left=node.right, op=node.op, right=node.left))
        return start, end, f"({text})"

    def _span(self, node: ast.AST) -> tuple[int, int]:
        return (
            self.offsets[node.lineno - 1] + node.col_offset,
            self.offsets[node.end_lineno - 1] + node.end_col_offset,
        )


def _is_bare_number(parent: ast.AST, child: ast.AST) -> bool:
    """Whether a module gives a plain number a name: a tolerance, a limit, a size."""
    return isinstance(parent, ast.Module) and (
        isinstance(child, ast.Assign | ast.AnnAssign) and isinstance(child.value, ast.Constant)
    )


def _is_whole(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, int)


def _is_typing(parent: ast.AST, child: ast.AST) -> bool:
    """Whether it is an annotation, a decorator or for type checkers only."""
    if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test):
        return True
    annotation = child is getattr(parent, "annotation", None) or child is getattr(parent, "returns", None)
    return annotation or child in getattr(parent, "decorator_list", ())


def _compiles(source: bytes) -> bool:
    try:
        compile(source, "mutant", "exec")
    except (SyntaxError, ValueError):
        return False
    return True


def mutants_of(root: Path, only: str = "") -> list[Mutant]:
    """Return all mutants of the mechanics, or of the files whose path contains some text."""
    found = []
    for entry in MECHANICS:
        for path in [root / entry] if entry.endswith(".py") else sorted((root / entry).rglob("*.py")):
            file = path.relative_to(root).as_posix()
            if path.exists() and only in file:
                found += Breaker(file, path.read_bytes()).mutants()
    return found


# Which tests run a line ------------------------------------------------------------------------------


class Tests(NamedTuple):
    """What is known of the tests.

    Attributes
    ----------
    seconds : dict of str to float
        CPU time of each green test.
    lines : dict of str to dict of str to list of str
        Of each file and line, the tests that run it, or the test files that do while they are read.
    """

    seconds: dict[str, float]
    lines: dict[str, dict[str, list[str]]]

    def of(self, mutant: Mutant) -> list[str]:
        """Return the tests to run, those that run the line before their neighbours, the quickest first."""
        lines = self.lines.get(mutant.file, {})
        if mutant.in_function:
            span = range(mutant.first, mutant.line + 1)
            names = {name for line in span for name in lines.get(str(line), ())}
        else:
            names = {name for tests in lines.values() for name in tests}
        files = {name.split("::")[0] for name in names}
        direct = {test for test in self.seconds if test in names or test.split("::")[0] in names}
        near = {test for test in self.seconds if test.split("::")[0] in files} - direct
        return [test for group in (direct, near) for test in sorted(group, key=self.seconds.__getitem__)]


class Mapper:
    """Plugin: tells coverage which test runs, and notes how long each takes."""

    def __init__(self, cov: Any) -> None:
        self.cov, self.seconds, self.red = cov, {}, set()

    def pytest_make_collect_report(self, collector: Any) -> None:
        self.cov.switch_context(collector.nodeid.split("::")[0])

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: Any) -> Iterator[None]:
        _clear_caches()
        self.cov.switch_context(item.nodeid)
        start = time.process_time()
        yield
        self.seconds[item.nodeid] = time.process_time() - start

    @pytest.hookimpl(hookwrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any, request: Any) -> Iterator[None]:
        shared = fixturedef.scope != "function"
        item = getattr(request, "_pyfuncitem", None)
        if shared and item is not None:
            self.cov.switch_context(item.nodeid.split("::")[0])
        yield
        if shared and item is not None:
            self.cov.switch_context(item.nodeid)

    def pytest_runtest_logreport(self, report: Any) -> None:
        if not report.passed:
            self.red.add(report.nodeid)


def _clear_caches() -> None:
    """Let each test run what it uses, though an earlier one has done so."""
    for name, module in list(sys.modules.items()):
        if name.startswith("hfsim"):
            for value in list(vars(module).values()):
                if hasattr(value, "cache_clear"):
                    value.cache_clear()


def map_files(files: Sequence[str], out: str) -> None:
    """Run some test files under coverage and write what they run; in a process of its own."""
    import coverage

    mechanics = [one if one.endswith(".py") else f"{one}/*" for one in MECHANICS]
    cov = coverage.Coverage(data_file=f"{out}.coverage", include=mechanics)
    cov.start()
    plugin = Mapper(cov)
    pytest.main([*files, *_OPTIONS], plugins=[plugin])
    cov.stop()
    data = cov.get_data()
    lines: dict[str, dict[str, list[str]]] = {}
    for path in data.measured_files():
        file = Path(path).relative_to(Path.cwd()).as_posix()
        found = data.contexts_by_lineno(path).items()
        lines[file] = {str(n): sorted({*tests} - {""}) for n, tests in found}
    seconds = {test: s for test, s in plugin.seconds.items() if test not in plugin.red}
    Path(out).write_text(json.dumps({"seconds": seconds, "lines": lines}))


_OPTIONS = ("-q", "-m", "not slow and not timed", "-p", "no:cacheprovider", "-p", "no:xdist", "--tb=no")


def tests_of(root: Path, jobs: int) -> Tests:
    """Return the map of a tree, measured if that was not done before."""
    store = Path(tempfile.gettempdir()) / f"hfsim-mutation-{_digest(root)}.json"
    if not store.exists():
        print("measuring which tests run which lines (once for this state of the tree) ...", flush=True)
        with tempfile.TemporaryDirectory() as folder:
            tree = _copy(root, Path(folder) / "tree")
            files = [f.relative_to(tree).as_posix() for f in _test_files(tree)]
            # the longest files are not the slowest, but spread over the processes they do no harm
            files.sort(key=lambda f: -(tree / f).stat().st_size)
            parts = [(files[k::jobs], f"{folder}/{k}.json") for k in range(jobs)]
            with ThreadPoolExecutor(jobs) as pool:
                done = [pool.submit(_python, tree, "map_files", *part) for part in parts]
            for one in done:
                one.result().check_returncode()
            seconds, lines = {}, defaultdict(lambda: defaultdict(list))
            for _, out in parts:
                found = json.loads(Path(out).read_text())
                seconds |= found["seconds"]
                for file, by_line in found["lines"].items():
                    for line, tests in by_line.items():
                        lines[file][line] += tests
        store.write_text(json.dumps({"seconds": seconds, "lines": lines}))
    return Tests(**json.loads(store.read_text()))


def _test_files(root: Path) -> list[Path]:
    """Return the files with tests: those of tests/, and of the package those with examples."""
    examples = [path for path in (root / "hfsim").rglob("*.py") if ">>>" in path.read_text()]
    tests = (path for path in (root / "tests").rglob("test_*.py") if not _looks_from_outside(root, path))
    return sorted(tests) + sorted(examples)


def _looks_from_outside(root: Path, path: Path) -> bool:
    return path.relative_to(root / "tests").parts[0] in OUTSIDE


def _digest(root: Path) -> str:
    found = hashlib.sha256()
    for folder in ("hfsim", "tests"):
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in (".py", ".yaml") and not path.name.startswith("mutation"):
                found.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    return found.hexdigest()[:16]


def _copy(root: Path, to: Path) -> Path:
    leave = shutil.ignore_patterns(".git", ".venv", "__pycache__", ".*_cache", "*.out", "*.egg-info", "build")
    shutil.copytree(root, to, symlinks=True, ignore=leave)
    return to


def _python(
    tree: Path, function: str, *arguments: object, limit: float | None = None
) -> subprocess.CompletedProcess[str]:
    """Call a function of this file in a process of its own, in a tree; a hang raises `TimeoutExpired`."""
    env = os.environ | {"PYTHONPATH": f"{tree}{os.pathsep}{tree / 'tests'}", "PYTHONDONTWRITEBYTECODE": "1"}
    env |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    code = f"import json, sys, mutation\nmutation.{function}(*json.loads(sys.argv[1]))"
    command = [sys.executable, "-c", code, json.dumps(arguments)]
    with subprocess.Popen(
        command, cwd=tree, env=env, text=True, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    ) as process:  # fmt: skip
        try:
            said, _ = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            raise
    return subprocess.CompletedProcess(command, process.returncode, said)


# One mutant ------------------------------------------------------------------------------------------


class Judge:
    """Plugin: runs the tests asked for in their order, each within its time; notes the first red one."""

    def __init__(self, seconds: dict[str, float]) -> None:
        self.seconds, self.red = seconds, ""

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        place = {name: k for k, name in enumerate(self.seconds)}
        items[:] = sorted((one for one in items if one.nodeid in place), key=lambda one: place[one.nodeid])

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: Any) -> Iterator[None]:
        signal.signal(signal.SIGVTALRM, _hangs)
        signal.setitimer(signal.ITIMER_VIRTUAL, PATIENCE * (1.0 + self.seconds[item.nodeid]))
        yield
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed:
            self.red = self.red or report.nodeid

    def pytest_collectreport(self, report: Any) -> None:
        if report.failed:
            self.red = self.red or report.nodeid


def _hangs(number: int, frame: object) -> None:
    pytest.fail("takes far longer than without the change")


def judge(seconds: dict[str, float], out: str) -> None:
    """Run tests until one is red and write its name; in a process of its own."""
    plugin = Judge(seconds)
    files = list(dict.fromkeys(name.split("::")[0] for name in seconds))
    pytest.main([*files, *_OPTIONS, "-x"], plugins=[plugin])
    Path(out).write_text(plugin.red)


def caught_by(tree: Path, mutant: Mutant, tests: Tests, seconds: float) -> tuple[str, int, int]:
    """Return the test that turns red, empty if none does, how many were run and how many could have been."""
    path, names = tree / mutant.file, tests.of(mutant)
    source = path.read_bytes()
    path.write_bytes(mutant.applied(source))
    affordable, spent = 0, 0.0
    for name in names:
        spent += tests.seconds[name]
        affordable += spent <= seconds or affordable < FIRST
    try:
        for group in (names[:FIRST], names[FIRST:affordable]):
            red = _red(tree, {name: tests.seconds[name] for name in group}) if group else ""
            again = {red: tests.seconds[red]} if red in tests.seconds else {}
            if red and (not again or _red(tree, again)):
                return red, affordable, len(names)
    finally:
        path.write_bytes(source)
    return "", affordable, len(names)


def _red(tree: Path, seconds: dict[str, float]) -> str:
    out = tree.parent / f"{tree.name}.red"
    out.unlink(missing_ok=True)
    limit = 60.0 + 4.0 * PATIENCE * (len(seconds) ** 0.5 + sum(seconds.values()))
    try:
        _python(tree, "judge", seconds, str(out), limit=limit)
    except subprocess.TimeoutExpired:
        return "a hang"
    return out.read_text() if out.exists() else "a crash of the interpreter"


# All of them -----------------------------------------------------------------------------------------

EQUIVALENT = "tests/mutation_equivalent.yaml"


def equivalents(root: Path) -> dict[tuple[str, str], str]:
    """Return why mutants, by the line before and after, cannot be told from the program."""
    entries = yaml.safe_load((root / EQUIVALENT).read_text()) or []
    return {(one["before"], one["after"]): one["why"] for one in entries}


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge a sample of mutants and tell of each what became of it; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--sample", type=int, default=40, help="number of mutants")
    parser.add_argument("--seed", type=int, default=1, help="of the choice among all mutants")
    parser.add_argument("--jobs", type=int, choices=(1, 2), default=2, help="processes at a time")
    parser.add_argument("--file", default="", help="only files whose path contains this")
    parser.add_argument("--seconds", type=float, default=60.0, help="CPU time of tests for a mutant")
    parser.add_argument("--least", type=float, default=LEAST_CAUGHT, help="share that must be caught")
    chosen = parser.parse_args(arguments)
    try:
        import coverage  # noqa: F401
    except ImportError:
        print("coverage is needed: pip install -e '.[dev]'", file=sys.stderr)
        return 2
    every = mutants_of(ROOT, chosen.file)
    sample = random.Random(chosen.seed).sample(every, min(chosen.sample, len(every)))
    tests, known = tests_of(ROOT, chosen.jobs), equivalents(ROOT)
    counts = Counter[str]()
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(chosen.jobs) as pool:
        trees: SimpleQueue[Path] = SimpleQueue()
        for k in range(chosen.jobs):
            trees.put(_copy(ROOT, Path(folder) / str(k)))

        def verdict(mutant: Mutant) -> tuple[str, str]:
            before, after = shown = mutant.shown((ROOT / mutant.file).read_bytes())
            head = f"{mutant.file}:{mutant.line}: {before} -> {after}"
            if shown in known:
                return "equivalent", f"{head}\n    equivalent: {known[shown]}"
            tree, start = trees.get(), time.perf_counter()
            try:
                red, run, covering = caught_by(tree, mutant, tests, chosen.seconds)
            finally:
                trees.put(tree)
            took = f"{time.perf_counter() - start:.0f} s"
            if red:
                return "caught", f"{head}\n    caught by {red} ({took})"
            return "survived", f"{head}\n    SURVIVED {run} of {covering} tests ({took})"

        for kind, text in pool.map(verdict, sample):
            counts[kind] += 1
            print(text, flush=True)
    good = counts["caught"] + counts["equivalent"]
    words = ", ".join(f"{counts[kind]} {kind}" for kind in ("caught", "equivalent", "survived"))
    print(f"{len(sample)} of {len(every)} mutants: {words}")
    return 0 if good >= chosen.least * len(sample) else 4


if __name__ == "__main__":
    sys.exit(main())
