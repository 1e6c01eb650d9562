"""The `hfsim` command: finds the sub-command asked for and turns errors into text and an exit code.

Exit codes: 0 done; 1 internal error; 2 bad command line or deck; 3 the solver failed or the model broke
down; 4 a stated tolerance was missed; 5 a limit was reached; 130 interrupted; 143 terminated.

Only click is imported here, so that help and mistakes cost nothing; each sub-command brings the rest.
"""

from __future__ import annotations

import atexit
import gc
import importlib
import os
import signal
import sys
import threading
from contextlib import suppress
from types import ModuleType

import click

from hfsim import __version__

COMMANDS = {
    "run": "Simulate decks: CSV, plots, summary.",
    "static": "Where a scene comes to rest: its equilibrium, stable or not.",
    "modes": "Frequencies, damping and shapes of small motions; Campbell diagrams.",
    "compare": "One scene with several models: differences, run times, verdict.",
    "bench": "Error against run time: methods, tolerances, models, meshes.",
    "sweep": "Many runs of one deck: grids, samples, tables; a row for each.",
    "stability": "Where methods and models hold: maps over stiffness, speed, step and any entry.",
    "extreme": "The decks at the edge of what can be solved, held against what is expected.",
    "verify": "Published values against what is found: benchmarks, and decks of one's own.",
    "plan": "What is built of a scene and what is left out: reasons, savings, cost.",
    "check": "Validate and assemble decks; run nothing, write nothing.",
    "init": "Write a commented deck to start from.",
    "schema": "Print the JSON schema of decks, for editors.",
    "help": "Show the manual, a page at a time.",
}
"""Sub-command: its line in ``hfsim --help``; a module of `hfsim.commands` has a function of that name."""


_HELP = {"help_option_names": ["-h", "--help"], "max_content_width": 110}
INTERRUPTED, TERMINATED = 130, 143

SELDOM = 20_000
"""New objects after which Python looks for cycles."""

LEFT_OUT: dict[str, dict[str, object]] = {
    "numpy._core._add_newdocs": {},
    "numpy._core._add_newdocs_scalars": {},
    "numpy._typing": {"NDArray": list},
}
"""Modules for people who read and check types, with what is used of them while a program runs."""


class LazyGroup(click.Group):
    """A group whose sub-commands are imported when they are called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of all sub-commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return one sub-command."""
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f"hfsim.commands.{cmd_name}")
        command: click.Command = getattr(module, cmd_name)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the sub-command; where there is none of that name, tell the nearest, or what runs a deck."""
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            if close := _meant(args[0]):
                message = f"{error.message.rstrip('.')} (did you mean '{close}'?)"
                raise click.UsageError(message, ctx) from None
            raise

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of sub-commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))

    def invoke(self, ctx: click.Context) -> object:
        """Run the sub-command; every error ends in a message and an exit code."""
        try:
            return super().invoke(ctx)
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except KeyboardInterrupt:
            click.echo("interrupted", err=True)
            ctx.exit(INTERRUPTED)
        except Exception as error:
            from hfsim.commands import report_error

            ctx.exit(report_error(error))


def _meant(word: str) -> str:
    """Return what a word that is no sub-command may mean: a deck to run, or the nearest sub-command."""
    from hfsim.deck.source import nearest
    from hfsim.scene.shipped import shipped_cases

    if word.endswith((".yaml", ".yml")) or word in shipped_cases():
        return f"hfsim run {word}"
    return nearest(word, COMMANDS)


def _tell_version(context: click.Context, option: click.Parameter, wanted: bool) -> None:
    """Tell what this is and what evaluates its equations."""
    if not wanted or context.resilient_parsing:
        return
    from hfsim.errors import KernelError

    try:
        from hfsim.maths.kernel import KERNEL, MISSING
    except KernelError as why:
        raise click.UsageError(str(why)) from why
    click.echo(f"hfsim, version {__version__}, kernel {KERNEL}" + f" ({MISSING})" * bool(MISSING))
    context.exit()


@click.group(cls=LazyGroup, context_settings=_HELP)
@click.option(
    *("--version", "version"),
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_tell_version,
    help="Show the version and the kernel and exit.",
)
def app() -> None:
    """Simulate flexible multibody systems: five models of one scene, with their error and cost.

    Exit codes: 0 done, 1 internal error, 2 bad command line or deck, 3 the solver failed or the model
    broke down, 4 a stated tolerance was missed, 5 a limit was reached, 130 interrupted, 143 terminated.
    """


def main() -> None:
    """Entry point of the program; never returns.

    Raises
    ------
    SystemExit
        With the exit code, unless all went well and the process can end here.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # the matrices are small: more threads only cost CPU time
    for module, known in LEFT_OUT.items():
        _leave_out(module, **known)
    if os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1") == "1":
        _leave_out("pydantic.plugin._loader", get_plugins=tuple)
    gc.set_threshold(SELDOM)
    _open_closed_streams()
    taken = _take_signals()
    try:
        app(prog_name="hfsim")
    except SystemExit as stop:
        if taken and stop.code in (1, INTERRUPTED):  # what an interruption breaks off is no mistake
            raise SystemExit(taken[0]) from None
        if not stop.code:
            _end()
        raise
    except OSError as error:  # click had something to say itself
        from hfsim.commands import report_error
        from hfsim.output.talk import refused

        raise SystemExit(report_error(refused(error))) from None
    finally:
        gc.freeze()  # or Python would look for cycles in all there is once more before it ends


def _end() -> None:
    """End the process, all being well: to take apart all that was imported takes a fortieth of a short run.

    Not where somebody watches, or is still at work, or cannot be told all: there Python ends as it does.
    """
    if threading.active_count() > 1 or sys.getprofile() or sys.gettrace():
        return
    atexit._run_exitfuncs()
    with suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(0)


def _leave_out(name: str, **known: object) -> None:
    """Let what is known of a module stand in for it; it is imported if anything else is asked of it.

    The module by which pydantic looks for plug-ins in all that is installed imports more than hfsim does of
    the standard library, if only to find that they are switched off.
    """
    stand_in = ModuleType(name)

    def ask(rest: str) -> object:
        if rest.startswith("__"):  # the import system looks whether it is a package
            raise AttributeError(rest)
        if sys.modules[name] is stand_in:
            del sys.modules[name]
        return getattr(importlib.import_module(name), rest)

    vars(stand_in).update(known, __getattr__=ask)
    sys.modules.setdefault(name, stand_in)


def _open_closed_streams() -> None:
    """Let go nowhere what is told to a closed stream (``2>&-``): else the next file takes its place."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            stream = open(os.devnull, "r" if number == 0 else "w", encoding="utf-8")  # noqa: SIM115
            if stream.fileno() != number:
                os.dup2(stream.fileno(), number)
            setattr(sys, name, stream)


SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGXCPU")
"""Signals that end a run so that what was computed is kept."""


def _take_signals() -> list[int]:
    """Let signals interrupt this process once, a second one ends it; return where exit codes are noted.

    What must not be left half done is done first.  Worker processes, which inherit this, end at once, but
    for those that take signals themselves.
    """
    process = os.getpid()
    codes: list[int] = []
    taken = [getattr(signal, name) for name in SIGNALS if hasattr(signal, name)]

    def take(number: int, frame: object) -> None:
        for one in taken:
            signal.signal(one, signal.SIG_DFL)
        # nothing is imported here: what it interrupts may be half-way through importing the same
        shield = getattr(sys.modules.get("hfsim.marching.stop"), "SHIELD", None)
        if os.getpid() not in (process, getattr(shield, "process", 0)):
            os.kill(os.getpid(), number)
            return
        codes.append(INTERRUPTED if number == signal.SIGINT else TERMINATED)
        if shield is None:
            raise KeyboardInterrupt
        Terminated: type[KeyboardInterrupt] = sys.modules["hfsim.errors"].Terminated
        shield.interrupt(
            KeyboardInterrupt() if number == signal.SIGINT else Terminated(signal.Signals(number).name)
        )

    for number in taken:
        if signal.getsignal(number) != signal.SIG_IGN:  # as nohup asks for
            signal.signal(number, take)
    return codes
