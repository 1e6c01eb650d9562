"""Pictures of stability maps: the class of every point."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch
from matplotlib.transforms import Affine2D

from hfsim.output.plots.figures import new_figure, set_title_above
from hfsim.output.plots.files import save
from hfsim.output.plots.ink import fitted, text_width
from hfsim.output.plots.style import GREEN, ORANGE, PURPLE, RED, SKY, YELLOW
from hfsim.studies.stability.results import StabilityMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CLASS_STYLES = {
    "accurate": (GREEN, "A"),
    "wrong": (ORANGE, "W"),
    "numerical": (RED, "N"),
    "model": (PURPLE, "M"),
    "physical": (SKY, "P"),
    "deck": (YELLOW, "D"),
    "no result": ("0.75", "?"),
    "not computed": ("white", ""),
}
"""Colour (Okabe and Ito) and letter of each class; the letter serves where colours do not."""
_MOST_LETTERS = 24
"""Columns of a panel up to which cells carry their letter."""
_PANEL = 2.9, 2.3
"""Width and height of a panel of a map with its ticks [inch]."""
_LETTERS = 10.0
"""Size of the letters of the legend [pt]."""
_PATCH = 0.8
"""Width that the legend takes beside its words [inch]."""


def draw_stability(result: StabilityMap, folder: Path) -> list[str]:
    """Draw the classes over one or two axes, one panel for each model and method; return the files."""
    if not result.axes:
        return []
    draw = _map_figure if len(result.axes) == 2 else _strips_figure
    return save({"stability": draw(result)}, folder)


def _map_figure(result: StabilityMap) -> Figure:
    models = list(dict.fromkeys(model for model, _ in result.rows()))
    methods = list(dict.fromkeys(method for _, method in result.rows()))
    figure = new_figure((2.6 + _PANEL[0] * len(methods), 1.2 + _PANEL[1] * len(models)))
    panels = figure.subplots(len(models), len(methods), squeeze=False, sharex=True, sharey=True)
    ys, xs = (axis.values for axis in result.axes)
    for i, model in enumerate(models):
        for j, method in enumerate(methods):
            axes: Axes = panels[i, j]
            points = result.points_of(model, method)
            classes = [[points[y, x].outcome if (y, x) in points else "not computed" for x in xs] for y in ys]
            _classes_panel(axes, classes)
            axes.set_title(f"{model}, {method}", fontsize=10)
            _value_ticks(axes, xs, "x")
            _value_ticks(axes, ys, "y")
    y_label, x_label = (axis.label for axis in result.axes)
    _shared_label(figure.supylabel, y_label, _PANEL[1] * len(models))
    _shared_label(figure.supxlabel, x_label, _PANEL[0] * len(methods))
    _title_and_legend(figure, result)
    return figure


def _shared_label(write: Callable[..., object], text: str, room: float) -> None:
    """Write a label of all panels in a row or column, as long as the room there is [inch]."""
    label = fitted(text, room)
    write("\n".join(label.lines), fontsize=label.size)


def _strips_figure(result: StabilityMap) -> Figure:
    """Draw one strip for each model and method along the one axis."""
    rows, values = result.rows(), result.axes[0].values
    figure = new_figure((min(14.0, 4.2 + 0.55 * len(values)), 1.6 + 0.42 * len(rows)))
    axes = figure.subplots()
    classes = []
    for model, method in rows:
        points = result.points_of(model, method)
        classes.append([points[v,].outcome if (v,) in points else "not computed" for v in values])
    _classes_panel(axes, classes)
    _value_ticks(axes, values, "x")
    axes.set_yticks(range(len(rows)), [f"{model}, {method}" for model, method in rows])
    axes.invert_yaxis()
    axes.set_xlabel(result.axes[0].label)
    _title_and_legend(figure, result)
    return figure


def _classes_panel(axes: Axes, classes: Sequence[Sequence[str]]) -> None:
    known = list(_CLASS_STYLES)
    numbers = [[known.index(one) for one in row] for row in classes]
    colours = ListedColormap([colour for colour, _ in _CLASS_STYLES.values()])
    axes.pcolormesh(
        numbers, cmap=colours, vmin=-0.5, vmax=len(known) - 0.5, edgecolors="white", linewidth=1.0
    )  # fmt: skip
    axes.set_xticks([])
    axes.spines[:].set_visible(False)
    # cells are centred on whole numbers, where ticks and letters go
    mesh = axes.collections[-1]
    mesh.set_transform(Affine2D().translate(-0.5, -0.5) + axes.transData)
    axes.set_xlim(-0.5, len(classes[0]) - 0.5)
    axes.set_ylim(-0.5, len(classes) - 0.5)
    if len(classes[0]) > _MOST_LETTERS:
        return
    for i, row in enumerate(classes):
        for j, one in enumerate(row):
            axes.text(j, i, _CLASS_STYLES[one][1], ha="center", va="center", fontsize=8, color="black")


def _value_ticks(axes: Axes, values: Sequence[float | str], which: str) -> None:
    every = max(1, -(-len(values) // 8))
    places = list(range(0, len(values), every))
    shown = [values[i] for i in places]
    labels = [value if isinstance(value, str) else f"{value:.3g}" for value in shown]
    if which == "x":
        axes.set_xticks(places, labels, rotation=45, ha="right", fontsize=8)
    else:
        axes.set_yticks(places, labels, fontsize=8)


def _title_and_legend(figure: Figure, result: StabilityMap) -> None:
    """Write the title and, right of it and of the panels, what the colours mean."""
    shown = [name for name in _CLASS_STYLES if name in result.counts()]
    handles = [
        Patch(facecolor=_CLASS_STYLES[name][0], edgecolor="0.6", label=_class_label(name)) for name in shown
    ]
    wide = max((text_width(_class_label(name), _LETTERS) for name in shown), default=0.0) + _PATCH
    set_title_above(figure, f"{result.name}: where methods and models hold", wide)
    figure.legend(handles=handles, loc="outside right upper", frameon=False, fontsize=_LETTERS)


def _class_label(name: str) -> str:
    letter = _CLASS_STYLES[name][1]
    return f"{letter}  {name}" if letter else name
