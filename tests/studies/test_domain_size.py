"""The iterative boundary method (D12): sequences whose limit is known, the sizes of a study, and what is said of them."""

import numpy as np
import pytest
import xarray as xr

from studies import StudyError, load_study, make_study
from studies.domain_size import (
    MEASURES,
    convergence,
    convergence_sentences,
    is_domain_size,
    measured,
    series_of,
    source_sentence,
    with_convergence,
)
from studies.sizes import DEPTH, SOURCE_DEPTH, WIDTH, DomainSizes

Q = 1.25
WIDTHS = 10.0 * Q ** np.arange(6)


# Sequences


def test_order_and_remaining_error_of_a_power_law_are_exact():
    """m = 3 + (10/B)²: order 2, and the error that remains is m's distance to its limit, relative to m."""
    m = 3 + (10 / WIDTHS) ** 2
    got = convergence(m, Q)
    np.testing.assert_allclose(got.epsilon[1:], np.abs(np.diff(m)) / m[1:], rtol=1e-12)
    np.testing.assert_allclose(got.order[2:], 2.0, rtol=1e-9)  # differences of six digits
    np.testing.assert_allclose(got.remaining_error[2:], (m[2:] - 3) / m[2:], rtol=1e-9)
    assert np.isnan(got.order[:2]).all()
    assert np.isnan(got.epsilon[0])
    # D12: for p = 2 and q = 1.25 the remaining error is 1.78 times epsilon
    np.testing.assert_allclose(got.remaining_error[-1] / got.epsilon[-1], 1 / (Q**2 - 1), rtol=1e-9)


@pytest.mark.parametrize(
    "m",
    [[1, 1.1, 1.0, 1.1, 1.0, 1.1], [1, 1.1, 1.25, 1.5, 2.0, 3.0], [1, 1, 1, 1], [1, np.nan, 1.2, 1.21]],
    ids=["oscillates", "diverges", "constant", "with a failed case"],
)
def test_what_does_not_converge_is_not_certified(m):
    got = convergence(np.array(m, dtype=float), Q)
    assert np.isnan(got.order).all()
    assert np.isnan(got.remaining_error).all()


@pytest.mark.parametrize(("p", "counts_as"), [(0.4, None), (0.6, 0.6), (2.0, 2.0), (5.0, 2.0)])
def test_slow_orders_are_not_certified_and_fast_ones_count_as_two(p, counts_as):
    """A turn of the curve looks like a high order; a displacement under a net force like a low one (case 03)."""
    got = convergence(3 + WIDTHS**-p, Q)
    if counts_as is None:
        assert np.isnan(got.remaining_error).all()
    else:
        np.testing.assert_allclose(got.order[2:], p, rtol=1e-6)
        np.testing.assert_allclose(got.remaining_error[2:] / got.epsilon[2:], 1 / (Q**counts_as - 1), rtol=1e-5)


def test_measures_are_judged_one_by_one():
    good, bad = 3 + 1 / WIDTHS**2, np.arange(6.0)
    both = convergence(np.column_stack([good, bad]), Q)
    np.testing.assert_array_equal(both.order[:, 0], convergence(good, Q).order)
    assert np.isnan(both.order[:, 1]).all()


# Datasets


def dataset(sizes: dict[str, list[float]], values: dict[str, list[float]]) -> xr.Dataset:
    """A dataset of the method in which all measures of a series take the given values."""
    series = [name for name in sizes for _ in sizes[name]]
    m = xr.DataArray(np.concatenate([values[name] for name in sizes]).astype(float), dims="domain")
    grown = np.concatenate([sizes[name] for name in sizes])
    is_width = np.array(series) == WIDTH
    history = m.expand_dims(time=2, point=["A", "B", "C", "D"], component=["x", "y"])
    ds = xr.Dataset(
        {
            "displacement": history,
            "reference_displacement": 0 * history.isel(point=0, drop=True),
            "peak_racking": m,
            "peak_stress": m.expand_dims(point=["A", "B", "C", "D"], stress_component=["xx", "yy"]),
            "max_opening": xr.concat([0 * m, m], "joint"),
            "max_slip": xr.concat([m, 0.5 * m], "joint"),
            "status": 0 * m,
        }
    )
    return ds.assign_coords(
        series=("domain", series),
        width=("domain", np.where(is_width, grown, 40.0)),
        depth=("domain", np.where(is_width, 14.0, grown)),
    )


def judged(values: list[float], tolerance: float = 0.0216) -> xr.Dataset:
    """The widths 10, 12.5, … m with these values of every measure."""
    widths = list(10.0 * Q ** np.arange(len(values)))
    return with_convergence(
        dataset({WIDTH: widths}, {WIDTH: values}), DomainSizes(width={"from": 10, "num": 3}, tolerance=tolerance)
    )


def test_every_measure_is_read():
    m = 3 + (10 / WIDTHS) ** 2
    ds = judged(list(m))
    assert list(ds["measure"].values) == list(MEASURES)
    for measure in MEASURES:
        np.testing.assert_allclose(ds["order"].sel(measure=measure)[2:], 2.0, rtol=1e-9)
    np.testing.assert_array_equal(measured(ds), np.repeat(m[:, None], len(MEASURES), axis=1))


def test_displacement_is_relative_to_the_free_field_at_the_record_s_depth():
    ds = dataset({WIDTH: [10.0, 12.5]}, {WIDTH: [3.0, 4.0]})
    ds["reference_displacement"][{"component": 0}] = 1.0
    ds["reference_displacement"][{"component": 1}] = 100.0
    np.testing.assert_array_equal(measured(ds)[:, 0], [2.0, 3.0])


def test_an_accidental_small_change_is_no_stop():
    """The method would stop there; that a later change is larger is said."""
    ds = judged([1, 2, 2.001, 3, 3.001, 3.0015])
    (said,) = convergence_sentences(ds)
    assert said == (
        "In width, to 2.16 % of u_x at A: the method stops at 15.62 m with 0.05 %, "
        "but 19.53 m changes it by 33.3 % again: not settled."
    )
    np.testing.assert_array_equal(ds["within_tolerance"].sel(measure="racking"), [0, 0, 0, 0, 1, 1])


def test_a_stop_that_holds_comes_with_the_error_that_remains():
    m = 3 + (10 / WIDTHS) ** 2
    (said,) = convergence_sentences(judged(list(m), tolerance=0.05))
    k = int(np.argmax(np.abs(np.diff(m)) / m[1:] <= 0.05)) + 1
    assert said == (
        f"In width, to 5 % of u_x at A: the method stops at {WIDTHS[k]:.4g} m with {100 * (m[k - 1] - m[k]) / m[k]:.3g} %; "
        f"remaining error there: {100 * (m[k] - 3) / m[k]:.3g} %."
    )


def test_no_size_is_enough():
    (said,) = convergence_sentences(judged([1, 2, 4]))
    assert said == "In width, to 2.16 % of u_x at A: no size up to 15.62 m is enough, the last one still changes it by 50 %."


def test_as_the_source_does_it_nothing_is_certified():
    depths = list(14.0 * Q ** np.arange(4))
    m = [3 + (14 / d) ** 2 for d in depths]
    ds = dataset({DEPTH: depths, SOURCE_DEPTH: depths}, {DEPTH: m, SOURCE_DEPTH: m})
    ds = with_convergence(ds, DomainSizes(depth={"from": 14, "num": 4}))
    series = series_of(ds)
    assert list(series) == [DEPTH, SOURCE_DEPTH]
    np.testing.assert_allclose(series[DEPTH]["order"][2:], 2.0, rtol=1e-9)
    assert np.isnan(series[SOURCE_DEPTH]["order"]).all()
    assert np.isnan(series[SOURCE_DEPTH]["remaining_error"]).all()
    np.testing.assert_array_equal(series[SOURCE_DEPTH]["epsilon"], series[DEPTH]["epsilon"])
    assert np.isnan(series[SOURCE_DEPTH]["epsilon"][0]).all()  # a series begins anew
    assert convergence_sentences(ds)[1].endswith("never called converged.")


def test_source_is_named_where_its_size_is_among_the_widths():
    sizes = [12.8, 16.0, 20.0, 25.0]
    ds = with_convergence(dataset({WIDTH: sizes}, {WIDTH: [1, 1.2, 1.25, 1.26]}), DomainSizes(width={"from": 12.8, "num": 4}))
    assert source_sentence(ds) == (
        "The source stopped at 20 m x 14 m with 2.16 %; here the step to that width changes u_x at A by 4 %."
    )
    assert source_sentence(judged([1, 1.2, 1.25, 1.26])) == ""


# Studies


def test_shipped_study_grows_by_a_quarter_through_the_source_s_size_with_one_damping():
    study = load_study("domain_size")
    (axis,) = study.axes
    series = np.array(axis.along["series"].values)
    widths = np.array([spec.domain.width for spec in study.cases])
    depths = np.array([spec.domain.depth for spec in study.cases])
    np.testing.assert_allclose(widths[series == WIDTH], 20 * Q ** np.arange(-2.0, 4.0), rtol=1e-14)
    assert set(depths[series == WIDTH]) == {14.0}
    np.testing.assert_allclose(depths[series == DEPTH], 14 * Q ** np.arange(5), rtol=1e-14)
    np.testing.assert_array_equal(depths[series == SOURCE_DEPTH], depths[series == DEPTH])
    assert set(widths[series != WIDTH]) == {widths[series == WIDTH][-1]}
    assert {(s.damping.reference_width, s.damping.reference_depth, s.damping.frequencies) for s in study.cases} == {
        (20, 14, None)
    }
    at = [spec.motion.reference_depth for spec in study.cases]
    assert at == [None] * 6 + [14.0] * 5 + [None] * 5


def test_the_record_at_the_base_and_at_its_depth_march_in_one_batch():
    """They share the mesh, so the source's variant costs nothing."""
    study = load_study("domain_size")
    meshes = {(spec.domain.width, spec.domain.depth) for spec in study.cases}
    assert len(study.batches) == len(meshes) == 10


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ({}, "domain_size: must have width or depth"),
        (7, "domain_size = 7: must be a table"),
        ({"width": {"from": "12.8 m", "num": 2}}, "domain_size.width.num = 2: must be 3 or more"),
        ({"width": {"from": "12.8 m", "num": 4, "factor": 1.1}}, "domain_size.width.factor = 1.1: must be 1.25 or more"),
        ({"width": {"from": 12.8, "num": 4}}, 'domain_size.width.from = 12.8: needs a unit, as in "12.8 m"'),
        ({"width": {"num": 4}}, "domain_size.width.from: is missing"),
        ({"width": {"from": "12.8 m", "num": 4}, "tolerance": 2}, "domain_size.tolerance = 2: must be less than 1"),
        ({"width": {"from": "12.8 m", "num": 4}, "measure": "joy"}, 'domain_size.measure = "joy": must be'),
        ({"height": {"from": "12.8 m", "num": 4}}, "domain_size.height: is not a field"),
        ({"width": {"from": "4 m", "num": 3}}, "domain_size: box.width = 5 m: box must lie inside domain.width = 4 m"),
        ({"depth": {"from": "10 m", "num": 3}}, "domain_size.depth.from = 10 m: must not lie above the record, which is at 14 m"),
    ],
)
def test_mistakes_are_told_in_a_line(table, told):
    with pytest.raises(StudyError) as caught:
        make_study({"domain_size": table})
    assert any(line.startswith(f"study: {told}") for line in caught.value.mistakes), caught.value.mistakes


def test_it_stands_without_a_sweep():
    with pytest.raises(StudyError, match="domain_size: stands alone"):
        make_study({"domain_size": {"width": {"from": "12.8 m", "num": 4}}, "sweep": {"p0": ["1 MPa"]}})


def test_other_datasets_are_none_of_it(quick_ds):
    assert not is_domain_size(quick_ds)
