"""Ground motions: both AT2 headers, cut and taper, resampling without aliasing, scaling of both components."""

from dataclasses import replace

import numpy as np
import pytest

from engine import GroundMotion, MotionError, base_motion, read_at2
from engine.motion import G_OF_RECORDS
from engine.spec import Motion, Time

TITLE = "STRONG-MOTION RECORD\nSOMEWHERE 01/02/2003, STATION, 90 DEG\nACCELERATION TIME SERIES IN UNITS OF G\n"
NEW, OLD = "NPTS=   7, DT=   .0100 SEC\n", "   7   0.0100   NPTS, DT\n"
VALUES = "  0.1000000E+00 -2.0000000E-01  .3  4.0D-01 -0.5d+00\n  0.6E0  -7.0000000E-01\n"


@pytest.fixture
def record(tmp_path):
    def write(text, name="record.AT2"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


# Reading


@pytest.mark.parametrize(
    "header",
    [
        NEW,
        OLD,
        "NPTS=7,DT=.01\n",
        "NPTS = 7 , DT = 1.0D-02 SEC\n",
        "npts=  7, dt= 1.0e-2 sec\n",
        "NPTS= 7 DT= 0.01 SEC\n",
        "7 0.01 NPTS, DT\n",
        " 7  1.0D-2  npts,dt\n",
    ],
)
def test_both_headers_are_read(record, header):
    motion = read_at2(record(TITLE + header + VALUES))
    assert motion.name == "record.AT2"
    assert motion.dt == 0.01
    np.testing.assert_array_equal(motion.acceleration, np.array([0.1, -0.2, 0.3, 0.4, -0.5, 0.6, -0.7]) * G_OF_RECORDS)
    assert motion.peak == 0.7 * G_OF_RECORDS


def test_header_is_sought_in_the_first_eight_lines(record):
    assert read_at2(record("\n" * 7 + NEW + VALUES)).dt == 0.01
    with pytest.raises(MotionError, match="no line of the first eight"):
        read_at2(record("\n" * 8 + NEW + VALUES))


def test_byte_order_mark_and_line_ends_of_windows_do_not_matter(record):
    text = (OLD + VALUES).replace("\n", "\r\n")
    assert len(read_at2(record(b"\xef\xbb\xbf" + text.encode())).acceleration) == 7


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TITLE + NEW.replace("7", "8") + VALUES, "record.AT2: holds 7 values, its header says 8"),
        (TITLE + NEW.replace("7", "6") + VALUES, "record.AT2: holds 7 values, its header says 6"),
        (TITLE + NEW, "record.AT2: holds 0 values, its header says 7"),
        (TITLE + NEW + VALUES.replace(".3", "nan"), "'nan' is not a number"),
        (TITLE + NEW + VALUES.replace(".3", "inf"), "record.AT2: value 3 is not finite"),
        (TITLE + NEW + VALUES.replace(".3", "1e999"), "record.AT2: value 3 is not finite"),
        (TITLE + NEW + VALUES.replace(".3", "three"), "'three' is not a number"),
        (TITLE + NEW + VALUES.replace(".3", "*******"), r"'\*\*\*\*\*\*\*' is not a number"),
        (TITLE + NEW.replace(".0100", "0.0") + VALUES, "record.AT2: time step 0.0 must be above zero"),
        (TITLE + NEW.replace(".0100", "-.01") + VALUES, "record.AT2: time step -0.01 must be above zero"),
        (TITLE + NEW.replace(".0100", "1e-e") + VALUES, "record.AT2: time step nan must be above zero"),
        (TITLE + NEW.replace("7", "1") + "0.5\n", "record.AT2: must hold at least two values"),
        (TITLE + VALUES, "record.AT2: no line of the first eight reads"),
        ("", "record.AT2: no line of the first eight reads"),
        (bytes(range(256)) * 8, "record.AT2: cannot be read: is not text"),
        (b"\x1f\x8b\x08\x00\xff\xfe", "record.AT2: cannot be read: is not text"),
    ],
)
def test_record_that_cannot_be_used_is_refused_by_name(record, text, message):
    with pytest.raises(MotionError, match=message):
        read_at2(record(text))


def test_missing_file_and_folder_are_told(tmp_path):
    with pytest.raises(MotionError, match=r"none\.AT2: cannot be read: No such file"):
        read_at2(tmp_path / "none.AT2")
    with pytest.raises(MotionError, match="cannot be read"):
        read_at2(tmp_path)


# The value


def test_values_are_checked_copied_and_read_only():
    values = np.array([1.0, -2.0, 1.0])
    motion = GroundMotion("m", 0.1, values)
    values[0] = 9.0
    assert motion.acceleration[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        motion.acceleration[0] = 0.0
    for broken, message in (
        ({"acceleration": np.array([1.0])}, "at least two"),
        ({"acceleration": np.ones((3, 2))}, "at least two"),
        ({"acceleration": np.array([1.0, np.nan])}, "value 2 is not finite"),
        ({"dt": 0.0}, "above zero"),
        ({"dt": np.inf}, "above zero"),
    ):
        with pytest.raises(MotionError, match=message):
            replace(motion, **broken)


def test_cut_keeps_the_beginning_with_a_taper_at_both_ends():
    """Cosine over 1 s: half the value at half a second; the middle is untouched."""
    cut = GroundMotion("m", 0.01, np.ones(2001)).cut(8.0)
    values = cut.acceleration
    assert len(values) == 801
    assert values[0] == values[-1] == 0.0
    np.testing.assert_array_equal(values[100:-100], 1.0)
    # (1 - cos(pi/2))/2 and (1 - cos(pi/4))/2, but for rounding
    assert values[50] == values[-51] == pytest.approx(0.5, abs=1e-15)
    assert values[25] == pytest.approx((1 - np.sqrt(0.5)) / 2, abs=1e-15)
    np.testing.assert_array_equal(values, values[::-1])
    assert (np.diff(values[:101]) > 0).all()


def test_cut_of_a_short_record_takes_all_of_it_with_a_quarter_tapered():
    values = GroundMotion("m", 0.01, np.ones(41)).cut(8.0).acceleration
    assert len(values) == 41
    np.testing.assert_array_equal(values[10:-10], 1.0)
    assert (values[:10] < 1.0).all()
    assert (values[-10:] < 1.0).all()


def sine(frequency, dt, duration=30.0):
    return GroundMotion("sine", dt, np.sin(2 * np.pi * frequency * np.arange(round(duration / dt) + 1) * dt + 0.3))


# resample_poly filters with a Kaiser window of beta = 5: 0.1102 (A - 8.7) = 5 gives A = 54 dB of ripple and leakage.
RIPPLE = 10 ** (-54 / 20)


@pytest.mark.parametrize("dt", [0.01, 0.005, 0.004, 0.0025, 0.02, 0.015])
@pytest.mark.parametrize("frequency", [0.7, 3.0, 12.0])
def test_resampling_keeps_a_sine_in_amplitude_and_phase(frequency, dt):
    resampled = sine(frequency, 0.01).resampled(dt)
    assert resampled.dt == dt
    t = np.arange(len(resampled.acceleration)) * dt
    inner = (t > 1.0) & (t < 29.0)  # the record's sudden ends ring within a filter's length of them
    expected = np.sin(2 * np.pi * frequency * t + 0.3)
    np.testing.assert_allclose(resampled.acceleration[inner], expected[inner], atol=2 * RIPPLE)


@pytest.mark.parametrize(("dt", "frequency"), [(0.02, 40.0), (0.02, 33.0), (0.05, 17.0), (0.05, 28.0)])
def test_what_the_longer_step_cannot_carry_is_removed_and_not_aliased(dt, frequency):
    """Frequencies a third above the new Nyquist frequency and more; plain thinning would leave them at full size."""
    t = np.arange(0, 30.0, dt)
    inner = (t > 2.0) & (t < 28.0)
    assert abs(sine(frequency, 0.01).acceleration[:: round(dt / 0.01)]).max() > 0.8
    assert abs(sine(frequency, 0.01).resampled(dt).acceleration[: len(t)][inner]).max() < 2 * RIPPLE


def test_resampling_covers_the_record_and_its_own_step_is_free():
    motion = sine(1.0, 0.01, 2.0)
    assert motion.resampled(0.01) is motion
    for dt in (0.005, 0.004, 0.02, 0.03):
        length = (len(motion.resampled(dt).acceleration) - 1) * dt
        assert 2.0 - dt < length < 2.0 + 0.01 + dt


def test_step_without_a_ratio_of_whole_numbers_is_refused():
    with pytest.raises(MotionError, match=r"cannot be brought to 0\.00314159 s by a ratio of whole numbers"):
        sine(1.0, 0.01, 2.0).resampled(np.pi / 1000)


def test_zero_motion_has_no_scale():
    assert GroundMotion("m", 0.1, np.array([1.0, -4.0])).scale_to(2.0) == 0.5
    with pytest.raises(MotionError, match="m: is zero throughout and cannot be scaled to a peak of 2"):
        GroundMotion("m", 0.1, np.zeros(5)).scale_to(2.0)


# What reaches the base


@pytest.fixture(scope="module")
def pair():
    """Two records of one earthquake."""
    t = np.arange(1001) * 0.01
    shape = np.exp(-((t - 5.0) ** 2))
    return (
        GroundMotion("h", 0.01, 3.0 * shape * np.sin(2 * np.pi * 2.0 * t)),
        GroundMotion("v", 0.01, 1.2 * shape * np.sin(2 * np.pi * 5.0 * t)),
    )


TIME = Time(dt=0.005, duration=10.0)


def test_base_motion_without_peaks_is_as_recorded(pair):
    motion = base_motion(Motion(peak=None), TIME, *pair)
    assert motion.shape == (2001, 2)
    for column, record in enumerate(pair):
        np.testing.assert_array_equal(motion[:, column], record.cut(10.0).resampled(0.005).acceleration[:2001])
        assert abs(motion[:, column]).max() == pytest.approx(record.peak, rel=0.02)  # the finer step sees more of the peak


def test_vertical_record_is_scaled_with_the_horizontal_one(pair):
    """Their proportion stays, whatever peak and scale are asked for."""
    plain = base_motion(Motion(peak=None), TIME, *pair)
    scaled = base_motion(Motion(peak=1.5, scale=2.0), TIME, *pair)
    factor = 2.0 * 1.5 / abs(plain[:, 0]).max()
    np.testing.assert_allclose(scaled, factor * plain, rtol=1e-14)  # one product more
    assert abs(scaled[:, 0]).max() == pytest.approx(3.0, rel=1e-14)


def test_vertical_peak_of_its_own(pair):
    scaled = base_motion(Motion(peak=1.5, vertical_peak=0.4, scale=0.5), TIME, *pair)
    np.testing.assert_allclose(abs(scaled).max(axis=0), [0.75, 0.2], rtol=1e-14)
    only_vertical = base_motion(Motion(peak=None, vertical_peak=0.4), TIME, *pair)
    assert abs(only_vertical[:, 1]).max() == pytest.approx(0.4, rel=1e-14)
    np.testing.assert_array_equal(only_vertical[:, 0], base_motion(Motion(peak=None), TIME, *pair)[:, 0])


@pytest.mark.parametrize("missing", [0, 1])
def test_direction_without_record_is_at_rest(pair, missing):
    records = [None if column == missing else record for column, record in enumerate(pair)]
    motion = base_motion(Motion(peak=1.0, vertical_peak=1.0), TIME, *records)
    assert not motion[:, missing].any()
    assert abs(motion[:, 1 - missing]).max() == pytest.approx(1.0, rel=1e-14)


def test_scale_may_be_zero_or_reversed(pair):
    up = base_motion(Motion(scale=1.0), TIME, *pair)
    np.testing.assert_array_equal(base_motion(Motion(scale=-1.0), TIME, *pair), -up)
    assert not base_motion(Motion(scale=0.0), TIME, *pair).any()


def test_peak_is_that_of_what_is_left_after_cut_and_taper(pair):
    """The strongest shaking at 5 s is cut off by a duration of 4 s; the peak is reached all the same."""
    motion = base_motion(Motion(peak=2.0), Time(dt=0.005, duration=4.0), *pair)
    assert motion.shape == (801, 2)
    assert abs(motion[:, 0]).max() == pytest.approx(2.0, rel=1e-14)


def test_short_record_is_followed_by_rest(pair):
    motion = base_motion(Motion(peak=1.0), Time(dt=0.01, duration=15.0), *pair)
    assert motion.shape == (1501, 2)
    assert not motion[1001:].any()
