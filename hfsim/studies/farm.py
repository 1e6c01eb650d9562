"""Jobs in worker processes: each has its own time limit, all share a deadline, and none can end the study.

A process serves one job after the other; a crash or a hang costs the job it has at the time, and another
process takes its place.  However the study ends, killed without a word included, its workers end with it.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import pickle
import signal
import sys
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from types import FrameType, ModuleType
from typing import Any, ClassVar

from hfsim.errors import HfsimError

_GRACE = 2.0
"""Time a worker gets beyond its limit to end by itself [s]; then it is ended."""
_LISTEN = 1.0
"""Longest wait for workers [s]: a signal that comes just before a wait does not end it."""
_AHEAD = 2
"""Jobs that are kept ready for each worker, of those that are made as they are needed."""


class JobLostError(HfsimError):
    """A job without result, where all are needed."""


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
    tries : int
        How often it is begun where workers are lost with it.
    """

    key: Any
    function: Callable[[Any], Any]
    argument: Any
    limit: float = float("inf")
    tries: int = 1


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
class Executor(ABC):
    """A queue of tasks and those that serve it.

    Attributes
    ----------
    jobs : int
        Tasks at a time.
    deadline : float
        Reading of ``time.perf_counter`` at which all is ended [s].
    interrupted : bool
        Whether a signal has ended `serve`.
    patient : bool
        Whether the deadline does not count yet: tasks have limits of their own.
    lost : str
        What else has ended it; empty if nothing has.
    """

    elsewhere: ClassVar[bool] = True
    """Whether jobs are done in other processes."""

    jobs: int
    deadline: float = float("inf")
    interrupted: bool = False
    patient: bool = False
    lost: str = ""
    _queue: deque[Task] = field(default_factory=deque)
    _more: Iterator[Task] = field(default_factory=lambda: iter(()))

    def add(self, task: Task, first: bool = False) -> None:
        """Queue a task, at the end or (`first`) before all others."""
        if first:
            self._queue.appendleft(task)
        else:
            self._queue.append(task)

    def feed(self, tasks: Iterable[Task]) -> None:
        """Let tasks come after those that are queued, each made when it is needed: there may be very many."""
        self._more = iter(tasks)

    def results(
        self, function: Callable[[Any], Any], arguments: Iterable[Any]
    ) -> Generator[tuple[int, Any], None, None]:
        """Yield what a function makes of some arguments, each with its number, as it comes in.

        Raises
        ------
        JobLostError
            If there is no result of one.
        KeyboardInterrupt
            If a signal ends that.
        """
        self.feed(Task(number, function, argument) for number, argument in enumerate(arguments))
        with closing(self.outcomes()) as outcomes:
            for outcome in outcomes:
                if outcome.lost:
                    raise JobLostError(outcome.lost)
                yield outcome.key, outcome.value

    @abstractmethod
    def outcomes(self) -> Generator[Outcome, None, None]:
        """Serve the queue, also what is added meanwhile; yield outcomes as they come in.

        Ends when nothing is left or the deadline has come; what had no result by then is `unreached`.
        """

    def serve(self, take: Callable[[Outcome], None]) -> None:
        """Hand every outcome to a function as it comes in; a signal ends that, and is noted."""
        try:
            with closing(self.outcomes()) as outcomes:
                for outcome in outcomes:
                    take(outcome)
        except KeyboardInterrupt:
            self.interrupted = True

    def unreached(self) -> list[Any]:
        """Return the keys of tasks that were queued and still waiting, or cut off, at the end."""
        return [task.key for task in self._queue]

    @property
    def end(self) -> float:
        """The deadline, if it counts."""
        return float("inf") if self.patient else self.deadline

    @property
    def why_unreached(self) -> str:
        """Why there are any."""
        return self.lost or ("interrupted" if self.interrupted else "the budget was used up")

    def _next(self) -> Task | None:
        """Take the next task from the queue; None if there is none."""
        while len(self._queue) < self.jobs * _AHEAD and (task := next(self._more, None)) is not None:
            self._queue.append(task)
        return self._queue.popleft() if self._queue else None


@dataclass
class Here(Executor):
    """The process itself, a job at a time: nothing disturbs what is timed, and signals reach jobs."""

    elsewhere = False
    jobs: int = 1

    def outcomes(self) -> Generator[Outcome, None, None]:
        """Serve the queue; see `Executor.outcomes`. What a job raises is raised."""
        while time.perf_counter() < self.end and (task := self._next()) is not None:
            yield Outcome(task.key, task.function(task.argument))


@dataclass
class _Worker:
    process: Any
    pipe: Any
    task: Task | None = None
    function: Callable[[Any], Any] | None = None
    end: float = float("inf")


@dataclass
class Farm(Executor):
    """Processes of this machine; ``jobs`` is how many."""

    _workers: list[_Worker] = field(default_factory=list)

    def outcomes(self) -> Generator[Outcome, None, None]:
        """Serve the queue; see `Executor.outcomes`."""
        try:
            while time.perf_counter() < self.end:
                self._hand_out()
                if not any(worker.task for worker in self._workers):
                    return
                yield from self._finished()
        finally:
            self._stop()

    def _hand_out(self) -> None:
        """Give every worker that has none a task; there are no more workers than tasks."""
        while True:
            idle = next((worker for worker in self._workers if worker.task is None), None)
            if idle is None and len(self._workers) >= self.jobs:
                return
            task = self._next()
            if task is None:
                return
            worker = idle or self._hire()
            worker.task, worker.end = task, time.perf_counter() + task.limit + _GRACE
            with suppress(BrokenPipeError):  # it has died meanwhile, which shows when its answer is read
                again = task.function is worker.function  # with all that it holds
                worker.pipe.send((None if again else task.function, task.argument))
                worker.function = task.function

    def _hire(self) -> _Worker:
        forks = "fork" in multiprocessing.get_all_start_methods() and not _others_at_work()
        context: Any = multiprocessing.get_context("fork" if forks else "spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs,), daemon=True)
        with nullcontext() if forks else _without_script():
            process.start()
        theirs.close()
        self._workers.append(_Worker(process, ours))
        return self._workers[-1]

    def _finished(self) -> Iterator[Outcome]:
        now = time.perf_counter()
        busy = [worker for worker in self._workers if worker.task is not None]
        soonest = min([self.end, *(worker.end for worker in busy)])
        ready = multiprocessing.connection.wait(
            [worker.pipe for worker in busy], min(max(soonest - now, 0.0), _LISTEN)
        )
        for worker in busy:
            if worker.pipe in ready:
                yield from self._collect(worker)
            elif time.perf_counter() >= worker.end and (task := worker.task):
                self._dismiss(worker)
                yield Outcome(task.key, lost=f"no answer within {task.limit:.3g} s")

    def _collect(self, worker: _Worker) -> Iterator[Outcome]:
        task = worker.task
        assert task is not None
        try:
            value, lost = worker.pipe.recv()
        except (EOFError, ConnectionError):
            worker.process.join(_GRACE)
            why = _death(worker.process.exitcode)
            self._dismiss(worker)
            if task.tries > 1:  # once more
                self._queue.appendleft(replace(task, tries=task.tries - 1))
            else:
                yield Outcome(task.key, lost=why)
            return
        worker.task = None
        yield Outcome(task.key, value, lost)

    def _dismiss(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.pipe.close()
        worker.process.join(0.0)
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join(_GRACE)

    def _stop(self) -> None:
        """End all workers and put what they had back into the queue."""
        for worker in reversed(list(self._workers)):
            if worker.task is not None:
                self._queue.appendleft(worker.task)
            self._dismiss(worker)


def _others_at_work() -> bool:
    """Tell whether other threads are within hfsim: a fork would leave their locks closed for ever."""
    for thread, frame in sys._current_frames().items():
        within: FrameType | None = frame
        while within is not None and thread != threading.get_ident():
            if within.f_globals.get("__name__", "").partition(".")[0] == __name__.partition(".")[0]:
                return True
            within = within.f_back
    return False


_SCRIPT = threading.Lock()
"""Held while the script is out of the way: another thread would take what stands in for it for the script."""


@contextmanager
def _without_script() -> Iterator[None]:
    """Let processes that begin anew not run the script of this one: nothing of it is needed there."""
    with _SCRIPT:
        script = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = script


def _death(code: int | None) -> str:
    if code is not None and code < 0:
        return f"the worker was ended by signal {-code} ({signal.strsignal(-code)})"
    return f"the worker ended without an answer (exit code {code})"


def _serve(pipe: Any) -> None:
    """Do one job after the other."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the study decides what an interrupt ends
    threading.Thread(target=end_with_parent, daemon=True).start()
    function: Any = None
    with suppress(EOFError, ConnectionError):
        while True:
            other, argument = pipe.recv()
            function = other or function
            pipe.send_bytes(_answer(function, argument))


def _answer(function: Callable[[Any], Any], argument: Any) -> bytes:
    """Return the pickled result of a job, and why there is none: what goes wrong is an answer too."""
    try:
        return pickle.dumps(attempt(function, argument))
    except Exception as error:
        return pickle.dumps((None, f"{type(error).__name__}: {error}"))


def attempt(function: Callable[[Any], Any], argument: Any) -> tuple[Any, str]:
    """Return what a function makes of an argument, and why that is nothing; empty if it is something."""
    try:
        return function(argument), ""
    except MemoryError:
        return None, "not enough memory"
    except Exception as error:
        return None, f"{type(error).__name__}: {error}"


def end_with_parent() -> None:
    """End this process as soon as the one that started it is gone, whatever has ended that."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
