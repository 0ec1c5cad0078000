"""The short form of `make torture`."""

from tests.torture import torture


def test_a_run_that_is_killed_and_started_again_gives_the_bits_of_one_in_peace(tmp_path):
    found = torture(tmp_path, kills=4, batches=5, seed=3)
    assert found.killed.total() == 4
    assert found.batches == 5 <= found.begun
