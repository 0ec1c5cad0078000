"""Processes that compute, each for itself: one that is killed, runs out of memory or hangs loses what it was at, no more."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import Enum
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from threading import Thread
from typing import Any, Self

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

PATIENCE = 600.0
"""[s] without a sign of life after which a process that computes is taken to hang. It gives one when its model is built and
every hundred steps."""

TICK = 1.0
"""[s] between two looks at who is silent. A computer that sleeps meanwhile makes nobody silent for longer than twice this."""

MOST_STILLBORN = 10
"""Processes that are killed before they are ready, one after the other, before no further one is started."""

_SPAWN = get_context("spawn")

Function = Callable[[Any, Callable[[int], None]], Any]
"""What the processes compute: of a task, telling how far it has come."""


@dataclass(frozen=True)
class Broken:
    """Why the process that computed something has ended."""

    reason: str


def _in_words(exit_code: int) -> str:
    """How a process ended."""
    if exit_code >= 0:
        return f"ended with exit code {exit_code}"
    name = next((known.name for known in signal.Signals if known == -exit_code), f"signal {-exit_code}")
    return f"was killed ({name}{', as the system does where memory runs out' if name == 'SIGKILL' else ''})"


class _Said(Enum):
    """What a process tells."""

    READY, PROGRESS, ANSWER, OUT_OF_MEMORY = range(4)


class StartError(RuntimeError):
    """Processes end before they compute anything."""


class Crew:
    """So many processes that compute a function. Use as a context: they end with it, wherever they are."""

    def __init__(self, size: int, function: Function, patience: float = PATIENCE) -> None:
        self._size, self._function, self._patience = size, function, patience
        self._members: list[_Member] = []
        self._stillborn = 0

    def __enter__(self) -> Self:
        self._fill()
        return self

    def __exit__(self, *_: object) -> None:
        for member in self._members:
            member.process.terminate()
        for member in self._members:
            member.end()

    def _fill(self) -> None:
        with _one_thread():
            while len(self._members) < self._size:
                self._members.append(_Member(self._function))

    @property
    def free(self) -> bool:
        """Whether a process waits for a task."""
        return any(member.ready and member.ticket is None for member in self._members)

    @property
    def busy(self) -> bool:
        """Whether a process computes."""
        return any(member.ticket is not None for member in self._members)

    def give(self, ticket: Any, task: Any) -> None:
        """Let a free process compute a task; `ticket` comes back with the answer."""
        member = next(member for member in self._members if member.ready and member.ticket is None)
        member.ticket, member.silent = ticket, 0.0
        with suppress(OSError):  # it has just ended: `answers` will say so
            member.pipe.send(task)

    def answers(self, tell: Callable[[Any, int], None]) -> Iterator[tuple[Any, Any]]:
        """Tickets with answers or `Broken`, as they come within a second; `tell` hears of progress.

        An OSError that a process met is raised here: it concerns all of them. StartError where they end at their start.
        """
        began = time.monotonic()
        talking = wait([member.pipe for member in self._members], TICK)
        elapsed = min(time.monotonic() - began, 2 * TICK)
        for member in list(self._members):
            member.silent += elapsed
            if member.pipe in talking:
                yield from self._heard(member, tell)
            elif member.ticket is not None and member.silent > self._patience:
                member.process.kill()
                yield from self._lost(member, f"gave no sign of life for {self._patience:g} s")
        self._fill()

    def _heard(self, member: "_Member", tell: Callable[[Any, int], None]) -> Iterator[tuple[Any, Any]]:
        try:
            kind, content = member.pipe.recv()
        except (EOFError, OSError):
            yield from self._lost(member, "")
            return
        member.silent, member.ready = 0.0, True
        if kind is _Said.PROGRESS:
            tell(member.ticket, content)
        elif kind is _Said.OUT_OF_MEMORY:
            yield from self._lost(member, content)
        elif kind is _Said.ANSWER:
            ticket, member.ticket = member.ticket, None
            if isinstance(content, OSError):
                raise content
            yield ticket, content

    def _lost(self, member: "_Member", reason: str) -> Iterator[tuple[Any, Any]]:
        self._members.remove(member)
        code = member.end()
        self._stillborn = 0 if member.ready else self._stillborn + 1
        if not member.ready and (code >= 0 or self._stillborn > MOST_STILLBORN):
            raise StartError(f"a process that computes {_in_words(code)} at its start")
        if member.ticket is not None:
            yield member.ticket, Broken(reason or _in_words(code))


class _Member:
    """One process: what it is at, and for how long [s] it has said nothing."""

    def __init__(self, function: Function) -> None:
        self.pipe, theirs = _SPAWN.Pipe()
        self.process = _SPAWN.Process(target=_serve, args=(theirs, function), daemon=True)
        self.process.start()
        theirs.close()
        self.ready, self.ticket, self.silent = False, None, 0.0

    def end(self) -> int:
        """Exit code, once it has ended; it is killed where it does not by itself."""
        self.pipe.close()
        self.process.join(TICK)
        if self.process.exitcode is None:
            self.process.kill()
            self.process.join()
        return self.process.exitcode or 0


def _serve(pipe: Connection, function: Function) -> None:
    """What a process does: it computes what comes, until nobody is there to ask. It ends after it has run out of memory."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one that asks decides what an interrupt ends
    Thread(target=_end_with_the_parent, daemon=True).start()
    pipe.send((_Said.READY, None))
    with suppress(EOFError, ConnectionError):
        while True:
            try:
                answer = function(pipe.recv(), lambda steps: pipe.send((_Said.PROGRESS, steps)))
            except MemoryError as error:
                pipe.send((_Said.OUT_OF_MEMORY, out_of_memory(error)))
                return
            except OSError as error:
                answer = error
            pipe.send((_Said.ANSWER, answer))


def out_of_memory(error: MemoryError) -> str:
    """In words."""
    return f"ran out of memory{f': {error}' if str(error) else ''}"


def _end_with_the_parent() -> None:
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Processes started inside find one thread for linear algebra in their environment."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
