"""What reaches the base: records, synthetic motions and wavelets, cut, resampled and scaled in both directions."""

import numpy as np
import pytest

from engine import GroundMotion, MotionError, Spec, base_motion, ricker, synthetic
from engine.spec import Motion, Ricker, Synthetic, Time

TIME = Time(dt=0.005, duration=10.0)


def spec(time=TIME, record="h", vertical_record="v", synthetic=None, ricker=None, **motion):
    """A spec of the two records h and v, unless others are named."""
    return Spec(
        motion=Motion(record=record, vertical_record=vertical_record, **motion),
        time=time,
        synthetic=synthetic or Synthetic(),
        ricker=ricker or Ricker(),
    )


@pytest.fixture(scope="module")
def pair():
    """Two records of one earthquake."""
    t = np.arange(1001) * 0.01
    shape = np.exp(-((t - 5.0) ** 2))
    return {
        "h": GroundMotion("h.AT2", 0.01, 3.0 * shape * np.sin(2 * np.pi * 2.0 * t)),
        "v": GroundMotion("v.AT2", 0.01, 1.2 * shape * np.sin(2 * np.pi * 5.0 * t)),
    }


# Records


def test_base_motion_without_peaks_is_as_recorded(pair):
    motion = base_motion(spec(peak=None), pair)
    assert motion.shape == (2001, 2)
    for column, record in enumerate(pair.values()):
        np.testing.assert_array_equal(motion[:, column], record.cut(10.0).resampled(0.005).acceleration[:2001])
        assert abs(motion[:, column]).max() == pytest.approx(record.peak, rel=0.02)  # the finer step sees more of the peak


def test_vertical_record_is_scaled_with_the_horizontal_one(pair):
    """Their proportion stays, whatever peak and scale are asked for."""
    plain = base_motion(spec(peak=None), pair)
    scaled = base_motion(spec(peak=1.5, scale=2.0), pair)
    factor = 2.0 * 1.5 / abs(plain[:, 0]).max()
    np.testing.assert_allclose(scaled, factor * plain, rtol=1e-14)  # one product more
    assert abs(scaled[:, 0]).max() == pytest.approx(3.0, rel=1e-14)


def test_vertical_peak_of_its_own(pair):
    scaled = base_motion(spec(peak=1.5, vertical_peak=0.4, scale=0.5), pair)
    np.testing.assert_allclose(abs(scaled).max(axis=0), [0.75, 0.2], rtol=1e-14)
    only_vertical = base_motion(spec(peak=None, vertical_peak=0.4), pair)
    assert abs(only_vertical[:, 1]).max() == pytest.approx(0.4, rel=1e-14)
    np.testing.assert_array_equal(only_vertical[:, 0], base_motion(spec(peak=None), pair)[:, 0])


@pytest.mark.parametrize(("missing", "field"), [(0, "record"), (1, "vertical_record")])
def test_direction_without_record_is_at_rest(pair, missing, field):
    motion = base_motion(spec(peak=1.0, vertical_peak=1.0, **{field: "none"}), pair)
    assert not motion[:, missing].any()
    assert abs(motion[:, 1 - missing]).max() == pytest.approx(1.0, rel=1e-14)


def test_scale_may_be_zero_or_reversed(pair):
    up = base_motion(spec(scale=1.0), pair)
    np.testing.assert_array_equal(base_motion(spec(scale=-1.0), pair), -up)
    assert not base_motion(spec(scale=0.0), pair).any()


def test_peak_is_that_of_what_is_left_after_cut_and_taper(pair):
    """The strongest shaking at 5 s is cut off by a duration of 4 s; the peak is reached all the same."""
    motion = base_motion(spec(Time(dt=0.005, duration=4.0), peak=2.0), pair)
    assert motion.shape == (801, 2)
    assert abs(motion[:, 0]).max() == pytest.approx(2.0, rel=1e-14)


@pytest.mark.parametrize("duration", [0.004, 0.008, 0.012])
def test_peak_is_reached_where_the_record_s_last_step_reaches_beyond_the_duration(duration):
    """A record that grows has its peak there; found by fuzzing."""
    growing = {"h": GroundMotion("h.AT2", 0.01, np.arange(20.0) ** 2)}
    motion = base_motion(spec(Time(dt=0.002, duration=duration), vertical_record="none", peak=1.5, scale=-2.0), growing)
    assert abs(motion[:, 0]).max() == pytest.approx(3.0, rel=1e-14)


def test_short_record_is_followed_by_rest(pair):
    motion = base_motion(spec(Time(dt=0.01, duration=15.0), peak=1.0), pair)
    assert motion.shape == (1501, 2)
    assert not motion[1001:].any()


def test_record_that_was_not_given_is_named(pair):
    with pytest.raises(MotionError, match=r"other\.AT2: there is no such record"):
        base_motion(spec(record="other.AT2"), pair)


def test_scale_beyond_floating_point_is_refused(pair):
    huge = pair | {"h": GroundMotion("h.AT2", 0.01, 1e290 * pair["h"].acceleration)}
    with pytest.raises(MotionError, match=r"h\.AT2: is not finite when scaled"):
        base_motion(spec(Time(dt=0.01, duration=10.0), peak=None, scale=1e30), huge)


# Generated motions


def test_wavelet_is_sampled_exactly_without_taper_and_scaled():
    """Also where its tail reaches into the first second, which a taper would change."""
    time, wavelet = Time(dt=0.004, duration=3.0), Ricker(frequency=2.0, arrival=0.4)
    motion = base_motion(spec(time, "ricker", "none", ricker=wavelet, peak=2.0, scale=0.5), {})
    assert motion.shape == (751, 2)
    expected = ricker(wavelet, 0.004, 751).acceleration * (2.0 / 1.0 * 0.5)
    np.testing.assert_array_equal(motion[:, 0], np.where(abs(expected) < 1e-60, 0.0, expected))
    assert not motion[:, 1].any()


def test_tail_of_a_wavelet_whose_squares_would_vanish_is_zero():
    """Steps of 1e-175 m were halved, for no residual could be told of them; found by fuzzing."""
    motion = base_motion(
        spec(record="ricker", vertical_record="ricker", ricker=Ricker(frequency=5.0, arrival=2.0), peak=1e-20), {}
    )
    moved = motion != 0
    t = TIME.dt * np.arange(len(motion))
    assert abs(motion[moved]).min() >= 1e-80
    assert moved[abs(t - 2.0) < 0.7].all()  # exp(-x²) of x = 11
    assert not moved[abs(t - 2.0) > 0.8].any()


def test_synthetic_motion_is_treated_like_a_record():
    time, noise = Time(dt=0.005, duration=10.0), Synthetic(seed=5)
    motion = base_motion(spec(time, "synthetic", "none", synthetic=noise, peak=1.7), {})
    record = synthetic(noise, 10.0)
    assert record.dt == 0.01
    as_record = base_motion(spec(time, "h", "none", peak=1.7), {"h": record})
    np.testing.assert_array_equal(motion, as_record)
    assert abs(motion[:, 0]).max() == pytest.approx(1.7, rel=1e-14)


def test_synthetic_motion_is_the_same_at_every_step_of_the_model():
    """At 5 ms and at 2.5 ms it passes through the same values, but for the two filters' leakage of -54 dB."""
    noise = Synthetic(seed=5, ground_frequency=2.0)
    coarse, fine = (
        base_motion(spec(Time(dt=dt, duration=20.0), "synthetic", "none", synthetic=noise, peak=None), {})[:, 0]
        for dt in (0.005, 0.0025)
    )
    assert abs(fine[::2] - coarse).max() < 2 * 10 ** (-54 / 20) * abs(coarse).max()


def test_horizontal_and_vertical_noise_are_independent():
    """Their correlation over 40 s with a memory of about 0.1 s is that of some 400 values: 1/20, five times that at most."""
    time = Time(dt=0.01, duration=40.0)
    x, y = base_motion(spec(time, "synthetic", "synthetic", synthetic=Synthetic(plateau=30.0), peak=None), {}).T
    assert abs(np.corrcoef(x, y)[0, 1]) < 0.25
    np.testing.assert_array_equal(
        base_motion(spec(time, "none", "synthetic", synthetic=Synthetic(plateau=30.0), peak=None), {}).T[1], y
    )


def test_generated_motions_without_a_peak_keep_their_own_size():
    motion = base_motion(spec(Time(dt=0.005, duration=10.0), "ricker", "synthetic", peak=None, scale=3.0), {})
    assert abs(motion[:, 0]).max() == 3.0
    plain = base_motion(spec(Time(dt=0.005, duration=10.0), "none", "synthetic", peak=None), {})
    np.testing.assert_array_equal(motion[:, 1], 3.0 * plain[:, 1])


def test_generated_vertical_motion_takes_the_factor_of_a_record(pair):
    motion = base_motion(spec(record="h", vertical_record="ricker", peak=1.5), pair)
    factor = 1.5 / abs(pair["h"].cut(10.0).resampled(0.005).acceleration).max()
    assert abs(motion[:, 1]).max() == pytest.approx(factor, rel=1e-14)


def test_generator_that_does_not_fit_the_time_is_refused():
    with pytest.raises(MotionError, match=r"ricker\.frequency = 60 Hz: needs a time\.dt of at most 0\.00417 s"):
        base_motion(spec(TIME, "ricker", "none", ricker=Ricker(frequency=60.0)), {})
    with pytest.raises(MotionError, match=r"synthetic\.step = 1e-06 s: makes more than 2,000,000 values in 10 s"):
        base_motion(spec(TIME, "synthetic", "none", synthetic=Synthetic(step=1e-6, low_frequency=10, ground_frequency=10)), {})
