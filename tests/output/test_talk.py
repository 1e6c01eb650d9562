"""What reaches the terminal: nothing raw, and nothing at all where its streams are closed."""

import io
import os
import subprocess
import sys

import pytest

from hfsim.output.progress import Progress
from hfsim.output.runfolder import RunLog
from hfsim.output.talk import Talk
from hfsim.output.text import WIDTH, Column, as_table, for_a_file, printable, table, wrapped

RED = "\x1b[31m"


@pytest.mark.parametrize(
    "char", ["\x1b", "\x00", "\x07", "\r", "\t", "\x7f", "\x9b", "\u202e", "\u2028", "\udc80"]
)
def test_what_moves_the_cursor_is_shown_by_its_number(char):
    assert printable(f"a{char}b\n").isascii()
    assert all(one.isprintable() or one == "\n" for one in printable(f"a{char}b\n"))


def test_what_can_be_read_stays():
    assert printable("Träger 30 °, 😀\n") == "Träger 30 °, 😀\n"


def test_a_table_leaves_out_what_can_be_spared_where_lines_would_not_fit():
    names = ("method", "error", "rms", "evaluations", "channel")
    columns = [Column(name, spare=spare) for name, spare in zip(names, (0, 0, 1, 2, 0), strict=True)]
    for length, left in ((9, names), (60, names[:3] + names[4:]), (70, ("method", "error", "channel"))):
        row = {**dict.fromkeys(names, "x" * 12), "channel": "c" * length}
        head, line = table(columns, [row]).split("\n")
        assert head.split() == list(left) and len(line) <= 110


def test_progress_and_log_show_names_likewise(tmp_path):
    class Terminal(list):
        write, flush, isatty = list.append, lambda self: None, lambda self: True

    clock = iter((0.0, 10.0, 20.0))
    screen, log = Terminal(), RunLog()
    Progress(RED, screen, clock=lambda: next(clock))(0.5)
    log.to(tmp_path / "run.log")
    log.add(RED)
    text = (tmp_path / "run.log").read_text()
    assert RED not in "".join(screen) + text
    assert "u001b[31m" in "".join(screen) and "u001b[31m" in text


def hfsim(arguments, cwd, closed=(), **environment):
    def close():
        for descriptor in closed:
            os.close(descriptor)

    return subprocess.run(
        [sys.executable, "-m", "hfsim", *arguments],
        capture_output=True,
        cwd=cwd,
        preexec_fn=close,
        env=os.environ | environment,
        timeout=60,
    )


def test_no_control_character_of_a_deck_reaches_the_terminal(tmp_path):
    file = "e\x1b[32m\nvil.yaml"
    (tmp_path / file).write_text('hfsim: 1\nname: "\\e[31mred\\n"\n"\\e[2J": 1\nsolve: {model: "\\x9b1m"}\n')
    for arguments in (["check", file], ["check", "--json", file], ["run", file], ["check", "-v", file]):
        done = hfsim(arguments, tmp_path)
        said = (done.stdout + done.stderr).decode()
        assert done.returncode == 2
        assert "u001b[31mred" in said
        assert all(char.isprintable() or char == "\n" for char in said)


def test_a_terminal_without_unicode_gets_escapes(tmp_path):
    (tmp_path / "deck.yaml").write_text("hfsim: 1\nname: Träger/\n", encoding="utf-8")
    done = hfsim(["check", "deck.yaml", "--json"], tmp_path, PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert done.returncode == 2
    assert b"Tr\\xe4ger" in done.stderr


@pytest.mark.parametrize("closed", [(2,), (1,), (0, 1, 2)])
def test_closed_streams_keep_no_run_from_running(tmp_path, closed):
    short = ["run", "pendulum", "--set", "solve.duration=0.01", "--no-plots", "-o", "out"]
    done = hfsim(short, tmp_path, closed)
    assert done.returncode == 0
    assert (tmp_path / "out" / "summary.json").is_file()
    assert "2>" not in (tmp_path / "out" / "history.csv").read_text()


def test_a_folder_that_is_gone_is_no_internal_error(tmp_path):
    deck = tmp_path / "deck.yaml"
    deck.write_text("hfsim: 1\nbodies: {b: {type: rigid, mass: 1, inertia: 1}}\nsolve: {duration: 0.01}\n")
    script = (
        f"import os, subprocess, sys; os.mkdir('gone'); os.chdir('gone'); os.rmdir('../gone')\n"
        f"for words in ('check {deck}', 'run {deck}', 'check none.yaml', 'check ' + 'a' * 300):\n"
        f"    print(subprocess.run([sys.executable, '-m', 'hfsim', *words.split()], stderr=1).returncode)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert [line for line in done.stdout.splitlines() if line.isdecimal()] == ["0", "2", "2", "2"]
    assert "internal error" not in done.stdout


def test_a_folder_name_too_long_for_the_system_is_refused(tmp_path):
    done = hfsim(["run", "pendulum", "-o", "a" * 300], tmp_path)
    assert done.returncode == 2
    assert b"error: cannot write to aaaa" in done.stderr


def test_of_many_warnings_the_first_are_told(capsys):
    Talk().warn("deck", (f"warning {k}" for k in range(3000)))
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "deck: warning: warning 0"
    assert lines[-1] == "deck: and 2950 more warnings (--json lists them)"
    assert len(lines) == 51


class Terminal(io.StringIO):
    """A stream that says that it is a terminal."""

    def isatty(self):
        return True


LONG = "left_front_upper_flexible_arm.tip.deflection"
ROWS = [["channel", "why", "error"], [LONG, "no time was left for it, nor any memory", "0.000113 (0.56 %)"]]


@pytest.mark.parametrize("width", [50, 80, 100, 200])
def test_tables_are_as_wide_as_the_terminal_and_cut_names_but_no_numbers(monkeypatch, width):
    piped = as_table(ROWS)
    monkeypatch.setattr(sys, "stdout", Terminal())
    monkeypatch.setenv("COLUMNS", str(width))
    lines = as_table(ROWS).split("\n")
    assert max(map(len, lines)) <= width
    assert lines[1].endswith(" 0.000113 (0.56 %)") and lines[1].lstrip().startswith("left")
    assert (LONG in lines[1]) == (width > 100)
    assert all(len(line) <= min(width, WIDTH) for line in wrapped("a sentence of words " * 30).split("\n"))
    with for_a_file():
        assert as_table(ROWS) == piped


def test_tables_in_pipes_are_of_one_width_whatever_the_terminal(monkeypatch):
    columns = [Column("name"), *(Column(f"number {k}", lambda row: "x" * 20, spare=k) for k in range(1, 6))]
    found = set()
    for width in ("60", "300"):
        monkeypatch.setenv("COLUMNS", width)
        found.add(table(columns, [{"name": "one"}]))
        assert LONG in as_table(ROWS)
    (text,) = found
    assert "number 4" in text and "number 5" not in text
