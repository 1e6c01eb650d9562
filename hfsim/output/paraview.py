"""Motion for ParaView: a VTK file for each time, with the bodies as lines, and a list of them.

The format is that of https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html: XML with arrays in
base64, the number of bytes first.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from hfsim.marching.solution import Run
from hfsim.maths.arrays import Array, IntArray

_MOST = 1000
"""Files of one run at most; of more times, those are taken that are about evenly apart."""
_AT_ONCE = 32
"""Files whose forces are computed together."""
_VERTEX, _POLY_LINE = 1, 4
_TYPES = {"f8": "Float64", "i8": "Int64", "u1": "UInt8"}


def write_series(run: Run, stem: str, folder: Path) -> list[str]:
    """Write the motion of a run as ``<stem>_0001.vtu`` and so on, and ``<stem>.pvd`` with their times.

    Points have their ``displacement`` from where they are in the first file, and the internal forces of
    beams, named as channels and zero where a body or its section has none; each body is a line with its
    ``body``, a number from 0 on, and ``name``. In planar runs z is 0.

    Parameters
    ----------
    run : Run
        With outlines.
    stem : str
        What the files are called.
    folder : Path
        Where they go.

    Returns
    -------
    list of str
        Names of the files, the list of them last; none where the run has no outlines.
    """
    if run.outlined is None:
        return []
    instants, outlines = run.outlined
    frames = np.unique(np.linspace(0, len(instants) - 1, _MOST).round().astype(int))
    width = max(4, len(str(len(frames))))
    lines = _lines(outlines)
    start = _points(outlines, 0)
    names = []
    for number, (frame, forces) in enumerate(_with_forces(run, outlines, frames), 1):
        names.append(f"{stem}_{number:0{width}}.vtu")
        points = _points(outlines, frame)
        data = "".join([_array("displacement", points - start), *forces])
        moved = f'<PointData Vectors="displacement">{data}</PointData>'
        piece = f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(outlines)}">'
        where = f"<Points>{_array('points', points)}</Points>"
        time = _array("TimeValue", instants[frame : frame + 1], tuples=True)
        parts = [f"<FieldData>{time}</FieldData>", piece, moved, where, *lines, "</Piece>"]
        (folder / names[-1]).write_text(_document("UnstructuredGrid", parts), "utf-8")
    times = zip(names, instants[frames].tolist(), strict=True)
    listed = [f'<DataSet timestep="{t!r}" part="0" file={quoteattr(f"vtk/{name}")}/>' for name, t in times]
    (folder / f"{stem}.pvd").write_text(_document("Collection", listed), "utf-8")
    return [*names, f"{stem}.pvd"]


def _with_forces(
    run: Run, outlines: dict[str, Array], frames: IntArray
) -> Iterator[tuple[int, list[str]]]:
    """Yield each frame with its arrays of internal forces."""
    nothing = {name: np.zeros(points.shape[1]) for name, points in outlines.items()}
    for some in np.array_split(frames, -(-len(frames) // _AT_ONCE)):
        found = run.outline_forces(some) if run.outline_forces is not None else {}
        for k, frame in enumerate(some):
            forces = {kind: {name: own[k] for name, own in bodies.items()} for kind, bodies in found.items()}
            yield (
                int(frame),
                [_array(kind, np.concatenate([*(nothing | own).values()])) for kind, own in forces.items()],
            )


def _points(outlines: dict[str, Array], frame: int) -> Array:
    """Return all points at a time, shape (n, 3) [m]."""
    points = np.vstack([one[frame] for one in outlines.values()])
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def _lines(outlines: dict[str, Array]) -> list[str]:
    """Return what says which points make up which body."""
    ends = np.cumsum([one.shape[1] for one in outlines.values()])
    kinds = np.array([_VERTEX if one.shape[1] == 1 else _POLY_LINE for one in outlines.values()])
    cells = [
        _array("connectivity", np.arange(ends[-1])),
        _array("offsets", ends),
        _array("types", kinds, "u1"),
    ]
    bodies = [_array("body", np.arange(len(ends))), _names(outlines)]
    return ["<CellData>", *bodies, "</CellData>", "<Cells>", *cells, "</Cells>"]


def _array(name: str, values: Array | IntArray, kind: str = "", tuples: bool = False) -> str:
    """Return an array of numbers as an element."""
    kind = kind or values.dtype.kind + "8"
    data = np.ascontiguousarray(values, "<" + kind).tobytes()
    size = len(data).to_bytes(8, "little")
    shape = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    shape += f' NumberOfTuples="{len(values)}"' if tuples else ""
    text = base64.b64encode(size + data).decode()
    return f'<DataArray type="{_TYPES[kind]}" Name="{name}"{shape} format="binary">{text}</DataArray>'


def _names(outlines: dict[str, Array]) -> str:
    """Return the names of the bodies: the format has texts as numbers, each ended by a zero."""
    text = " ".join(str(one) for name in outlines for one in (*name.encode(), 0))
    head = f'type="String" Name="name" NumberOfTuples="{len(outlines)}" format="ascii"'
    return f"<DataArray {head}>{text}</DataArray>"


def _document(kind: str, parts: list[str]) -> str:
    head = f'<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" header_type="UInt64">'
    return "\n".join(['<?xml version="1.0"?>', head, f"<{kind}>", *parts, f"</{kind}>", "</VTKFile>", ""])
