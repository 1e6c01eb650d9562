"""A run as one page of HTML that needs nothing else: to read, keep, send and print."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from hfsim import __version__
from hfsim.output.disk import disk, write_json, write_text
from hfsim.output.runfolder import SUMMARY

PAGE = "report.html"

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 60rem; margin: 2rem auto }
h1 { font-size: 1.6rem } h2 { font-size: 1.15rem; border-bottom: 1px solid #ccc; margin-top: 2rem }
table { border-collapse: collapse } th, td { text-align: left; padding: .15rem 1.2rem .15rem 0 }
pre { background: #f6f6f4; padding: .8rem; overflow-x: auto; white-space: pre-wrap; font-size: 13px }
img { max-width: 100%; break-inside: avoid }
.doubt { border-left: 4px solid #c60; padding-left: .8rem } footer { color: #777; margin-top: 2rem }
@media print { body { margin: 0; max-width: none; font-size: 11px } h2 { break-after: avoid } }
"""
_KINDS = {".png": "image/png", ".svg": "image/svg+xml"}


def add_page(folder: Path, summary: Mapping[str, Any], text: str, deck: str) -> dict[str, Any]:
    """Write the page of a run into its folder; return the summary with it, as it is written anew.

    Parameters
    ----------
    folder : Path
        With the pictures that the summary lists.
    summary : mapping
        What ``summary.json`` has.
    text : str
        What people are told of the run.
    deck : str
        Its text.

    Raises
    ------
    WriteError
        If the disk refuses.
    """
    values = [
        [name, _short(summary["final"].get(name)), *map(_short, summary["extremes"].get(name, ())), unit]
        for name, unit in summary["channels"].items()
    ]
    doubtful = [*summary["warnings"], *_doubts(summary)]
    parts = [
        _section("Results", f"<pre>{escape(text)}</pre>"),
        _section("What is doubtful", _doubtful(doubtful)),
        _section("Channels", _table(("channel", "last", "smallest", "largest", "unit"), values)),
        *_pictures(folder, summary["files"]),
        _section("Deck", f"<p>{escape(str(summary['deck']))}</p><pre>{escape(deck)}</pre>"),
        _settings(summary["overrides"]),
    ]
    title = f"{summary['name']}: {summary['status']}"
    plain = {**summary, "files": [*summary["files"], PAGE]}
    with disk(folder):
        write_json(folder / SUMMARY, plain)
        write_text(folder / PAGE, page(title, parts, summary["versions"]))
    return plain


def page(title: str, parts: Sequence[str], versions: Mapping[str, str]) -> str:
    """Return a whole page; the title and versions are escaped here, the parts are HTML already."""
    made = ", ".join(f"{escape(name)} {escape(str(number))}" for name, number in versions.items())
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{_STYLE}</style></head>\n<body><h1>{escape(title)}</h1>\n{''.join(parts)}"
        f"<footer>hfsim {__version__}; {made}</footer></body></html>\n"
    )


def _section(head: str, body: str) -> str:
    return f"<h2>{escape(head)}</h2>\n{body}\n"


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    first = "".join(f"<th>{escape(head)}</th>" for head in heads)
    lines = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>\n" for row in rows)
    return f"<table><tr>{first}</tr>\n{lines}</table>"


def _short(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else "-" if value is None else str(value)


def _doubtful(lines: Sequence[str]) -> str:
    if not lines:
        return "<p>Nothing was found to be.</p>"
    return f'<ul class="doubt">{"".join(f"<li>{escape(line)}</li>" for line in lines)}</ul>'


def _doubts(summary: Mapping[str, Any]) -> list[str]:
    """Return why a run ended early, what is suspicious of it, and which errors are not known."""
    found = [summary["reason"]] if summary["reason"] else []
    if summary.get("suspicion"):
        found.append(f"suspicious: {summary['suspicion']['reason']}")
    for name in ("error_estimate", "mesh_error_estimate"):
        if summary[name] is None:
            why = summary[f"{name}_reason"] or "not asked for"
            found.append(f"the {name.replace('_', ' ')} is not known: {why}")
    return found


def _pictures(folder: Path, files: Sequence[str]) -> list[str]:
    shown = [name for name in files if Path(name).suffix in _KINDS and (folder / name).is_file()]
    if not shown:
        return []
    images = (
        f'<img alt="{escape(Path(name).stem)}" src="data:{_KINDS[Path(name).suffix]};base64,'
        f'{base64.b64encode((folder / name).read_bytes()).decode()}">'
        for name in shown
    )
    return [_section("Plots", "\n".join(images))]


def _settings(overrides: Sequence[str]) -> str:
    told = "\n".join(overrides)
    return _section("Settings of the command line", f"<pre>{escape(told)}</pre>") if overrides else ""
