"""The counter that compiled code reads."""

import numba
import pytest

from engine.kernels import clock
from engine.kernels.jit import FLAGS

PLAIN = bool(numba.config.DISABLE_JIT)


def read_often(n):
    """Counter before and after n readings; whether it ever went back."""
    first = last = clock.ticks()
    backwards = False
    for _ in range(n):
        now = clock.ticks()
        backwards = backwards or now < last
        last = now
    return first, last, backwards


def compiled(function):
    """Compiled now, with the counter the platform is said to have."""
    return numba.njit(**FLAGS)(function)


@pytest.mark.skipif(not (PLAIN or clock._HAS_COUNTER), reason="no counter that user programs may read")
def test_counter_goes_on_and_never_back():
    first, last, backwards = compiled(read_often)(100_000)
    assert last > first
    assert not backwards


@pytest.mark.skipif(not (PLAIN or clock._HAS_COUNTER), reason="no counter that user programs may read")
def test_ten_times_the_work_takes_longer():
    """The least of several: what interrupts a run only makes it longer."""
    read = compiled(read_often)
    short, long = (min(last - first for first, last, _ in (read(n) for _ in range(5))) for n in (1_000, 10_000))
    assert 0 < short < long


@pytest.mark.skipif(PLAIN, reason="plain Python has a clock everywhere")
def test_counter_stands_still_where_user_programs_may_not_read_it(monkeypatch):
    monkeypatch.setattr(clock, "_HAS_COUNTER", False)
    assert compiled(read_often)(10) == (0, 0, False)
