"""A march made of its steps, without what `simulate` reads from them."""

from itertools import pairwise

from engine import Lanes, State, Stepper, equilibrium, natural_frequencies
from engine.kernels.loop import commit_step, solve_step


def marched_by_hand(stepper: Stepper, lanes: Lanes) -> list[State]:
    """The static state and that after every step, the standing loads applied at once; no step may need to be halved."""
    state, found = equilibrium(stepper.system, lanes, [lanes.standing], natural_frequencies(stepper.system, 1)[0])
    assert found.all()
    stepper.start(state, lanes, lanes.ground[0])
    states, drive = [state.copy()], lanes.drive(stepper.system)
    stepper.prepare(state)
    for before, after in pairwise(lanes.ground):
        pots = stepper.dashpots(state, lanes)
        assert not solve_step(stepper.of, drive, after, pots, state.motion, state.contact)
        commit_step(stepper.of, drive, before, after, state.motion, state.contact, state.energy)
        states.append(state.copy())
    return states
