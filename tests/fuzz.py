"""Mutants of all shipped decks through `hfsim check`, and others through short runs.

    python tests/fuzz.py --count 10000 --seed 1 --runs 300
    python tests/fuzz.py --replay /tmp/hfsim-fuzz/1-4711.yaml

A fault is what no deck may cause: an internal error, an exit code that is none of the documented ones, a
crash of the interpreter, an endless check, a message without its place, a warning of a library or a control
character on the terminal, a number that is not finite in a file, a file outside the output folder. Each
distinct fault is told once, with the smallest mutant found, which is kept. Seed and number make a mutant.
Exit code 1 where there are faults.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import faulthandler
import json
import math
import os
import random
import re
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
CASES = sorted(path for path in (ROOT / "cases").rglob("*.yaml") if path.stem != "expected")

CHECK_SECONDS = 5
"""CPU time that a check may take; in a fault it is a hang."""
RUN_SECONDS = 60
"""CPU time after which a run is given up; being slow is none of its faults."""
WALL = 6
"""Wall time, in multiples of these, after which a process that does not compute has hung."""
MEMORY = 12 << 30
"""Bytes of address space; SuperLU asks for far more than it uses."""
RENEWED = 400
"""Mutants after which a new process goes on."""
BESIDE = {
    "parts.yaml": b"materials: {steel: {density: 7800, youngs_modulus: 210 GPa}}\nparameters: {a: 2}\n"
    b"include: more.yaml\nground: {points: {there: [1, 0]}}\n",
    "more.yaml": b"parameters: {b: ${a * 2}}\nbodies: {b1: {points: {some: [0.1, 0]}}}\n",
    "table.csv": b"t,torque\n0,0\n0.001,0.1\n0.002,-0.1\n5,0\n100,1\n",
}
"""Files beside each deck; some checks find them spoiled."""


# Mutants ---------------------------------------------------------------------------------------------


class Raw(str):
    """Text that stands in a deck as it is."""


class Map(list[list[Any]]):
    """A map as a list of [key, value], so that keys can be repeated."""


# fmt: off
EDGES: tuple[Any, ...] = (
    0, -1, 1, 0.5, 30, 1e-3, 1e-12, 1e-300, 5e-324, 1e12, 1e15, 1e200, 1.7976931348623157e308, 2**63,
    *map(Raw, ("nan", ".nan", "inf", ".inf", "-.inf", "1e999", "-0.0", "~", "true", "0x" + "f" * 5000)),
    *map(Raw, ("9" * 5000, "-" + "9" * 400, "0o777", "1_000", "12:30", "!!float 1", "!!set {a}", "!x y")),
    "12 mm", "30 deg", "7 GPa", "1e400 m", "1 kg", "9" * 5000 + " m", " " * 3000 + "x", "", " ", "a" * 300,
    "é" * 300, "auto", "ground", "ground.x", "none.tip", "b1", "b1.tip", ".", "..", "../../x", "/tmp/x",
    "a/b", "-rf", "$x_$", "%s{}", "\x1b[31mred", "\x00", "a\nb", "\x7f", "\x9b1m", "\u202eabc", "😀",
    [], [0], [1, 2, 3], [1e200, 1], [[1, 2], [3, 4]], ["a", None], Map(),
    Map([["type", "beam"]]), Map([["x", 1]]),
    "${2 * pi}", "${a}", "${a / (b - b)} mm", "${9**9**9}", "${", "${__import__('os')}", "${1", "${a} ${b}",
    Map([["expression", "a * sin(3 * t)"]]), Map([["expression", "1 / t"]]), Map([["expression", "${a}"]]),
    "parts.yaml", "deck.yaml", "table.csv", Map([["table", "table.csv"]]), Map([["table", "parts.yaml"]]),
    Map([["table", "../x.csv"], ["column", "torque"]]), Map([["table", "/etc/passwd"]]),
    Map([["expression", "exp(exp(9 * t))"], ["start", 0.001]]), Map([["expression", "abs(t - 1) ** 0.5"]]),
)
WORDS = """
    type between length mass inertia points law angle position axis at force stiffness elements
    degree element strain curvature model method step order stages coordinates tolerance duration
    interval channels gravity bodies joints springs loads initial ground times values amplitude
    frequency rate start end damping friction stops lower upper torque velocity on shape table
    preload limit << on 1 b1 root tip t energy
    parameters expression delay include column unit
""".split()  # noqa: SIM905
CHOICES = """
    beam rigid revolute fixed prismatic driver rotational two_point force moment distributed motor
    servo continuum linear lowOrder exact ancf auto gauss radau energy gear generalized_alpha
    explicit frame absolute engineering green none circle tube rectangle constant table sine
    smooth_step spin_up constant_rate gram separated direct
""".split()  # noqa: SIM905
TOKENS = (
    b"\xef\xbb\xbf", b"\x00", b"\xff", b"\x1b[2J", b"\t", b"\r\n", b"\r", b"---\n", b"...\n", b"&a ", b"*a ",
    b"<<: *a\n", b"{", b"}", b"[", b"]", b": ", b"- ", b"? ", b"#", b"'", b'"', b"|\n", b">\n",
    b"%YAML 9.9\n", b"!!python/object:os.system ", "\u2028".encode(), "\u0085".encode(), "😀".encode(),
    b"\xc3", b"9" * 4000,    b" " * 5000, b"a" * 5000, b"\n" * 3000,
)
# fmt: on


class Mutant(NamedTuple):
    """A deck, and how it came about."""

    name: str
    how: str
    data: bytes


def mutant(seed: int, number: int, runs: bool = False) -> Mutant:
    """Return the mutant of a number; those for runs are well-formed and short."""
    rng = random.Random(f"{seed}:{number}:{runs}")
    path = rng.choice(CASES)
    name = f"{seed}-{'run' if runs else ''}{number}"
    if not runs and rng.random() < 0.35:
        change = rng.choice(BYTES)
        return Mutant(name, f"{path.stem}: {change.__name__}", change(rng, path.read_bytes()))
    tree = _tree(path)
    if runs:
        _shorten(tree)
    drawn = [rng.choice(VALUES if runs else TREES) for _ in range(rng.choice((1, 1, 1, 1, 2, 3)))]
    changes = list(dict.fromkeys(drawn))  # what multiplies, twice, makes decks of a gigabyte
    for change in changes:
        change(rng, tree)
    text = "\n".join(_lines(tree)) + "\n"
    names = ", ".join(change.__name__ for change in changes)
    return Mutant(name, f"{path.stem}: {names}", text.encode("utf-8", "surrogatepass"))


def _tree(path: Path) -> Map:
    from hfsim.deck.source import parse_source

    tree = _mapped(parse_source(path.read_text(encoding="utf-8")).data)
    assert isinstance(tree, Map)
    return tree


def _mapped(value: Any) -> Any:
    if isinstance(value, dict):
        return Map([key, _mapped(one)] for key, one in value.items())
    return [_mapped(one) for one in value] if isinstance(value, list) else value


def _shorten(tree: Map) -> None:
    """Let a deck run for a few milliseconds or steps."""
    solve = next(value for key, value in tree if key == "solve")
    shorter = {"duration": 0.004, "max_steps": 60}
    solve[:] = [pair for pair in solve if pair[0] not in ("duration", "step", "budget", "max_steps")]
    solve += [[key, value] for key, value in shorter.items()]
    for key, value in tree:
        if key == "output":
            value[:] = [pair for pair in value if pair[0] != "interval"]


def _places(tree: Any) -> Iterator[tuple[Any, int]]:
    """Yield (list, index) of every value, keys of maps aside."""
    for index, item in enumerate(tree):
        holder, at = (item, 1) if isinstance(tree, Map) else (tree, index)
        yield holder, at
        if isinstance(holder[at], list):
            yield from _places(holder[at])


def _maps(tree: Any) -> list[Map]:
    return [tree, *(holder[at] for holder, at in _places(tree) if isinstance(holder[at], Map) and holder[at])]


def _leaf(rng: random.Random, tree: Map, kind: type | tuple[type, ...] = object) -> tuple[Any, int]:
    places = list(_places(tree))
    fitting = [
        one for one in places if not isinstance(one[0][one[1]], list) and isinstance(one[0][one[1]], kind)
    ]
    return rng.choice(fitting or places or [([["x", 0]], 0)])


def _edge(rng: random.Random) -> Any:
    return copy.deepcopy(rng.choice(EDGES))


def delete(rng: random.Random, tree: Map) -> None:
    here = rng.choice(_maps(tree))
    if here:
        del here[rng.randrange(len(here))]


def duplicate(rng: random.Random, tree: Map) -> None:
    here = rng.choice(_maps(tree))
    if here:
        here.append(list(rng.choice(here)))


def rename(rng: random.Random, tree: Map) -> None:
    here = rng.choice(_maps(tree))
    if here:
        pair = rng.choice(here)
        typo = str(pair[0])[:-1] + rng.choice("xyz")
        pair[0] = rng.choice((typo, typo, rng.choice(WORDS), _edge(rng)))


def edge(rng: random.Random, tree: Map) -> None:
    holder, at = _leaf(rng, tree)
    holder[at] = _edge(rng)


def replace(rng: random.Random, tree: Map) -> None:
    """Put an edge value for any entry, maps and lists among them."""
    holder, at = rng.choice(list(_places(tree)) or [([0, 0], 0)])
    holder[at] = _edge(rng)


def scale(rng: random.Random, tree: Map) -> None:
    holder, at = _leaf(rng, tree, (int, float))
    if isinstance(holder[at], int | float):
        with contextlib.suppress(OverflowError):
            holder[at] = (
                rng.choice((-1.0, 1.0))
                * float(holder[at])
                * 10.0 ** rng.choice((-200, -9, -3, 3, 9, 15, 200))
            )


def shift(rng: random.Random, tree: Map) -> None:
    """Change a number by some decades."""
    holder, at = _leaf(rng, tree, (int, float))
    if isinstance(holder[at], float):
        holder[at] *= 10.0 ** rng.choice((rng.uniform(-2, 2), rng.uniform(-12, 12)))
    elif isinstance(holder[at], int):
        holder[at] += rng.choice((-1, 1, 3))


OPTIONS: dict[str, tuple[Any, ...]] = {
    "method": ("gauss", "radau", "energy", "gear", "generalized_alpha", "explicit"),
    "model": ("rigid", "linear", "lowOrder", "exact", "ancf", "auto"),
    "coordinates": ("frame", "absolute"),
    "elastic_form": ("direct", "separated"),
    "tolerance": (0.1, 1e-3, 1e-12),
    "step": (1e-3, 2e-3, 1e-5),
    "stages": (1, 2, 7),
    "keep_all": (True,),
    "elements": (1, 2, 9),
    "degree": (4, 8, 12),
    "element": ("continuum",),
    "section_degree": (2, 3, 7),
    "strain": ("engineering",),
    "curvature": ("exact",),
    "rotary_inertia": (True,),
}
"""Keys of ``solve`` and, from ``elements`` on, of beams, with values that may go together."""


def option(rng: random.Random, tree: Map) -> None:
    """Give ``solve`` or a beam an option of its own."""
    key = rng.choice(list(OPTIONS))
    beams = [one for one in _maps(tree) if ["type", "beam"] in one]
    solves = [value for name, value in tree if name == "solve" and isinstance(value, Map)]
    ours = beams if list(OPTIONS).index(key) >= list(OPTIONS).index("elements") else solves
    if ours:
        here = rng.choice(ours)
        here[:] = [*(pair for pair in here if pair[0] != key), [key, rng.choice(OPTIONS[key])]]


FORMS = ("{} * a / a", "{} + b", "a + {}", "sqrt({})", "{} ** b", "{} * c", "{}) + (1", "-{}")
"""Expressions that a number may stand in."""


def express(rng: random.Random, tree: Map) -> None:
    """Put expressions in place of some numbers, of parameters that may be wrong."""
    for _ in range(rng.choice((1, 3, 10))):
        holder, at = _leaf(rng, tree, (int, float))
        if isinstance(holder[at], int | float) and not isinstance(holder[at], bool):
            form = rng.choice(FORMS).format(repr(holder[at]))
            holder[at] = "${" + form + "}" + rng.choice(("", "", "", " mm", " deg"))
    first = rng.choice((2, "3 cm", _edge(rng)))
    tree.append(["parameters", Map([["a", first], ["b", "${a * 0}"], ["c", "${a}"]])])


INCLUDED = ("parts.yaml", "more.yaml", "deck.yaml", "table.csv", "none.yaml", "../x.yaml", "/etc/hosts", 3)
"""What a deck may want to include."""


def include(rng: random.Random, tree: Map) -> None:
    """Include other files, which may be spoiled or say what the deck says."""
    names = rng.choices(INCLUDED, k=rng.choice((1, 1, 2, 3)))
    tree.append(["include", names if len(names) > 1 else names[0]])


PIECES = ("t", "2", "sin(9 * t)", "exp(-t)", "abs(t - 0.001)", "1 / (t + 0.1)", "max(0, t)", "log(t)", "t**3")
"""Of laws of time."""


def law(rng: random.Random, tree: Map) -> None:
    """Put a law of time in place of another, of a driver's maybe, or of some entry."""
    laws = [(here, 1) for one in _maps(tree) for here in one if here[0] in ("law", "angle", "position")]
    holder, at = rng.choice(laws or [_leaf(rng, tree)])
    if rng.random() < 0.25:
        more = rng.choice(([], [["column", "torque"]], [["unit", "deg"]]))
        holder[at] = Map([["table", "table.csv"], *more])
        return
    text = rng.choice((" + ", " * ", " / ", " ** ", " - ")).join(rng.choices(PIECES, k=rng.choice((1, 2, 4))))
    start = [["start", rng.choice((0, 1e-3, 5, -1))]] if rng.random() < 0.5 else []
    holder[at] = Map([["expression", text], *start])


def word(rng: random.Random, tree: Map) -> None:
    holder, at = _leaf(rng, tree, str)
    holder[at] = rng.choice(rng.choice((WORDS, CHOICES)))


def swap(rng: random.Random, tree: Map) -> None:
    kind = rng.choice((str, (int, float), object))
    (a, i), (b, k) = _leaf(rng, tree, kind), _leaf(rng, tree, kind)
    a[i], b[k] = b[k], a[i]


def transplant(rng: random.Random, tree: Map) -> None:
    """Put a piece of another deck in place of an entry."""
    source = _tree(rng.choice(CASES))
    (holder, at), (there, index) = (
        rng.choice(list(_places(tree)) or [([0], 0)]),
        rng.choice(list(_places(source))),
    )
    holder[at] = there[index]


def alias(rng: random.Random, tree: Map) -> None:
    holder, at = _leaf(rng, tree)
    other, place = rng.choice(list(_places(tree)) or [([0], 0)])
    holder[at], other[place] = Raw("&a " + _flow(holder[at])), Raw("*a")


def add(rng: random.Random, tree: Map) -> None:
    rng.choice(_maps(tree)).append([rng.choice(WORDS), rng.choice((_edge(rng), rng.choice(CHOICES)))])


def many(rng: random.Random, tree: Map) -> None:
    """Repeat one entry, under new keys or the same, some hundred or thousand times."""
    here = rng.choice(_maps(tree))
    if here:
        key, value = rng.choice(here)
        count, same = rng.choice((100, 3000, 20000)), rng.random() < 0.3
        here += [[key if same else f"{str(key)[:40]}{index}", value] for index in range(count)]


TREES: tuple[Callable[[random.Random, Map], None], ...] = (
    *(edge, edge, edge, scale, scale, scale, rename, replace, word, swap, transplant, alias, add, delete) * 2,
    *(duplicate, word, swap, many, express, express, law, include),
)
VALUES = (*(shift, option) * 4, edge, word, swap, delete, add, transplant, express, law, include)
"""Those that leave a deck that may run."""


def _at(rng: random.Random, data: bytes) -> int:
    return rng.randrange(len(data) + 1)


def truncate(rng: random.Random, data: bytes) -> bytes:
    return data[: _at(rng, data)]


def cut(rng: random.Random, data: bytes) -> bytes:
    start = _at(rng, data)
    return data[:start] + data[start + rng.choice((1, 2, 10, 100)) :]


def double(rng: random.Random, data: bytes) -> bytes:
    start = _at(rng, data)
    piece = data[start : start + rng.choice((5, 50, 500))]
    return data[:start] + piece * rng.choice((2, 2, 50)) + data[start:]


def flip(rng: random.Random, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 3, 30))):
        changed[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def insert(rng: random.Random, data: bytes) -> bytes:
    for _ in range(rng.choice((1, 1, 3))):
        start = _at(rng, data)
        data = data[:start] + rng.choice(TOKENS) + data[start:]
    return data


def encode(rng: random.Random, data: bytes) -> bytes:
    text = data.decode() + rng.choice(("", "# é\n", "name: é\n"))
    return text.encode(
        rng.choice(("utf-16", "utf-32", "latin-1", "utf-8-sig", "utf-16-be", "cp037")), "replace"
    )


def splice(rng: random.Random, data: bytes) -> bytes:
    other = rng.choice(CASES).read_bytes()
    return data[: _at(rng, data)] + other[_at(rng, other) :]


def nest(rng: random.Random, data: bytes) -> bytes:
    """Put brackets or indented maps within one another."""
    depth = rng.choice((30, 200, 3000, 50_000))
    opening, closing = rng.choice(
        ((b"[", b"]"), (b"{a: ", b"}"), (b"[{a: ", b"}]"), (b"- ", b""), (b"? ", b""))
    )
    deep = opening * depth + b"1" + closing * rng.choice((0, depth))
    if rng.random() < 0.2:
        deep = b"".join(b" " * k + b"a:\n" for k in range(1, min(depth, 1500)))
    start = data.find(rng.choice((b":", b"\n"))) + 1
    return rng.choice((deep, data + b"\nx:\n " + deep, data[:start] + b" " + deep + b"\n" + data[start:]))


def multiply(rng: random.Random, data: bytes) -> bytes:
    """Let aliases stand for aliases."""
    count, levels = rng.choice((2, 5, 10, 30)), rng.choice((3, 8, 12, 25))
    opening, item, closing = rng.choice(
        (("[", "*{0}", "]"), ("{{", "k{1}: *{0}", "}}"), ("{{", "<<: [*{0}, *{0}]", "}}"))
    )
    lines = ["x0: &x0 {a: 1, b: [1, 2]}"]
    for level in range(1, levels):
        items = ", ".join(item.format(f"x{level - 1}", k) for k in range(1 if "<<" in item else count))
        lines.append(f"x{level}: &x{level} {opening.format()}{items}{closing.format()}")
    bomb = "\n".join(lines).encode() + b"\n"
    tail = rng.choice(
        (b"", f"materials: *x{levels - 1}\n".encode(), f"bodies:\n  b: *x{levels - 1}\n".encode())
    )
    return rng.choice((bomb + data, bomb + tail, bomb + data + tail))


BYTES = (truncate, cut, double, flip, flip, insert, insert, encode, splice, nest, multiply)


def _flow(value: Any) -> str:
    """Return a value in one line."""
    if isinstance(value, Raw):
        return value
    if isinstance(value, Map):
        return "{" + ", ".join(f"{_flow(key)}: {_flow(one)}" for key, one in value) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, str):
        return value if re.fullmatch(r"[A-Za-z_][\w.-]*", value, re.ASCII) else json.dumps(value)
    return "" if value is None else repr(value).lower()


def _lines(tree: Map, indent: str = "") -> Iterator[str]:
    """Yield a map line by line, entries of top-level maps on lines of their own."""
    for key, value in tree:
        if isinstance(value, Map) and value and len(indent) < 4:
            yield f"{indent}{_flow(key)}:"
            yield from _lines(value, indent + "  ")
        else:
            yield f"{indent}{_flow(key)}: {_flow(value)}"


# Judging ---------------------------------------------------------------------------------------------


class Call(NamedTuple):
    """What a command did: exit code, and what reached the terminal."""

    code: object
    out: str
    err: str


def call(arguments: Sequence[str], folder: Path) -> Call:
    """Run a command in this process, in a folder, as a terminal would see it."""
    from hfsim.cli import app

    with _descriptors() as read, contextlib.chdir(folder):
        try:
            app(list(arguments), prog_name="hfsim")
            code: object = 0
        except SystemExit as stop:
            code = stop.code
        except BaseException:
            import traceback

            traceback.print_exc()
            code = "exception"
    return Call(code, *read)


@contextlib.contextmanager
def _descriptors() -> Iterator[list[str]]:
    """Catch what anything writes to standard output and error, libraries in C among them."""
    texts: list[str] = []
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        kept = [os.dup(1), os.dup(2)]
        streams = sys.stdout, sys.stderr
        sys.stdout, sys.stderr = (open(k, "w", encoding="utf-8", closefd=False) for k in (1, 2))  # noqa: SIM115
        os.dup2(out.fileno(), 1), os.dup2(err.fileno(), 2)
        try:
            yield texts
        finally:
            for stream in (sys.stdout, sys.stderr):
                with contextlib.suppress(ValueError, UnicodeError):
                    stream.flush()
            sys.stdout, sys.stderr = streams
            for k, copy in enumerate(kept, 1):
                os.dup2(copy, k)
                os.close(copy)
            for file in (out, err):
                file.seek(0)
                texts.append(file.read().decode("utf-8", "replace"))


NO_PLACE = ("cannot be read", "the deck is empty")
"""Refusals of a deck as a whole."""


def faults_of(done: Call, codes: Sequence[int]) -> Iterator[str]:
    """Yield what a command may not do, whatever the deck."""
    said = done.out + done.err
    if done.code not in codes:
        yield f"exit code {done.code}"
    if "internal error" in said or "Traceback" in said:
        yield next(
            line
            for line in said.splitlines()
            if "internal error" in line or "Error" in line or "Trace" in line
        )
    for line in said.splitlines():
        if re.search(r"\w*Warning: |\*\* On entry to|DLASCL|Intel MKL", line):
            yield f"warning of a library: {line}"
    if strange := {char for char in said if not char.isprintable() and char != "\n"}:
        yield f"control character {min(strange)!r} on the terminal"
    if len(said) > 100_000:
        yield "more than 100 kB on the terminal"
    for line in done.err.splitlines():
        if (
            ": error: " in line
            and not re.match(r".*?:\d+:\d+: error: ", line)
            and not any(one in line for one in NO_PLACE)
        ):
            yield f"no place: {line}"


def _written(base: Path, deck: Path) -> list[Path]:
    ours = {deck, *(deck.parent / name for name in BESIDE)}
    return [path for path in base.rglob("*") if path.is_file() and path not in ours]


def not_finite(path: Path) -> str:
    """Return what in a file is no finite number."""
    text = path.read_text(encoding="utf-8") if path.suffix in (".csv", ".json", ".yaml") else ""
    if path.suffix == ".json":
        found: list[str] = []
        json.loads(text, parse_constant=found.append)
        return "".join(found[:1])
    if path.suffix == ".csv":
        cells = (cell for line in text.splitlines()[1:] for cell in line.split(","))
        return next((cell for cell in cells if not math.isfinite(float(cell))), "")
    wrong = re.search(r"(?i)[\s\[,][-+]?\.(nan|inf)\b", text)
    return wrong[0].strip() if wrong else ""


def judge(one: Mutant, base: Path, run: bool) -> tuple[object, list[str]]:
    """Return the exit code of a mutant's check or run, and its faults."""
    work = base / "work"
    shutil.rmtree(base, ignore_errors=True)
    work.mkdir(parents=True)
    deck = work / "deck.yaml"
    deck.write_bytes(one.data)
    for name, data in BESIDE.items():
        rng = random.Random(f"{sum(one.data)}{name}")
        spoiled = rng.random() < 0.3 and not run
        (work / name).write_bytes(rng.choice(BYTES)(rng, data) if spoiled else data)
    plots = [] if sum(one.data) % 8 == 0 else ["--no-plots"]
    done = call(["run", *plots, "deck.yaml"] if run else ["check", "deck.yaml"], work)
    faults = list(faults_of(done, (0, 2, 3, 4, 5) if run else (0, 2)))
    files = _written(base, deck)
    folders = {path.relative_to(work).parts[0] if path.is_relative_to(work) else str(path) for path in files}
    if (not run and files) or len(folders) > 1 or any(not one.endswith(".out") for one in folders):
        faults.append(f"wrote {sorted(folders)[0]}")
    faults += [f"{path.name}: {wrong}" for path in files if (wrong := not_finite(path))]
    if any("internal error" in fault for fault in faults):
        faults = [*(fault for fault in faults if not fault.startswith("exit")), _trace(work, run)]
    return done.code, faults


def _trace(work: Path, run: bool) -> str:
    """Return where in hfsim an internal error comes from."""
    os.environ["HFSIM_DEBUG"] = "1"
    done = call(["run", "--force", "--no-plots", "deck.yaml"] if run else ["check", "deck.yaml"], work)
    del os.environ["HFSIM_DEBUG"]
    frames = re.findall(r'File ".*?/hfsim/([\w/]+\.py)", line (\d+)', done.err)
    return "at " + ":".join(frames[-1]) if frames else ""


# Processes -------------------------------------------------------------------------------------------


class Found(NamedTuple):
    """The verdict on one mutant."""

    number: int
    code: object
    faults: list[str]
    cpu: float


def verdicts(numbers: Sequence[int], make: Callable[[int], Mutant], run: bool, base: Path) -> Iterator[Found]:
    """Judge mutants in a process of their own, which is replaced when it dies or hangs."""
    left = list(numbers)
    while left:
        batch = left[:RENEWED]
        begun, before = -1, len(left)
        for message in _in_child(batch, make, run, base):
            if isinstance(message, Found):
                left.remove(message.number)
                begun = -1
                yield message
            elif isinstance(message, int):
                begun = message
            elif begun >= 0:
                left.remove(begun)
                given_up = run and message == _TOO_LONG
                yield Found(
                    begun, "given up" if given_up else message, [] if given_up else [message], CHECK_SECONDS
                )
            else:
                raise RuntimeError(f"the process ended: {message}")
        if len(left) == before:
            raise RuntimeError("the process ended before it judged anything")


_TOO_LONG = "endless"


def _in_child(
    batch: list[int], make: Callable[[int], Mutant], run: bool, base: Path
) -> Iterator[Found | int | str]:
    reading, writing = os.pipe()
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        os.close(reading)
        with contextlib.suppress(BaseException):
            _judge_all(batch, make, run, base, writing)
        os._exit(0)
    os.close(writing)
    patience = WALL * (RUN_SECONDS if run else CHECK_SECONDS)
    ended, rest = "", b""
    try:
        # a buffered reader would keep back what `select` then waits for
        while True:
            if not select.select([reading], [], [], patience)[0]:
                ended = _TOO_LONG
                break
            data = os.read(reading, 65536)
            if not data:
                break
            *lines, rest = (rest + data).split(b"\n")
            for said in map(json.loads, lines):
                yield said if isinstance(said, int) else Found(*said)
    finally:
        os.close(reading)
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
        status = os.waitpid(child, 0)[1]
    if not ended and os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        ended = (
            _TOO_LONG
            if number == signal.SIGXCPU
            else f"crash of the interpreter: {signal.Signals(number).name}"
        )
    if ended and ended != "crash of the interpreter: SIGKILL":
        yield ended


def _judge_all(batch: list[int], make: Callable[[int], Mutant], run: bool, base: Path, writing: int) -> None:
    faulthandler.disable()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.showwarning = lambda *said: sys.stderr.write(warnings.formatwarning(*said[:4]))  # type: ignore[assignment]
    warnings.simplefilter("always", UserWarning)
    warnings.simplefilter("always", RuntimeWarning)
    with open(writing, "w", encoding="utf-8") as pipe:
        for number in batch:
            # what the mutant before was allowed does not bind the making of this one
            resource.setrlimit(resource.RLIMIT_CPU, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
            one = make(number)
            pipe.write(f"{number}\n")
            pipe.flush()
            begin = time.process_time()
            allowed = math.ceil(begin + (RUN_SECONDS if run else CHECK_SECONDS))
            resource.setrlimit(resource.RLIMIT_CPU, (allowed, resource.RLIM_INFINITY))
            code, faults = judge(one, base, run)
            cpu = time.process_time() - begin
            if not run and cpu > CHECK_SECONDS:
                faults.append(_TOO_LONG)
            pipe.write(json.dumps([number, code if isinstance(code, int) else str(code), faults, cpu]) + "\n")
            pipe.flush()


# The command -----------------------------------------------------------------------------------------


def kind_of(faults: Sequence[str]) -> str:
    """Return what mutants with the same fault have in common."""
    return " | ".join(re.sub(r"\d+(\.\d+)?(e[-+]?\d+)?|'[^']*'", "#", fault)[:160] for fault in faults)


class Report:
    """Counts, and of each distinct fault the smallest mutant."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.codes: Counter[str] = Counter()
        self.kinds: Counter[str] = Counter()
        self.smallest: dict[str, tuple[Mutant, list[str]]] = {}
        self.slowest = (0.0, -1)

    def add(self, found: Found, make: Callable[[int], Mutant], run: bool) -> None:
        self.codes[f"{'run' if run else 'check'} {found.code}"] += 1
        if not run:
            self.slowest = max(self.slowest, (found.cpu, found.number))
        if not found.faults:
            return
        kind, one = kind_of(found.faults), make(found.number)
        if not self.kinds[kind]:
            print(f"{one.name}: {'; '.join(found.faults)[:300]!a}", file=sys.stderr)
        self.kinds[kind] += 1
        if kind not in self.smallest or len(one.data) < len(self.smallest[kind][0].data):
            self.smallest[kind] = one, found.faults

    def tell(self) -> None:
        for code, count in sorted(self.codes.items()):
            print(f"  {count:6d}  {code}")
        print(f"  slowest check: {self.slowest[0]:.2f} s of CPU, mutant {self.slowest[1]}")
        print(f"{sum(self.kinds.values())} mutants with faults, {len(self.kinds)} distinct")
        for kind, count in self.kinds.most_common():
            one, faults = self.smallest[kind]
            self.folder.mkdir(parents=True, exist_ok=True)
            file = self.folder / f"{one.name}.yaml"
            file.write_bytes(one.data)
            print(f"- {count} x {'; '.join(fault[:300] for fault in faults)!a}")
            print(f"    {one.how}; {len(one.data)} bytes: {file}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=1000, help="mutants through the check")
    parser.add_argument("--runs", type=int, default=0, help="mutants through short runs")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path, default=Path(tempfile.gettempdir()) / "hfsim-fuzz")
    parser.add_argument(
        "--replay", type=Path, nargs="+", default=[], metavar="FILE", help="judge these again instead"
    )
    options = parser.parse_args()
    sys.exit(1 if fuzz(options) else 0)


def fuzz(options: argparse.Namespace) -> int:
    """Judge mutants, print the report, and return how many have faults."""
    import hfsim.commands.check
    import hfsim.commands.run
    import hfsim.simulate  # noqa: F401 (so that every child has it)

    report = Report(options.output)
    with tempfile.TemporaryDirectory() as place:
        for run, count in ((False, options.count), (True, options.runs)):
            numbers: Sequence[int] = range(count)
            make: Callable[[int], Mutant] = lambda number, run=run: mutant(options.seed, number, run)  # noqa: E731
            if options.replay:
                chosen = [path for path in options.replay if ("run" in path.stem) == run]
                numbers, make = range(len(chosen)), lambda k, chosen=chosen: _again(chosen[k])
            for found in verdicts(numbers, make, run, Path(place) / "base"):
                report.add(found, make, run)
    report.tell()
    return sum(report.kinds.values())


def _again(path: Path) -> Mutant:
    return Mutant(path.stem, "replayed", path.read_bytes())


if __name__ == "__main__":
    main()
