"""Processes on many machines that compute: the workers of a dask scheduler, with the interface of `pool.Crew`.

A task goes to one worker and to no other, so that a worker that is lost loses what it was at, no more, and whoever asked
decides what to do then. What a task gives is sent back: workers write nothing.
"""

import asyncio
import ctypes
import logging
import os
import pickle
import re
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Self
from uuid import uuid4

from engine import compile_kernels

from .pool import PATIENCE, TICK, Broken, Function, out_of_memory
from .provenance import computer

if TYPE_CHECKING:
    from distributed import Client, Future, Worker

CONNECT = 5.0
"""[s] within which a scheduler must answer."""

TELL = 0.5
"""[s] between two tellings of progress: those of all workers pass through one scheduler."""

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
"""Of glibc's malloc.h."""

BEGUN, DONE = -1, -2
"""What is said of a task beside the steps that it has come further."""

ADDRESS = re.compile(r"(tcp|tls)://[^/]+:\d+")

LEFT = "left the cluster: it was killed, ran out of memory or was cut off"

log = logging.getLogger(__name__)


class ClusterError(RuntimeError):
    """There is no cluster, or none of its workers can compute what is asked for."""


class _WithdrawnError(Exception):
    """Nobody waits for the task any more."""


@dataclass
class _Member:
    """A worker and what it is asked: first who it is, then, once it is `ready`, one task after the other.

    unfit : why it gets no tasks
    begun, silent : whether it is at its task, and for how long [s] it has said nothing
    """

    asked: "Future | None" = None
    ready: bool = False
    unfit: str = ""
    ticket: Any = None
    begun: bool = False
    silent: float = 0.0


class Cluster:
    """The workers of a scheduler, also those that come later. Use as a context: at its end they drop what they are at."""

    def __init__(self, address: str, function: Function, patience: float = PATIENCE) -> None:
        self._address, self._function, self._patience = address, function, patience
        self._topic = f"coralquake-{uuid4().hex}"
        self._members: dict[str, _Member] = {}
        self._finished: deque[tuple[Any, Any]] = deque()
        self._said: SimpleQueue[tuple[str, int]] = SimpleQueue()
        self._next_look, self._waiting = 0.0, False

    def __enter__(self) -> Self:
        """ClusterError where no scheduler answers."""
        self._client = _connected(self._address)
        self._client.subscribe_topic(self._topic, lambda event: self._said.put(event[1]))
        return self

    def __exit__(self, *_: object) -> None:
        asked = [member.asked for member in self._members.values() if member.asked is not None]
        with _quiet(), suppress(OSError):  # where the scheduler has gone, that has been said
            if self._client.status == "running":
                self._client.cancel(asked)
            self._client.close()

    @property
    def free(self) -> bool:
        """Whether a worker waits for a task."""
        return any(member.ready and member.asked is None for member in self._members.values())

    @property
    def busy(self) -> bool:
        """Whether a worker computes, or an answer waits to be taken."""
        return bool(self._finished) or any(member.ready and member.asked is not None for member in self._members.values())

    def give(self, ticket: Any, task: Any) -> None:
        """Let a free worker compute a task; `ticket` comes back with the answer."""
        address, member = next((a, m) for a, m in self._members.items() if m.ready and m.asked is None)
        member.ticket, member.begun, member.silent = ticket, False, 0.0
        member.asked = self._ask(address, _serve, pickle.dumps((self._function, task)), self._topic)

    def answers(self, tell: Callable[[Any, int], None]) -> Iterator[tuple[Any, Any]]:
        """Tickets with answers or `Broken`, as they come within a second; `tell` hears of progress.

        A worker whose answer is fetched is free: it need not wait for its next task until that answer is taken and written.
        ClusterError where no worker can compute; OSError where the scheduler has gone.
        """
        began = time.monotonic()
        try:
            yield from self._heard(*self._said.get(timeout=0 if self._finished else TICK), tell)
        except Empty:
            if self._finished:
                yield self._finished.popleft()
        elapsed = min(time.monotonic() - began, 2 * TICK)
        for address, member in self._members.items():
            member.silent += elapsed
            if member.begun and member.silent > self._patience:
                yield from self._hung(address, member)
        if time.monotonic() >= self._next_look:
            yield from self._look()
            self._next_look = time.monotonic() + TICK

    def _ask(self, address: str, function: Callable, *arguments: Any) -> "Future":
        import dask

        with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 TiB"}):  # a task brings its motions
            future = self._client.submit(function, *arguments, workers=[address], allow_other_workers=False, pure=False)
        future.add_done_callback(lambda done: self._said.put((done.key, DONE)))
        return future

    def _heard(self, key: str, steps: int, tell: Callable[[Any, int], None]) -> Iterator[tuple[Any, Any]]:
        at_it = [(a, m) for a, m in self._members.items() if m.asked is not None and m.asked.key == key]
        for address, member in at_it:
            member.silent = 0.0
            if steps == DONE:
                self._done(address, member)
            elif steps != BEGUN:
                tell(member.ticket, steps)
            elif member.begun:  # again, in a process that took the place of the one before
                yield from self._lost(member, LEFT)
            else:
                member.begun = True

    def _done(self, address: str, member: _Member) -> None:
        """Fetch what a worker has before it gets the next task: one that is lost then loses no answer."""
        assert member.asked is not None
        answer = self._fetched(address, member.asked)
        if member.ready:
            self._finished.append((self._released(member), answer))
            member.ready = answer != Broken(LEFT)  # otherwise it is asked anew who it is, where it is still there
        else:
            member.asked = None
            self._judge(address, member, answer)

    def _begun(self, work: Any) -> Any:
        """The future of a coroutine, in the client's own thread."""
        loop: Any = self._client.loop
        return asyncio.run_coroutine_threadsafe(work, loop.asyncio_loop)

    def _fetched(self, address: str, future: "Future") -> Any:
        """What a worker that is done has sent, or `Broken`."""
        from distributed import CancelledError, KilledWorker

        fetching = self._begun(self._client.gather(future, asynchronous=True))
        while True:
            try:
                return fetching.result(TICK)
            except TimeoutError:
                if fetching.done() or address not in self._present():
                    fetching.cancel()
                    return Broken(LEFT)
            except (KilledWorker, CancelledError):
                self._present()  # or else it is the scheduler that has gone
                return Broken(LEFT)
            except Exception as error:  # where a task is unpacked, among other things
                return Broken(f"met {type(error).__name__}: {error}")

    def _judge(self, address: str, member: _Member, answer: Mapping[str, str] | Broken) -> None:
        """Take a worker in that computes the bits that this process would; name the others. One that has left is no matter."""
        member.ready = answer == computer()
        if not member.ready and answer != Broken(LEFT):
            member.unfit = answer.reason if isinstance(answer, Broken) else _differences(answer)
            self._leave_out(address, member)

    def _leave_out(self, address: str, member: _Member) -> None:
        """Say why a worker gets no tasks. ClusterError where no other one is left."""
        said = f"worker {address}: {member.unfit}"
        if all(member.unfit for member in self._members.values()):
            raise ClusterError(said)
        log.warning("%s; it is left out", said)

    def _look(self) -> Iterator[tuple[Any, Any]]:
        """Notice workers that have come and gone."""
        present = self._present()
        for address in self._members.keys() - present.keys():
            yield from self._lost(self._members.pop(address), LEFT)
        for address in present.keys() - self._members.keys():
            self._members[address] = _Member()
        for address, member in self._members.items():
            if member.asked is None and not member.ready and not member.unfit:
                self._welcome(address, member, present[address])
        if not present and not self._waiting:
            log.warning("scheduler %s: has no workers; waiting for the first", self._address)
        self._waiting = not present

    def _welcome(self, address: str, member: _Member, threads: int) -> None:
        if threads == 1:
            member.asked = self._ask(address, _presented, computer())
        else:
            member.unfit = f"has {threads} threads, must have one (dask worker --nthreads 1)"
            self._leave_out(address, member)

    def _present(self) -> Mapping[str, int]:
        """Number of threads of each worker that is there."""
        import dask

        try:
            with dask.config.set({"distributed.comm.timeouts.connect": CONNECT}):
                if self._client.status == "running":
                    return self._client.nthreads()
        except OSError:
            pass
        raise OSError(None, f"the scheduler {self._address} no longer answers")

    def _hung(self, address: str, member: _Member) -> Iterator[tuple[Any, Any]]:
        """End a worker's process; dask's nanny starts another one, where there is a nanny."""
        ending = self._client.run(os._exit, 1, workers=[address], on_error="ignore", asynchronous=True)
        with suppress(OSError):  # a TimeoutError is one
            self._begun(ending).result(CONNECT)
        reason = f"gave no sign of life for {self._patience:g} s"
        yield from self._lost(member, reason)
        member.ready, member.unfit = False, reason

    def _lost(self, member: _Member, reason: str) -> Iterator[tuple[Any, Any]]:
        if member.ready and member.asked is not None:
            member.asked.cancel()
            yield self._released(member), Broken(reason)

    @staticmethod
    def _released(member: _Member) -> Any:
        """The ticket of a worker, which is free now."""
        ticket, member.ticket, member.asked, member.begun = member.ticket, None, None, False
        return ticket


def _connected(address: str) -> "Client":
    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise ClusterError('a scheduler needs dask.distributed: pip install "coralquake[cluster]"') from None
    if not ADDRESS.fullmatch(address):
        raise ClusterError(f"scheduler {address!r}: must be an address as tcp://host:8786")
    try:
        return Client(address, timeout=CONNECT, set_as_default=False)
    except OSError:
        raise ClusterError(f"scheduler {address}: does not answer within {CONNECT:g} s") from None


@contextmanager
def _quiet() -> Iterator[None]:
    """The client says nothing inside."""
    its_log = logging.getLogger("distributed.client")
    before = its_log.level
    its_log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        its_log.setLevel(before)


def _differences(theirs: Mapping[str, str]) -> str:
    """What computes other bits there."""
    pairs = (f"{name} {theirs[name]}, here {here}" for name, here in computer().items() if theirs[name] != here)
    return f"would compute other bits: {'; '.join(pairs)}"


# on a worker ------------------------------------------------------------------------------------------------------------------


def _presented(asking: Mapping[str, str]) -> Mapping[str, str]:
    """What decides bits here; where it is as there, the kernels are compiled, once a process."""
    if computer() == asking:
        _keep_memory()
        compile_kernels()
    return computer()


def _keep_memory() -> None:
    """Let glibc keep the memory of arrays for the next ones, up to what it would find by itself.

    Dask has it given back at once, and a batch pays for that with 50,000 page faults, a tenth of its time.
    """
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "mallopt"):
        libc.mallopt(M_MMAP_THRESHOLD, 32 * 2**20)
        libc.mallopt(M_TRIM_THRESHOLD, 64 * 2**20)


@contextmanager
def _unsampled(worker: "Worker") -> Iterator[None]:
    """Dask does not look inside, a hundred times a second, where a worker is: that takes a tenth of its time."""
    sampling = worker.periodic_callbacks.get("profile")
    if sampling is None:
        yield
        return
    worker.loop.add_callback(sampling.stop)
    try:
        yield
    finally:
        worker.loop.add_callback(sampling.start)


def _serve(packed: bytes, topic: str) -> Any:
    """Compute what comes, unpacked here and not by the scheduler; what this machine lacks is no fault of the others."""
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()

    steps_since, next_telling = 0, 0.0

    def tell(steps: int) -> None:
        nonlocal steps_since, next_telling
        if worker.state.tasks[key].state != "executing":
            raise _WithdrawnError
        steps_since += steps
        if time.monotonic() >= next_telling:
            worker.log_event(topic, (key, steps_since))
            steps_since, next_telling = 0, time.monotonic() + TELL

    worker.log_event(topic, (key, BEGUN))
    try:
        with _unsampled(worker):
            function, task = pickle.loads(packed)
            return function(task, tell)
    except MemoryError as error:
        return Broken(out_of_memory(error))
    except OSError as error:
        return Broken(f"met an error of its machine: {error}")
