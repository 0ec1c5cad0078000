"""The iterative boundary method (D12) on sequences whose limit is known."""

import numpy as np
import pytest
import xarray as xr

from studies import load_study
from studies.domain_size import MEASURES, convergence_sentence, grows_by_a_factor, size_axis, with_convergence


def dataset(values, widths):
    """A dataset of the method in which every measure takes these values."""
    m = xr.DataArray(np.asarray(values, dtype=float), dims="domain_width")
    ds = xr.Dataset(
        {
            "peak_displacement": m.expand_dims(point=["A", "C"], component=["x"]),
            "peak_racking": m,
            "peak_stress": m.expand_dims(point=["A", "C"], stress_component=["xx"]),
            "max_opening": xr.concat([0 * m, m], "joint"),
            "max_slip": xr.concat([m, 0.5 * m], "joint"),
            "status": 0 * m,
        }
    )
    return ds.assign_coords(domain_width=("domain_width", list(widths), {"units": "m"}))


WIDTHS = 10.0 * 1.25 ** np.arange(6)


def test_order_and_remaining_error_of_a_power_law_are_exact():
    """m = 3 + (10/B)²: order 2, and the error that remains is m's distance to its limit, relative to m."""
    m = 3 + (10 / WIDTHS) ** 2
    ds = with_convergence(dataset(m, WIDTHS))
    for measure in MEASURES:
        got = ds.sel(measure=measure)
        np.testing.assert_allclose(got["epsilon"][1:], np.abs(np.diff(m)) / m[1:], rtol=1e-12)
        np.testing.assert_allclose(got["order"][2:], 2.0, rtol=1e-9)  # differences of six digits
        np.testing.assert_allclose(got["remaining_error"][2:], (m[2:] - 3) / m[2:], rtol=1e-9)
        assert np.isnan(got["order"][:2]).all()
    # D12: for p = 2 and q = 1.25 the remaining error is 1.78 times epsilon
    ratio = ds["remaining_error"][-1] / ds["epsilon"][-1]
    np.testing.assert_allclose(ratio, 1 / (1.25**2 - 1), rtol=1e-9)


@pytest.mark.parametrize("m", [[1, 1.1, 1.0, 1.1, 1.0, 1.1], [1, 1.1, 1.25, 1.5, 2.0, 3.0]], ids=["oscillates", "diverges"])
def test_what_does_not_converge_is_not_certified(m):
    ds = with_convergence(dataset(m, WIDTHS))
    assert np.isnan(ds["order"]).all()
    assert np.isnan(ds["remaining_error"]).all()
    assert convergence_sentence(ds).startswith("No width up to 30.5 m keeps the change of u_x at A under the source's 2.16 %")


def test_an_accidental_small_change_is_no_stop():
    """A change under the tolerance counts only where all later ones stay under it too."""
    ds = with_convergence(dataset([1, 2, 2.001, 3, 3.001, 3.0015], WIDTHS))
    assert convergence_sentence(ds).startswith(
        "From a width of 24.4 m on u_x at A changes by less than the source's 2.16 % (0.033 %"
    )


@pytest.mark.parametrize(
    ("values", "expected"),
    [((10, 12.5, 15.625), True), ((10, 12.5), False), ((10, 12, 15), False), ((15.625, 12.5, 10), False), ((10, 10, 10), False)],
)
def test_only_a_constant_factor_is_the_method(values, expected):
    assert grows_by_a_factor(np.array(values, dtype=float)) is expected


def test_other_sweeps_are_left_alone():
    ds = dataset([1, 2, 3], [10, 12, 15])
    assert size_axis(ds) == ""
    assert with_convergence(ds) is ds


def test_shipped_study_grows_by_a_quarter_through_the_source_s_width_with_one_damping():
    study = load_study("domain_size")
    widths = np.array([spec.domain.width for spec in study.cases])
    np.testing.assert_allclose(widths, 20 * 1.25 ** np.arange(-2.0, 4.0), rtol=1e-12)  # rounding of the logarithmic range
    assert {spec.damping.frequencies for spec in study.cases} == {(17.98, 30.75)}
