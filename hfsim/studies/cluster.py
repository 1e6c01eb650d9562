"""Jobs on a cluster, by dask.distributed: decks and results travel, no file system is shared.

Workers need hfsim, of the version that the client has; each does one job at a time.  The scheduler sees to it
that jobs of one that dies are done by others.
"""

from __future__ import annotations

import platform
import threading
import time
import uuid
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml

from hfsim import __version__
from hfsim.deck.files import sent
from hfsim.errors import HfsimError
from hfsim.studies.farm import Executor, Farm, Here, Outcome, Task, attempt

_CONNECT = 20.0
"""Time in which a scheduler answers [s]."""
_LOOK = 5.0
"""Time between two looks at how many workers there are [s]."""
_POLL = 0.005
"""Time between two looks for results, of which as many again are under way [s]."""
_ANEW = ("lost", "pending")
"""States of a job whose result was lost with its worker: the scheduler has it computed anew."""
_LOUD = ("distributed", "tornado", "asyncio")
"""Whose messages are not of hfsim."""
_ONE_RUN = threading.Lock()


class ClusterError(HfsimError):
    """A cluster that cannot be used as it is."""

    exit_code = 2


class ClusterLost(HfsimError):  # noqa: N818
    """The scheduler is gone."""

    exit_code = 5


@dataclass(frozen=True)
class Workers:
    """Where jobs are done.

    Attributes
    ----------
    jobs : int
        Processes at a time, on this machine.
    dask : str
        ``local`` for processes of dask, the address of a scheduler, or empty for plain processes.
    config : Path or None
        File that says which cluster is to be started.
    """

    jobs: int
    dask: str = ""
    config: Path | None = None

    @contextmanager
    def executor(self, texts: Mapping[str, str] | None = None, timing: bool = False) -> Iterator[Executor]:
        """Yield what does jobs until the end of the block.

        Parameters
        ----------
        texts : mapping of str to str, optional
            Files that jobs read, by their names: they go with the jobs.
        timing : bool
            Whether jobs measure times: a single one at a time is done by this process.

        Raises
        ------
        ClusterError
            If there is no such cluster.
        """
        if not self.dask and self.config is None:
            yield Here() if timing and self.jobs == 1 else Farm(self.jobs)
            return
        _distributed()
        with _quiet(), self._client() as client:
            yield Cluster(self.jobs, client=client, texts=dict(texts or {}))

    @contextmanager
    def _client(self) -> Iterator[Any]:
        distributed = _distributed()
        if self.config is not None:
            with _started(self.config) as cluster, distributed.Client(cluster) as client:
                yield client
        elif self.dask == "local":
            options = {"threads_per_worker": 1, "processes": True, "dashboard_address": None}
            with (
                distributed.LocalCluster(n_workers=self.jobs, **options) as cluster,
                distributed.Client(cluster) as client,
            ):
                yield client
        else:
            try:
                client = distributed.Client(self.dask, timeout=_CONNECT)
            except (OSError, TimeoutError, ValueError) as error:
                raise ClusterError(f"no scheduler answers at {self.dask}: {error}") from None
            with client:
                yield client


def _distributed() -> Any:
    try:
        return import_module("distributed")
    except ImportError:
        raise ClusterError("--dask needs dask.distributed: pip install 'hfsim[cluster]'") from None


@contextmanager
def _quiet() -> Iterator[None]:
    """Let the libraries say nothing of workers that come and go."""
    import logging

    names = [name for name in logging.root.manager.loggerDict if name.split(".")[0] in _LOUD]
    levels = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


def _started(path: Path) -> Any:
    """Start what a file describes: a class ``cluster``, ``options``, ``workers``; raise `ClusterError`."""
    try:
        said = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ClusterError(f"{path} cannot be read: {error}") from None
    known = {"cluster", "options", "workers"}
    if not isinstance(said, dict) or not isinstance(said.get("cluster"), str) or set(said) - known:
        example = "cluster: dask_jobqueue.SLURMCluster, options: {...}, workers: 20"
        raise ClusterError(f"{path}: write {example}")
    module, _, name = said["cluster"].rpartition(".")
    try:
        made = getattr(import_module(module), name)(**(said.get("options") or {}))
        made.scale(int(said.get("workers", 1)))
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        raise ClusterError(f"{path}: {said['cluster']}: {error}") from None
    return made


@dataclass
class Cluster(Executor):
    """Workers of dask.distributed; ``jobs`` is as many as there are.

    Attributes
    ----------
    texts : dict of str to str
        Files that go with the jobs.
    """

    client: Any = None
    texts: dict[str, str] = field(default_factory=dict)
    _looked: float = float("-inf")

    def outcomes(self) -> Generator[Outcome, None, None]:
        """Serve the queue; see `Executor.outcomes`."""
        distributed, under_way = _distributed(), dict[str, tuple[Any, Task]]()
        pool = distributed.as_completed()
        try:
            while time.perf_counter() < self.end:
                while len(under_way) < 2 * self._count() and (task := self._next()) is not None:
                    own = (_versions(), self.texts, task.function, task.argument)
                    key = f"hfsim-{uuid.uuid4().hex}"
                    future = self.client.submit(_work, *own, key=key, pure=False)
                    under_way[future.key] = future, task
                    pool.add(future)
                if not under_way:
                    return
                if not pool.has_ready():
                    time.sleep(_POLL)
                    continue
                future = next(pool)
                if future.status in _ANEW:
                    pool.add(future)
                    continue
                outcome = self._taken(future, under_way[future.key][1])
                del under_way[future.key]
                yield outcome
        finally:
            self._queue.extendleft(task for _, task in reversed(under_way.values()))
            with suppress(Exception):
                self.client.cancel([future for future, _ in under_way.values()])

    def serve(self, take: Callable[[Outcome], None]) -> None:
        """Hand on outcomes; see `Executor.serve`. A scheduler that is lost ends that as a signal does."""
        try:
            super().serve(take)
        except ClusterLost as lost:
            self.interrupted, self.lost = True, str(lost)

    def _count(self) -> int:
        """Return how many workers there are, near enough."""
        if time.monotonic() >= self._looked + _LOOK:
            with suppress(Exception):
                self.jobs = max(1, len(self.client.nthreads()))
            self._looked = time.monotonic()
        return self.jobs

    def _taken(self, future: Any, task: Task) -> Outcome:
        if future.status == "finished":
            try:
                value, why, differences = future.result()
            except Exception as gone:  # what goes wrong with a job is a result
                raise ClusterLost(f"the scheduler was lost: {type(gone).__name__}") from gone
            if differences:
                raise ClusterError(f"a worker has other versions: {differences}")
            return Outcome(task.key, value, why)
        if future.status != "error":
            raise ClusterLost("the scheduler was lost")
        error = future.exception()
        if isinstance(error, ImportError):
            raise ClusterError(f"a worker cannot import what it needs: {error}")
        return Outcome(task.key, lost=f"workers died with it: {type(error).__name__}: {error}")


def _versions() -> dict[str, str]:
    numpy, scipy = import_module("numpy"), import_module("scipy")
    python = ".".join(platform.python_version_tuple()[:2])
    return {"hfsim": __version__, "numpy": numpy.__version__, "scipy": scipy.__version__, "python": python}


def _work(
    versions: Mapping[str, str], texts: Mapping[str, str], function: Callable[[Any], Any], argument: Any
) -> tuple[Any, str, str]:
    """Do a job in a worker: one at a time, however many threads it has; return also what versions differ."""
    own = _versions()
    differing = [f"{name} {own[name]}, not {value}" for name, value in versions.items() if own[name] != value]
    if differing:
        return None, "", f"{platform.node()}: {', '.join(differing)}"
    with _ONE_RUN, sent(texts):
        return *attempt(function, argument), ""
