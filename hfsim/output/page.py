"""A run or a comparison as one page of HTML that needs nothing else: to read, keep, send and print."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from contextlib import suppress
from html import escape
from pathlib import Path
from typing import Any

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
    doubtful = [*summary["warnings"], *_doubts_of(summary)]
    parts = [
        section("Results", verbatim(text)),
        section("What is doubtful", doubts(doubtful)),
        section("Channels", html_table(("channel", "last", "smallest", "largest", "unit"), values)),
        *pictures(folder, summary["files"]),
        *origin(summary, deck),
    ]
    title = f"{summary['name']}: {summary['status']}"
    plain = {**summary, "files": [*summary["files"], PAGE]}
    with disk(folder / PAGE):
        write_json(folder / SUMMARY, plain)
        try:
            write_text(folder / PAGE, page(title, parts, summary["versions"]))
        except OSError:
            with suppress(OSError):
                write_json(folder / SUMMARY, {**summary, "exit_code": 1, "reason": f"{PAGE} was not written"})
            raise
    return plain


def page(title: str, parts: Sequence[str], versions: Mapping[str, str]) -> str:
    """Return a whole page; the title and versions are escaped here, the parts are HTML already."""
    made = ", ".join(f"{escape(name)} {escape(str(number))}" for name, number in versions.items())
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{_STYLE}</style></head>\n<body><h1>{escape(title)}</h1>\n{''.join(parts)}"
        f"<footer>{made}</footer></body></html>\n"
    )


def section(head: str, body: str) -> str:
    """Return a part of a page, whose body is HTML already."""
    return f"<h2>{escape(head)}</h2>\n{body}\n"


def verbatim(text: str) -> str:
    """Return a text as it stands."""
    return f"<pre>{escape(text)}</pre>"


def html_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return rows of cells under their headings."""
    first = "".join(f"<th>{escape(head)}</th>" for head in heads)
    lines = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>\n" for row in rows)
    return f"<table><tr>{first}</tr>\n{lines}</table>"


def doubts(lines: Sequence[str]) -> str:
    """Return what is doubtful as a list, or that nothing is."""
    if not lines:
        return "<p>Nothing was found to be.</p>"
    return f'<ul class="doubt">{"".join(f"<li>{escape(line)}</li>" for line in lines)}</ul>'


def pictures(folder: Path, files: Sequence[str]) -> list[str]:
    """Return the part with the pictures among some files of a folder; none where there are none."""
    shown = [name for name in files if Path(name).suffix in _KINDS and (folder / name).is_file()]
    if not shown:
        return []
    images = (
        f'<img alt="{escape(Path(name).stem)}" src="data:{_KINDS[Path(name).suffix]};base64,'
        f'{base64.b64encode((folder / name).read_bytes()).decode()}">'
        for name in shown
    )
    return [section("Plots", "\n".join(images))]


def origin(facts: Mapping[str, Any], deck: str) -> list[str]:
    """Return the parts with the deck, of this text, and the settings that changed it."""
    parts = [section("Deck", f"<p>{escape(str(facts['deck']))}</p>{verbatim(deck)}")]
    told = "\n".join(facts["overrides"])
    return [*parts, section("Settings of the command line", verbatim(told))] if told else parts


def _short(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else "-" if value is None else str(value)


def _doubts_of(summary: Mapping[str, Any]) -> list[str]:
    """Return why a run ended early, what is suspicious of it, and which errors are not known."""
    found = [summary["reason"]] if summary["reason"] else []
    if summary.get("suspicion"):
        found.append(f"suspicious: {summary['suspicion']['reason']}")
    for name in ("error_estimate", "mesh_error_estimate"):
        if summary[name] is None:
            why = summary[f"{name}_reason"] or "not asked for"
            found.append(f"the {name.replace('_', ' ')} is not known: {why}")
    return found
