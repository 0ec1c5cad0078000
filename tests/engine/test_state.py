"""State and lanes: shapes, copies, padding."""

import numpy as np
import pytest

from engine import LANES, Constraints, JointMaterial, Lanes, Material, State, System, build_system


@pytest.fixture(scope="module")
def system(block_mesh) -> System:
    held = Constraints.free(block_mesh).holding(block_mesh.boundaries["base"], (0, 1))
    return build_system(block_mesh, [Material(2e3, 0.25, 1.8), Material(3e4, 0.2, 2.5)], [JointMaterial(4e4, 2e4, 0.4)], held)


@pytest.fixture
def state(system) -> State:
    """Every entry a number of its own."""
    state = State.at_rest(system)
    rng = np.random.default_rng(1)
    for array in (*state.motion, *state.contact, state.energy):
        array[...] = rng.integers(1, 100, array.shape)
    return state


def all_arrays(state: State) -> list[tuple[np.ndarray, bool]]:
    """Every array, and whether its lanes are the last axis."""
    return [*((x, True) for x in (*state.motion, state.energy)), *((x, False) for x in state.contact)]


def test_rest_is_zero_and_of_the_shapes_the_kernels_take(system):
    state = State.at_rest(system)
    n, m = system.n_dof, len(system.points)
    assert {x.shape for x in state.motion} == {(n, LANES)}
    assert [x.shape for x in state.contact] == [(LANES, 2 * m)] * 3 + [(LANES, m)] * 3
    assert state.contact.state.dtype == np.int8
    assert state.energy.shape == (8, LANES)
    assert not any(x.any() for x, _ in all_arrays(state))
    assert len({id(x) for x, _ in all_arrays(state)}) == 10  # no array stands for two


def test_copy_is_independent(state):
    copy = state.copy()
    for (x, _), (y, _) in zip(all_arrays(state), all_arrays(copy), strict=True):
        np.testing.assert_array_equal(x, y)
        assert not np.shares_memory(x, y)


def test_alone_puts_one_lane_first_and_nothing_beside_it(state):
    alone = state.alone(3)
    for (x, last), (y, _) in zip(all_arrays(state), all_arrays(alone), strict=True):
        lanes, own = (np.moveaxis(a, -1, 0) if last else a for a in (x, y))
        np.testing.assert_array_equal(own[0], lanes[3])
        assert not own[1:].any()
        assert x.dtype == y.dtype
        assert y.flags.c_contiguous


def test_put_overwrites_one_lane(state, system):
    before, other = state.copy(), State.at_rest(system)
    other.motion.u[:, 2], other.contact.gap[2], other.energy[:, 2] = 7.0, 8.0, 9.0
    state.put(5, other, source=2)
    for (x, last), (old, _), (new, _) in zip(all_arrays(state), all_arrays(before), all_arrays(other), strict=True):
        found, kept, put = (np.moveaxis(a, -1, 0) if last else a for a in (x, old, new))
        np.testing.assert_array_equal(found[5], put[2])
        np.testing.assert_array_equal(np.delete(found, 5, axis=0), np.delete(kept, 5, axis=0))


def test_alone_and_put_undo_each_other(state):
    before = state.copy()
    state.put(4, before.alone(4))
    for (x, _), (y, _) in zip(all_arrays(state), all_arrays(before), strict=True):
        np.testing.assert_array_equal(x, y)


def test_lanes_put_cases_side_by_side_and_pad(system):
    """Motions of unequal length are padded with rest; padded lanes carry no load and a harmless law."""
    n = system.n_dof
    loads = [np.full(n, 1.0), np.full(n, 2.0), np.full(n, 3.0)]
    laws = [system.joint_law([JointMaterial(k, k / 2, 0.1)]) for k in (1.0, 2.0, 3.0)]
    motions = [np.full((length, 2), [length, -length]) for length in (4, 7, 2)]
    lanes = Lanes.of(loads, laws, motions)
    assert lanes.n_lane == 3
    assert lanes.standing.shape == (n, LANES)
    assert lanes.ground.shape == (7, 2, LANES)
    for lane in range(3):
        np.testing.assert_array_equal(lanes.standing[:, lane], loads[lane])
        for array, value in zip(lanes.law, laws[lane], strict=True):
            np.testing.assert_array_equal(array[lane], value)
        length = len(motions[lane])
        np.testing.assert_array_equal(lanes.ground[:length, :, lane], motions[lane])
        assert not lanes.ground[length:, :, lane].any()
    assert not lanes.standing[:, 3:].any()
    assert not lanes.ground[:, :, 3:].any()
    assert all((array[3:] == 1.0).all() for array in lanes.law)


def test_one_lane_by_itself(system):
    loads = [np.full(system.n_dof, float(i)) for i in range(4)]
    laws = [system.joint_law([JointMaterial(k, k / 2, 0.1)]) for k in (1.0, 2.0, 3.0, 4.0)]
    alone = Lanes.of(loads, laws, [np.ones((3, 2))] * 4).alone(2)
    assert alone.n_lane == 1
    np.testing.assert_array_equal(alone.standing[:, 0], 2.0)
    assert not alone.standing[:, 1:].any()
    for array, value in zip(alone.law, laws[2], strict=True):
        np.testing.assert_array_equal(array[0], value)
        np.testing.assert_array_equal(array[1:], 1.0)
    assert alone.ground.shape == (0, 2, LANES)


def test_kernels_take_the_lanes_own_arrays(system):
    """Nothing is copied: what is changed in the lanes drives them from then on."""
    lanes = Lanes.of([np.ones(system.n_dof)] * 2, [system.joint_law()] * 2, [np.ones((3, 2))] * 2)
    drive = lanes.drive(system)
    assert drive.loads.standing is lanes.standing
    assert drive.loads.inertia is system.inertia
    assert drive.law is lanes.law
    assert drive.ground is lanes.ground
    assert drive.n_lane == 2


@pytest.mark.parametrize("count", [0, LANES + 1])
def test_batch_of_a_wrong_size_is_refused(system, count):
    with pytest.raises(ValueError, match=f"a batch holds 1 to {LANES} cases, not {count}"):
        Lanes.of([np.zeros(system.n_dof)] * count, [system.joint_law()] * count, [np.zeros((2, 2))] * count)


def test_lists_of_unequal_length_are_refused(system):
    with pytest.raises(ValueError, match="zip"):
        Lanes.of([np.zeros(system.n_dof)] * 2, [system.joint_law()], [np.zeros((2, 2))] * 2)
