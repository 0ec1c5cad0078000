"""(D13): of cases whose loads differ by one factor one is solved, and the others are its response times that factor."""

import numpy as np
import pytest
import xarray as xr

from engine import Status
from studies import run_study
from studies.batch import Job, run_batch
from studies.plan import Batch
from studies.scaling import SAME
from studies.schema import SCHEMA

from .conftest import LOOSE, SHORT, study_of

LIGHT = SHORT + "[gravity]\nself_weight = false\n"
"""Without self-weight, so that pressure and motion are all the loads."""

UP = LIGHT.replace("[mesh]", 'vertical_record = "ridgecrest-2019-clc-up.AT2"\n[mesh]')
"""Shaken upwards too, by the factor of the horizontal motion."""

BY_ITSELF = {"base_acceleration", "peak_base_acceleration", "response_spectrum", "uplift_over_weight", "solved_as", "scaled_by"}

SINGLE = {name for name, variable in SCHEMA.items() if variable.single}

ROUNDING = {"residual", "source_test", "energy_error", "contact_drift"}
"""Differences of nearly equal numbers: what is left of them is rounding, which only a power of two leaves as it is."""


def solved(text):
    """For each case the one that is solved for it, and the factor."""
    scaling = study_of(text).scaling
    return scaling.solved_as.tolist(), scaling.scaled_by.tolist()


def count(text):
    return len(study_of(text).scaling.solved)


LOG_GRID = 'p0 = { from = "0.25 MPa", to = "4 MPa", num = 9, spacing = "log" }\n'
LOG_GRID += "scale = { from = 0.25, to = 4, num = 9, spacing = 'log' }\n"


# which cases are solved --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sweep", "n_case", "n_solved"),
    [
        (LOG_GRID, 81, 17),  # ratios 2^(k/2), k = -8 … 8
        (LOG_GRID + "damping_ratio = [0.02, 0.05]", 162, 34),  # within each damping
        (LOG_GRID + 'record = ["ridgecrest-2019-clc-360.AT2", "ridgecrest-2019-clc-090.AT2"]', 162, 34),
        (LOG_GRID + "layer.3.friction = [0.2, 0.4]", 162, 34),
        (LOG_GRID + "self_weight = [false, true]", 162, 17 + 81),
        ('p0 = [0, "1 MPa", "2 MPa"]\nscale = [0, 1, 2]', 9, 6),  # nothing; motion; pressure; 1:1, 1:2, 2:1
        ('p0 = ["-2 MPa", "-1 MPa", "1 MPa"]\nscale = [-1, 1, 2]', 9, 8),  # -2:2 and -1:1 are one, 1:-1 is another
        ('p0 = ["1 MPa", "2 MPa"]\npeak = ["1 m/s**2", "2 m/s**2"]\nscale = [1, 2]', 8, 4),  # 2^k, k = -2 … 1
        ('p0 = ["1 MPa", "2 MPa"]', 2, 2),  # under one motion
        ('p0 = ["1 MPa"]\npeak = ["1 m/s**2", "2 m/s**2"]\nscale = [1, 2]', 4, 3),  # 1·2 and 2·1
        ('p0 = ["0.1 MPa", "0.2 MPa"]\nscale = [0.3, 0.6]', 4, 3),  # 0.1/0.3 is not 0.2/0.6 in floats
        ('p0 = ["1 MPa", "2 MPa"]\nscale = [1, 2.0000000000001]', 4, 4),  # 5e-14 apart: another ratio
        ('p0 = ["1 MPa", "2 MPa"]\nscale = [1, 2]\nacceleration = ["9.81 m/s**2", "5 m/s**2"]', 8, 3),  # weightless
    ],
)
def test_each_ratio_of_loads_is_solved_once(sweep, n_case, n_solved):
    study = study_of(f"{LIGHT}[sweep]\n{sweep}")
    assert (len(study.cases), len(study.scaling.solved)) == (n_case, n_solved)


def test_weight_is_a_load_like_the_others():
    sweep = '[sweep]\np0 = ["1 MPa", "2 MPa"]\nscale = [1, 2]\n'
    assert count(SHORT + sweep) == 4
    assert count(SHORT + sweep + 'gravity.acceleration = ["9.81 m/s**2", "19.62 m/s**2"]') == 7  # all doubled


def test_two_directions_are_two_loads():
    sweep = '[sweep]\np0 = ["1 MPa", "2 MPa"]\npeak = ["1 m/s**2", "2 m/s**2"]\n'
    assert count(UP + sweep) == 3  # the vertical motion takes the factor of the horizontal one
    assert count(UP.replace("[mesh]", 'vertical_peak = "1 m/s**2"\n[mesh]') + sweep) == 4  # it has a size of its own
    assert count(UP + sweep + 'vertical_peak = ["1 m/s**2", "2 m/s**2"]') == 7


def test_a_record_of_its_own_size_has_the_amplitude_one():
    as_recorded = LIGHT.replace('peak = "1.7085 m/s**2"\n', "")
    assert solved(f'{as_recorded}[sweep]\np0 = ["1 MPa", "2 MPa"]\nscale = [1, 2]') == ([0, 1, 2, 0], [1, 1, 1, 2])


def test_a_peak_without_a_record_is_no_load():
    """Vertical motion alone: the horizontal peak scales nothing."""
    text = UP.replace('record = "ridgecrest-2019-clc-360.AT2"', 'record = "none"', 1)
    assert solved(f'{text}[sweep]\npeak = ["1 m/s**2", "2 m/s**2"]') == ([0, 0], [1, 1])
    assert count(f"{text}[sweep]\nscale = [1, 3]") == 2  # under the pressure of the default


def test_the_solved_case_is_the_one_that_most_follow_from_without_rounding():
    """1, 2, 3, 4, 6 of one ratio: from 1, 2 and 4 two others follow by a power of two, from 3 and 6 only one."""
    pairs = '[sweep]\np0 = ["3 MPa", "1 MPa", "2 MPa", "4 MPa", "6 MPa"]\nscale = [0]'
    assert solved(LIGHT + pairs) == ([1] * 5, [3, 1, 2, 4, 6])


def test_nothing_is_a_factor_of_nothing():
    assert solved(f"{LIGHT}[sweep]\np0 = [0]\nscale = [0, 1]") == ([0, 1], [1, 1])


@pytest.mark.parametrize(("apart", "n_solved"), [(0.5 * SAME, 3), (2 * SAME, 4)])
def test_ratios_are_one_within_the_rounding_of_a_logarithmic_range(apart, n_solved):
    study = study_of(f'{LIGHT}[sweep]\np0 = ["1 MPa", "{2 * (1 + apart)!r} MPa"]\nscale = [1, 2]')
    assert len(study.scaling.solved) == n_solved


@pytest.mark.parametrize("num", [9, 60])
def test_long_logarithmic_ranges_collapse(num):
    text = f'{LIGHT}[sweep]\np0 = {{ from = "0.7 Pa", to = "7e6 Pa", num = {num}, spacing = "log" }}\n'
    text += f"scale = {{ from = 0.001, to = 1e4, num = {num}, spacing = 'log' }}\n"
    assert count(text) == 2 * num - 1


def test_the_sentence_counts_and_is_silent_where_all_are_solved():
    assert study_of(f"{LIGHT}[sweep]\n{LOG_GRID}").scaling.sentence.startswith("81 cases, 17 solved: ")
    assert study_of(f"{SHORT}[sweep]\n{LOG_GRID}").scaling.sentence == ""


# the response times the factor -------------------------------------------------------------------------------------------------


def one_by_one(study):
    """The arrays of each case marched by itself."""
    return [run_batch(Job.of(study, Batch((case,)))).cases for case in range(len(study.cases))]


def assert_like_one_by_one(study, ds, exact):
    """`exact` holds for each case whether its bits must be those of its own march."""
    for case, arrays in enumerate(one_by_one(study)):
        here = ds.isel(dict(zip(ds["status"].dims, np.unravel_index(case, study.shape), strict=True)))
        assert set(arrays) == set(SCHEMA) - {"solved_as", "scaled_by"} | {"time"}
        for name in set(arrays) - {"time", "reason"}:
            found, own = here[name].values, np.asarray(arrays[name][0])
            if found.dtype.kind == "i":
                own = np.nan_to_num(own, nan=-1)
            if exact[case] or here[name].dtype.kind == "i" or name in BY_ITSELF:
                np.testing.assert_array_equal(found, own, err_msg=name)
            elif name not in ROUNDING:
                largest = np.nan_to_num(np.abs(own)).max(initial=0)
                np.testing.assert_allclose(found, own, rtol=0, atol=closeness(name) * largest, err_msg=name)


def closeness(name):
    """How near a march with other factors comes, of the peak: the joint solve ends within 1e-12 of the gaps (D9), and each step
    hands on what is left of some before, by damping.

    Gaps, rackings and what changes with them are differences of numbers up to a hundred times as large. Single precision
    rounds twice, by 2^-24 each.
    """
    if name in SINGLE:
        return 2.0**-23
    return 1e-11 if name in ("displacement", "peak_displacement", "stress", "peak_stress", "shape") else 1e-10


def test_powers_of_two_give_the_bits_of_each_case_by_itself():
    study = study_of(f'{UP}[sweep]\np0 = ["0.5 MPa", "1 MPa", "2 MPa"]\nscale = [0.5, 1, 2]')
    ds = run_study(study, workers=1)
    assert ds["solved_as"].values.tolist() == [[1, 2, 3], [4, 1, 2], [7, 4, 1]]
    assert ds["scaled_by"].values.tolist() == [[1, 1, 1], [1, 2, 2], [1, 2, 4]]
    assert (ds["first_slip"] > 0).any()  # the law is at work
    assert ds["base_acceleration"].dims == ("scale", "time", "component")
    assert_like_one_by_one(study, ds, [True] * 9)


def test_other_factors_give_each_case_to_rounding():
    study = study_of(f'{LIGHT}[sweep]\np0 = ["0.1 MPa", "0.2 MPa", "0.3 MPa"]\nscale = [0.3, 0.6, 0.9]')
    ds = run_study(study, workers=1)
    assert np.unique(ds["solved_as"]).size == 7
    assert (ds["first_slip"] > 0).any()
    assert_like_one_by_one(study, ds, (ds["scaled_by"] == 1).values.ravel())


def test_a_motion_taken_down_to_a_deeper_base_is_scaled_too():
    deep = LIGHT.replace("[mesh]", 'reference_depth = "14 m"\n[mesh]') + '[domain]\ndepth = "20 m"\n'
    study = study_of(f'{deep}[sweep]\np0 = ["1 MPa", "2 MPa"]\nscale = [1, 2]')
    assert study.scaling.solved == [0, 1, 2]
    assert_like_one_by_one(study, run_study(study, workers=1), [True] * 4)


def test_static_cases_are_one():
    """Without motion and weight there is one case, whatever the pressure."""
    study = study_of(f'{LIGHT}[sweep]\np0 = ["0.5 MPa", "1 MPa", "2 MPa"]\nscale = [0]')
    ds = run_study(study, workers=1)
    assert ds["solved_as"].values.ravel().tolist() == [1, 1, 1]
    assert_like_one_by_one(study, ds, [True] * 3)


def test_a_failed_case_fails_with_all_that_follow_from_it():
    study = study_of(f'{LIGHT}{LOOSE}[sweep]\np0 = [0, "2 MPa", "4 MPa"]\nscale = [1, 2]')
    ds = run_study(study, workers=1)
    assert ds["solved_as"].values.tolist() == [[1, 1], [3, 4], [5, 3]]
    assert (ds["status"][1:] == Status.NO_EQUILIBRIUM).all()
    assert len(set(ds["reason"].values[1:].ravel())) == 1
    assert np.isnan(ds["racking"][1:]).all()
    assert_like_one_by_one(study, ds, [True] * 6)


@pytest.mark.usefixtures("too_large")
def test_a_lost_batch_loses_its_followers_and_says_what_they_were():
    study = study_of(f'{LIGHT}[sweep]\np0 = ["1 MPa", "2 MPa"]\nscale = [1, 2]\ndamping_ratio = [0.02, 0.05]')
    ds = run_study(study, workers=1)
    assert (ds["status"].sel(damping_ratio=0.05) == Status.WORKER_LOST).all()
    assert (ds["status"].sel(damping_ratio=0.02) == Status.DONE).all()
    assert ds["solved_as"].sel(damping_ratio=0.05).values.tolist() == [[2, 4], [6, 2]]


def test_processes_give_the_same_and_progress_counts_what_is_marched():
    study = study_of(f'{LIGHT}[sweep]\np0 = ["1 MPa", "2 MPa"]\nscale = [1, 2]\ndamping_ratio = [0.02, 0.05]')
    told = []
    together = run_study(study, workers=2, progress=told.append)
    assert sum(told) == study.case_steps == 6 * 40
    xr.testing.assert_equal(together, run_study(study, workers=1))


# what the schema says ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SCHEMA)
def test_degrees_are_those_of_the_units(name):
    """Lengths and forces grow with the loads, work with their square; times, shares, states and ratios stay."""
    degrees = {"m": 1, "Pa": 1, "N m-1": 1, "N m m-1": 1, "J m-1": 2, "J m-2": 2, "s": 0, "Hz": 0, "1": 0, "": 0}
    expected = None if name in BY_ITSELF else 0 if name == "opened_length" else degrees[SCHEMA[name].unit]
    assert SCHEMA[name].degree == expected


def test_dataset_and_file_say_what_was_solved():
    study = study_of(f'{LIGHT}[sweep]\np0 = ["1 MPa", "2 MPa"]\nscale = [1, 2]')
    ds = run_study(study, workers=1)
    assert ds["solved_as"].dtype == np.int32
    assert ds.attrs["history"].endswith(study.scaling.sentence)
    assert float(ds["scaled_by"][1, 1]) == 2
