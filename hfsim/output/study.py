"""The results of a study on their way out: tables and facts to files, facts and text to the user.

A command claims its folder before anything is computed and publishes what came of it:

>>> from hfsim.output.text import Column
>>> study = Study("race", Talk())  # with a folder: Study.claim("race", to, deck.name, talk)
>>> columns = [Column("method"), Column("cpu", "cost.cpu"), Column("fast", lambda row: row["fast"] > 1)]
>>> rows = [{"method": "gauss", "cost": {"cpu": 0.5}, "fast": 2}]
>>> facts = study.publish({"status": "done"}, {"race": (columns, rows)}, "one method")
one method
>>> facts["files"]  # without a folder none
[]
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from hfsim.output.talk import Destination, Talk

if TYPE_CHECKING:
    from hfsim.output.runfolder import RunFolder
    from hfsim.output.text import Column

Page: TypeAlias = "Callable[[Mapping[str, Any], Path], str]"
"""Makes a page of HTML of the facts of a study and the folder with its pictures."""
Table: TypeAlias = "tuple[Iterable[Column | str], Iterable[Any]]"
"""Columns and rows of a CSV file: rows are whatever the columns know to read."""
_DRAWING = (2.0, 0.1)
"""Time kept back for pictures: so many seconds, at most this part of the budget."""


def time_to_draw(plots: bool, seconds: float) -> float:
    """Return what of a budget is kept back for pictures [s]."""
    return min(_DRAWING[0], _DRAWING[1] * seconds) if plots else 0.0


@dataclass(frozen=True)
class Study:
    """Where the results of one study go.

    Attributes
    ----------
    kind : str
        Name of the study; ``<kind>.json``, written last, tells that what is in the folder is whole.
    folder : RunFolder or None
        Folder granted; None: nothing is written.
    plots : bool
        Whether pictures are drawn.
    about : mapping
        Facts on where the study comes from; see `hfsim.output.writers.Provenance.facts`.
    format : str
        Of pictures.
    """

    kind: str
    talk: Talk
    folder: RunFolder | None = None
    plots: bool = True
    about: Mapping[str, object] = field(default_factory=dict)
    format: str = "png"

    @classmethod
    def claim(
        cls, kind: str, to: Destination, name: str, talk: Talk, about: Mapping[str, object] | None = None
    ) -> Study:
        """Return a study with its folder granted, ``<name>.<kind>`` where none is named; nothing is written.

        Raises
        ------
        FolderError
            If a finished study stands there, or the folder cannot be written to.
        """
        from hfsim.output.runfolder import FolderError, claim, folder_name

        path, marker = to.output or Path(folder_name(name, f".{kind}")), f"{kind}.json"
        if (path / marker).exists() and not to.force:
            raise FolderError(f"{path} already holds a study; use --force to replace it, or -o DIR")
        return cls(kind, talk, claim(path, to.force, marker), to.plots, about or {}, to.format)

    @property
    def path(self) -> Path:
        """The folder."""
        assert self.folder
        return self.folder.path

    def begin(self) -> None:
        """Make the folder and remove what is older, before much is computed: nothing old looks new then."""
        if self.folder:
            self.folder.prepare()

    def publish(
        self,
        facts: Mapping[str, Any],
        tables: Mapping[str, Table],
        text: str,
        draw: Callable[[Path], Iterable[str]] | None = None,
        page: Page | None = None,
        also: Sequence[str] = (),
        asked: bool = False,
    ) -> dict[str, Any]:
        """Write the study and tell it: as JSON on one line or as text, as the user wishes.

        Parameters
        ----------
        facts : mapping
            What goes into ``<kind>.json``; numbers that are not finite become null.
        tables : mapping of str to (columns, rows)
            CSV files by their names without ``.csv``.
        text : str
            The study as people read it.
        draw : callable, optional
            Draws the pictures into a folder and returns their names; not called if none are wanted.
        page : callable, optional
            Makes the page that shows all of it.
        also : sequence of str
            Files that are there already.
        asked : bool
            Whether the user has asked for the text in this form: it is for programs then.

        Returns
        -------
        dict
            The facts with where they come from, ``versions`` and ``files``.

        Raises
        ------
        WriteError
            If the disk refuses; there is no ``<kind>.json`` then.
        KeyboardInterrupt
            If a signal ends the drawing; all else has been written and told then.
        """
        plain = self._save(facts, tables, also)
        signal: KeyboardInterrupt | None = None
        if draw and self.plots and self.folder:
            plain, signal = self._add_pictures(plain, draw)
        if page and self.folder:
            plain = self._add_page(plain, page)
        if self.folder:
            self.folder.release()
        self.talk.facts(plain)
        self.talk.result(text, asked)
        if signal:
            raise signal
        return plain

    def _add_pictures(
        self, plain: Mapping[str, Any], draw: Callable[[Path], Iterable[str]]
    ) -> tuple[dict[str, Any], KeyboardInterrupt | None]:
        """Draw pictures; return the facts, as written anew with their names or a warning, and a signal."""
        from hfsim.output.disk import disk, write_json
        from hfsim.output.pictures import lost, put_pictures
        from hfsim.output.writers import versions

        pictures: list[str] = []
        warnings: list[str] = []
        signal: KeyboardInterrupt | None = None
        try:
            pictures = put_pictures(draw, self.path, self.format, f"{self.kind}.json")
        except KeyboardInterrupt as stop:
            warnings, signal = [lost(stop)], stop
        except Exception as error:  # whatever it is, it must not cost the results
            warnings = [lost(error)]
            self.talk.note(f"warning: {warnings[0]}")
        plain = {**plain, "versions": versions(), "files": [*plain["files"], *pictures], "warnings": warnings}
        with disk(self.path):
            write_json(self.path / f"{self.kind}.json", plain)
        return plain, signal

    def _add_page(self, plain: Mapping[str, Any], make: Page) -> dict[str, Any]:
        """Write a page; return the facts with its name, as they are written anew before it."""
        from hfsim.output.disk import disk, write_json, write_text
        from hfsim.output.page import PAGE

        plain = {**plain, "files": [*plain["files"], PAGE]}
        with disk(self.path):
            write_json(self.path / f"{self.kind}.json", plain)
            write_text(self.path / PAGE, make(plain, self.path))
        return plain

    def _save(
        self, facts: Mapping[str, Any], tables: Mapping[str, Table], also: Sequence[str]
    ) -> dict[str, Any]:
        from hfsim.output.disk import disk, write_json, write_text
        from hfsim.output.writers import json_ready, table_text, versions

        files = [*(f"{stem}.csv" for stem in tables), *also, f"{self.kind}.json"] if self.folder else []
        told: dict[str, Any] = json_ready({**facts, **self.about, "versions": versions(), "files": files})
        if self.folder is None:
            return told
        self.begin()
        with disk(self.path):
            for stem, (columns, rows) in tables.items():
                write_text(self.path / f"{stem}.csv", table_text(rows, columns))
            write_json(self.path / f"{self.kind}.json", told)
        return told
