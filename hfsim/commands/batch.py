"""Several decks at a time, each in a process of its own: results in the order of the decks."""

from __future__ import annotations

import io
import multiprocessing
import multiprocessing.connection
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeAlias

from hfsim.errors import interruption_code
from hfsim.marching.stop import SHIELD
from hfsim.output.talk import print_error, print_out
from hfsim.studies.farm import end_with_parent

Tell: TypeAlias = Callable[[float], None]
Do: TypeAlias = Callable[[int, Tell], int]
"""Does the job of a number and tells the share that is done; returns the exit code."""

_PAUSE = 0.1
"""Shortest time between two reports of a worker [s]."""


@dataclass
class _Worker:
    process: Any
    pipe: Any
    share: float = 0.0
    code: int | None = None
    told: tuple[str, str] = ("", "")


def run_batch(names: Sequence[str], do: Do, jobs: int, progress: Tell, wipe: Callable[[], None]) -> list[int]:
    """Do jobs in processes, some at a time, and print what each has to say in their order.

    Parameters
    ----------
    names : sequence of str
        Of the jobs, for messages.
    do : callable
        Runs in the process of a job; what it prints is printed here when its turn has come.
    jobs : int
        Processes at a time.
    progress : callable
        Told the share of all that is done, 0 to 1.
    wipe : callable
        Clears the line of progress before something is printed.

    Returns
    -------
    list of int
        Exit codes of the jobs. When a signal comes, it goes to those at work, which keep what they have
        computed; those that have not begun get the signal's code.
    """
    workers: list[_Worker] = []
    stopped, printed = 0, 0
    while printed < len(names):
        try:
            busy = [worker for worker in workers if worker.code is None]
            while not stopped and len(busy) < jobs and len(workers) < len(names):
                with SHIELD:
                    workers.append(_started(do, len(workers)))
                busy.append(workers[-1])
            if busy:
                _listen(busy)
                progress(sum(1.0 if w.code is not None else w.share for w in workers) / len(names))
        except KeyboardInterrupt as stop:
            stopped = interruption_code(stop)
            _pass_on(workers, stop)
        while printed < len(workers) and workers[printed].code is not None:
            wipe()
            _print(workers[printed])
            printed += 1
        if stopped and printed == len(workers):
            break
    if len(workers) < len(names):
        print_error(f"not begun: {', '.join(names[len(workers):])}")
    return [worker.code or 0 for worker in workers] + [stopped] * (len(names) - len(workers))


def _started(do: Do, number: int) -> _Worker:
    context: Any = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    sys.stdout.flush()
    sys.stderr.flush()
    process = context.Process(target=_work, args=(theirs, do, number))
    process.start()
    theirs.close()
    return _Worker(process, ours)


def _listen(busy: Sequence[_Worker]) -> None:
    """Take what workers have to say; wait until there is something."""
    ready = multiprocessing.connection.wait([worker.pipe for worker in busy], 1.0)
    for worker in busy:
        if worker.pipe not in ready:
            continue
        try:
            said = worker.pipe.recv()
        except (EOFError, OSError):
            worker.process.join()
            said = (1, "", _death(worker.process.exitcode))
        if isinstance(said, float):
            worker.share = said
            continue
        worker.code, *texts = said
        worker.told = (texts[0], texts[1])
        worker.process.join()
        worker.pipe.close()


def _death(code: int | None) -> str:
    by = f"ended by signal {-code}" if code is not None and code < 0 else "gone"
    return f"error: the process of a deck is {by}; what it has written is kept"


def _pass_on(workers: Sequence[_Worker], stop: KeyboardInterrupt) -> None:
    number = signal.SIGTERM if interruption_code(stop) == 143 else signal.SIGINT
    for worker in workers:
        if worker.code is None:
            with suppress(ProcessLookupError):
                os.kill(worker.process.pid, number)


def _print(worker: _Worker) -> None:
    out, errors = worker.told
    if errors:
        print_error(errors.rstrip("\n"))
    if out:
        print_out(out.rstrip("\n"))


# --- in the process of a job ---------------------------------------------------------------------


def _work(pipe: Any, do: Do, number: int) -> None:
    """Do one job and send what came of it; signals come from the parent alone, which sends each once."""
    os.setpgid(0, 0)
    SHIELD.take_over(os.getpid())
    threading.Thread(target=end_with_parent, daemon=True).start()
    out, errors = io.StringIO(), io.StringIO()
    sys.stdout, sys.stderr = out, errors
    try:
        code = do(number, _reporting(pipe))
    except KeyboardInterrupt as stop:
        code = interruption_code(stop)
    except SystemExit as stop:
        code = stop.code if isinstance(stop.code, int) else 1
    with SHIELD:
        pipe.send((code, out.getvalue(), errors.getvalue()))
        pipe.close()


def _reporting(pipe: Any) -> Tell:
    last = 0.0

    def report(share: float) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _PAUSE:
            last = now
            with SHIELD:
                pipe.send(float(share))

    return report
