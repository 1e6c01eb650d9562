"""Jobs in worker processes: each has its own time limit, all share a deadline, and none can end the study.

One process serves one job and is gone: a crash, a hang or a lack of memory there costs that job only.
However the study ends, killed without a word included, its workers end with it.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

_GRACE = 2.0
"""Time a worker gets beyond its limit to end by itself [s]; then it is ended."""


@dataclass(frozen=True)
class Task:
    """One job.

    Attributes
    ----------
    key : object
        By which its outcome is known; hashable.
    function : callable
        Of a module's top level; called with `argument` in a worker process.
    argument : object
        Can be pickled.
    limit : float
        Wall time it may take [s].
    """

    key: Any
    function: Callable[[Any], Any]
    argument: Any
    limit: float


@dataclass(frozen=True)
class Outcome:
    """What became of a task.

    Attributes
    ----------
    key : object
        Of the task.
    value : object
        What the function returned; None without a result.
    lost : str
        Why there is no result; empty when there is one.
    """

    key: Any
    value: Any = None
    lost: str = ""


@dataclass
class _Worker:
    task: Task
    process: Any
    pipe: Any
    end: float


@dataclass
class Farm:
    """A queue of tasks and the processes that serve it.

    Attributes
    ----------
    jobs : int
        Processes at a time.
    deadline : float
        Reading of ``time.perf_counter`` at which all is ended [s].
    interrupted : bool
        Whether a signal has ended `serve`.
    """

    jobs: int
    deadline: float = float("inf")
    interrupted: bool = False
    _queue: deque[Task] = field(default_factory=deque)
    _workers: list[_Worker] = field(default_factory=list)

    def add(self, task: Task, first: bool = False) -> None:
        """Queue a task, at the end or (`first`) before all others."""
        if first:
            self._queue.appendleft(task)
        else:
            self._queue.append(task)

    def outcomes(self) -> Generator[Outcome, None, None]:
        """Serve the queue, also what is added meanwhile; yield outcomes as they come in.

        Ends when nothing is left or the deadline has come; what had no result by then is `unreached`.
        """
        try:
            while self._queue or self._workers:
                if time.perf_counter() >= self.deadline:
                    return
                while self._queue and len(self._workers) < self.jobs:
                    self._start(self._queue.popleft())
                yield from self._finished()
        finally:
            self._stop()

    def serve(self, take: Callable[[Outcome], None]) -> None:
        """Hand every outcome to a function as it comes in; a signal ends that, and is noted."""
        try:
            with closing(self.outcomes()) as outcomes:
                for outcome in outcomes:
                    take(outcome)
        except KeyboardInterrupt:
            self.interrupted = True

    def unreached(self) -> list[Any]:
        """Return the keys of tasks that were still waiting, or cut off, at the end."""
        return [task.key for task in self._queue]

    @property
    def why_unreached(self) -> str:
        """Why there are any."""
        return "interrupted" if self.interrupted else "the budget was used up"

    def _start(self, task: Task) -> None:
        kinds = multiprocessing.get_all_start_methods()
        context: Any = multiprocessing.get_context("fork" if "fork" in kinds else "spawn")
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=_serve, args=(theirs, task.function, task.argument), daemon=True)
        process.start()
        theirs.close()
        end = time.perf_counter() + task.limit + _GRACE
        self._workers.append(_Worker(task, process, ours, end))

    def _finished(self) -> Iterator[Outcome]:
        now = time.perf_counter()
        soonest = min([self.deadline, *(worker.end for worker in self._workers)])
        pipes = [worker.pipe for worker in self._workers]
        ready = multiprocessing.connection.wait(pipes, min(max(soonest - now, 0.0), 1e6))
        for worker in list(self._workers):
            if worker.pipe in ready:
                yield self._collect(worker)
            elif time.perf_counter() >= worker.end:
                self._end(worker)
                yield Outcome(worker.task.key, lost=f"no answer within {worker.task.limit:.3g} s")

    def _collect(self, worker: _Worker) -> Outcome:
        key = worker.task.key
        try:
            value, lost = worker.pipe.recv()
        except EOFError:
            worker.process.join(_GRACE)
            value, lost = None, _death(worker.process.exitcode)
        self._end(worker)
        return Outcome(key, value, lost)

    def _end(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.pipe.close()
        worker.process.join(0.0)
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join(_GRACE)

    def _stop(self) -> None:
        """End what still runs and put it back into the queue."""
        for worker in reversed(list(self._workers)):
            self._queue.appendleft(worker.task)
            self._end(worker)


def _death(code: int | None) -> str:
    if code is not None and code < 0:
        return f"the worker was ended by signal {-code} ({signal.strsignal(-code)})"
    return f"the worker ended without an answer (exit code {code})"


def _serve(pipe: Any, function: Callable[[Any], Any], argument: Any) -> None:
    """Do one job; what goes wrong is an answer too."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the study decides what an interrupt ends
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        answer: tuple[Any, str] = function(argument), ""
    except MemoryError:
        answer = None, "not enough memory"
    except Exception as error:
        answer = None, f"{type(error).__name__}: {error}"
    pipe.send(answer)
    pipe.close()


def _end_with_parent() -> None:
    """End this process as soon as the one that started it is gone, whatever has ended that."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
