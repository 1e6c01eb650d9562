"""Motion for ParaView, read back as its format says, and held against the channels."""

import base64
import csv
import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from called import call

from hfsim.output import paraview

DECKS = {
    "space": """
hfsim: 1
name: "top & <tail>"
gravity: [0.0, 0.0, -9.81]
materials: {rubber: {density: 1100.0, youngs_modulus: 5.0e6}}
sections: {round: {area: 1.0e-4, second_moment: 1.0e-9}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: [0.1, 0.2, 0.25], points: {a: [0.4, 0, 0.1]}}
  whip: {type: beam, element: cable, material: rubber, section: round, length: 0.5, elements: 2}
joints: {ball: {type: spherical, between: [hub.a, whip.root]}}
initial: {hub: {position: [0, 0, 0], velocity: [0, 1, 2], angular_velocity: [0.1, 12, 0.1]}}
solve: {duration: 0.05, tolerance: 1.0e-5}
output: {interval: 0.01, channels: [hub.x, hub.y, hub.z, whip.tip.x, whip.tip.y, whip.tip.z]}
""",
    "plane": """
hfsim: 1
name: swing
gravity: [0.0, -9.81]
bodies:
  alone: {type: rigid, mass: 1.0, inertia: 1.0}
  bar: {type: rigid, mass: 1.0, inertia: 1.0, points: {end: [0.5, 0.1]}}
joints: {pin: {type: revolute, between: [ground, bar]}}
initial: {alone: {position: [0, 1], velocity: [1, 0]}, bar: {angular_velocity: 3}}
solve: {duration: 0.05, tolerance: 1.0e-5}
output: {interval: 0.01, channels: [alone.x, alone.y, bar.end.x, bar.end.y]}
""",
}
KINDS = {"Float64": "<f8", "Int64": "<i8", "UInt8": "<u1"}


@pytest.fixture
def series(request, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("deck.yaml").write_text(DECKS[request.param], "utf-8")
    return go()


def go(*options):
    done = call("run", "deck.yaml", "--vtk", "--no-plots", "-o", "out", *options)
    assert done.exit_code == 0, done.output
    return sorted(Path("out").glob("*.pvd"))[0]


def numbers(element):
    data = base64.b64decode(element.text)
    assert int.from_bytes(data[:8], "little") == len(data) - 8
    values = np.frombuffer(data[8:], KINDS[element.get("type")])
    width = element.get("NumberOfComponents")
    return values.reshape(-1, int(width)) if width else values


def arrays(path):
    root = ElementTree.parse(path).getroot()
    assert root.get("header_type") == "UInt64" and root.get("byte_order") == "LittleEndian"
    return root, {one.get("Name"): one for one in root.iter("DataArray")}


def rows():
    with Path("out/history.csv").open() as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def steps(listed):
    root = ElementTree.parse(listed).getroot()
    return [(float(one.get("timestep")), Path("out") / one.get("file")) for one in root.iter("DataSet")]


@pytest.mark.parametrize(
    ("series", "ends"),
    [("space", {0: "hub", 2: "whip.tip"}), ("plane", {0: "alone", 1: "bar.end"})],
    indirect=["series"],
)
def test_points_are_those_of_the_channels(series, ends):
    found, first = steps(series), None
    assert [time for time, _ in found] == [row["t"] for row in rows()]
    for (time, path), row in zip(found, rows(), strict=True):
        root, named = arrays(path)
        points, moved = numbers(named["points"]), numbers(named["displacement"])
        assert numbers(named["TimeValue"]).tolist() == [time]
        first = points if first is None else first
        assert np.array_equal(moved, points - first)
        piece = root.find(".//Piece")
        assert (int(piece.get("NumberOfPoints")), int(piece.get("NumberOfCells"))) == (len(points), 2)
        last = numbers(named["offsets"]) - 1
        places = {0: points[0], 1: points[last[1]], 2: points[last[1]]}
        for place, subject in ends.items():
            wanted = [row.get(f"{subject}.{axis}", 0.0) for axis in "xyz"]
            assert places[place] == pytest.approx(wanted, abs=1e-15)


@pytest.mark.parametrize(
    ("series", "names", "kinds"),
    [("space", ["hub", "whip"], [4, 4]), ("plane", ["alone", "bar"], [1, 4])],
    indirect=["series"],
)
def test_bodies_are_lines_with_number_and_name(series, names, kinds):
    _, named = arrays(steps(series)[-1][1])
    count = len(numbers(named["points"]))
    assert numbers(named["connectivity"]).tolist() == list(range(count))
    assert numbers(named["offsets"])[-1] == count
    assert numbers(named["types"]).tolist() == kinds
    assert numbers(named["body"]).tolist() == [0, 1]
    told = bytes(map(int, named["name"].text.split())).decode()
    assert told == "".join(f"{name}\0" for name in names)


@pytest.mark.parametrize("series", ["space"], indirect=True)
def test_forces_along_beams_are_those_of_the_channels(series):
    wanted = ["axial_force", "shear_force_y", "shear_force_z", "bending_moment_y", "bending_moment_z"]
    channels = ", ".join(f"whip.{end}.{name}" for end in ("root", "tip") for name in wanted)
    found = steps(go("--force", "--set", f"output.channels=[{channels}]"))
    for (_, path), row in zip(found, rows(), strict=True):
        _, named = arrays(path)
        first, last = numbers(named["offsets"])[-2:] - [0, 1]
        for name in wanted:
            values = numbers(named[name])
            ends = row[f"whip.root.{name}"], row[f"whip.tip.{name}"]
            assert (values[first], values[last]) == pytest.approx(ends, rel=1e-12, abs=1e-12)
            assert not values[:first].any()
    assert "torsion_moment" in named and "stress" not in named  # the section has no shape
    assert abs(row["whip.root.axial_force"]) > 1e-3


@pytest.mark.parametrize("series", ["space"], indirect=True)
def test_files_are_listed_and_go_with_their_run(series):
    listed = json.loads(Path("out/summary.json").read_text())["files"]
    written = [path.relative_to("out").as_posix() for _, path in steps(series)]
    assert set(listed) >= {*written, series.name} and len(written) == 6
    Path("out/vtk/mine.vtu").write_text("mine")
    go("--force", "--set", "name=other")
    left = sorted(path.name for path in Path("out/vtk").iterdir())
    assert left == ["mine.vtu", *(f"other_{k:04}.vtu" for k in range(1, 7))]
    assert [path.name for path in Path("out").glob("*.pvd")] == ["other.pvd"]


@pytest.mark.parametrize("series", ["space"], indirect=True)
def test_what_cannot_be_written_is_not_there_and_costs_no_results(series, monkeypatch):
    def full(kind, parts):
        if kind == "Collection":
            raise OSError(28, "No space left on device")
        return document(kind, parts)

    document = paraview._document
    monkeypatch.setattr(paraview, "_document", full)
    done = call("run", "deck.yaml", "--vtk", "--no-plots", "-o", "out", "--force")
    summary = json.loads(Path("out/summary.json").read_text())
    assert (done.exit_code, summary["status"]) == (1, "done")
    assert summary["warnings"][-1].startswith("the files for ParaView were not written: ")
    assert not list(Path("out").rglob("*.pvd")) and not list(Path("out").rglob("*.vtu"))


@pytest.mark.parametrize("series", ["plane"], indirect=True)
def test_long_runs_have_a_bounded_number_of_files(series, monkeypatch):
    monkeypatch.setattr(paraview, "_MOST", 3)
    times = [time for time, _ in steps(go("--force"))]
    assert times == [pytest.approx(one) for one in (0.0, 0.02, 0.05)]
    assert len(list(Path("out/vtk").iterdir())) == 3
