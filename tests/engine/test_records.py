"""Records from files: PEER AT2 with both headers, K-NET, text and CSV; and what is refused, by name, line and value."""

import os
import sys
import time
import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from engine import MotionError, read_record
from engine.records import G_OF_RECORDS, MOST_BYTES
from engine.spec import Motion

VALUES = np.array([0.1, -0.2, 0.3, 0.4, -0.5, 0.6, -0.7])


@pytest.fixture
def file(tmp_path):
    def write(content, name="record.txt"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


# PEER

TITLE = "STRONG-MOTION RECORD\nSOMEWHERE 01/02/2003, STATION, 90 DEG\nACCELERATION TIME SERIES IN UNITS OF G\n"
NEW, OLD = "NPTS=   7, DT=   .0100 SEC\n", "   7   0.0100   NPTS, DT\n"
AT2 = "  0.1000000E+00 -2.0000000E-01  .3  4.0D-01 -0.5d+00\n  0.6E0  -7.0000000E-01\n"


@pytest.mark.parametrize("name", ["record.AT2", "record.txt"])
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
def test_both_peer_headers_are_read(file, header, name):
    motion = read_record(file(TITLE + header + AT2, name))
    assert motion.name == name
    assert motion.dt == 0.01
    np.testing.assert_array_equal(motion.acceleration, VALUES * G_OF_RECORDS)
    assert motion.peak == 0.7 * G_OF_RECORDS


def test_peer_header_is_sought_in_the_first_eight_lines(file):
    assert read_record(file("\n" * 7 + NEW + AT2, "record.AT2")).dt == 0.01
    with pytest.raises(MotionError, match="no line of the first eight"):
        read_record(file("\n" * 8 + NEW + AT2, "record.AT2"))


def test_byte_order_mark_and_line_ends_of_windows_do_not_matter(file):
    text = (OLD + AT2).replace("\n", "\r\n")
    assert len(read_record(file(b"\xef\xbb\xbf" + text.encode())).acceleration) == 7


def test_old_peer_title_with_filter_points_is_in_g(file):
    title = TITLE.replace("OF G\n", "OF G. FILTER POINTS: HP=0.1 Hz LP=30 Hz\n")
    assert read_record(file(title + OLD + AT2, "record.AT2")).peak == 0.7 * G_OF_RECORDS


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TITLE + NEW.replace("7", "8") + AT2, "record.AT2: holds 7 values, its header says 8"),
        (TITLE + NEW.replace("7", "6") + AT2, "record.AT2: holds 7 values, its header says 6"),
        (TITLE + NEW, "record.AT2: holds 0 values, its header says 7"),
        (TITLE + NEW + AT2.replace(".3", "nan"), "record.AT2: line 5: 'nan' is not a number"),
        (TITLE + NEW + AT2.replace(".3", "-inf"), "record.AT2: line 5: '-inf' is not finite"),
        (TITLE + NEW + AT2.replace("0.6E0", "1e999"), "record.AT2: line 6: '1e999' is not finite"),
        (TITLE + NEW + AT2.replace(".3", "1e308"), "record.AT2: value 3 is not finite"),  # once in m/s²
        (TITLE + NEW + AT2.replace(".3", "three"), "record.AT2: line 5: 'three' is not a number"),
        (TITLE + NEW + AT2.replace(".3", "*******"), r"record.AT2: line 5: '\*\*\*\*\*\*\*' is not a number"),
        (TITLE + NEW + AT2.replace(".3", "1_0"), "record.AT2: line 5: '1_0' is not a number"),
        (TITLE + NEW + AT2.replace(".3", "٣"), "record.AT2: line 5: '٣' is not a number"),
        (TITLE + NEW + AT2.replace(".3", "1.5-101"), "record.AT2: line 5: '1.5-101' is not a number"),
        (TITLE + NEW.replace(".0100", "0.0") + AT2, "record.AT2: time step 0.0 must be above zero"),
        (TITLE + NEW.replace(".0100", "-.01") + AT2, "record.AT2: time step -0.01 must be above zero"),
        (TITLE + NEW.replace(".0100", "1e-e") + AT2, "record.AT2: line 4: '1e-e' is not a number"),
        (TITLE + NEW.replace("7", "1") + "0.5\n", "record.AT2: must hold at least two values"),
        (TITLE + NEW.replace("7", "9" * 5000) + AT2, "record.AT2: no line of the first eight reads"),
        (TITLE + AT2, "record.AT2: no line of the first eight reads"),
        ("# " + NEW + AT2, "record.AT2: no line of the first eight reads"),
        ("", "record.AT2: no line of the first eight reads"),
        (
            TITLE.replace("ACCELERATION", "VELOCITY").replace("OF G", "OF CM/S") + NEW + AT2,
            "its header says units of CM/S; a PEER",
        ),
        (TITLE.replace("OF G", "OF CM/S/S.") + NEW + AT2, "its header says units of CM/S/S; a PEER"),
    ],
)
def test_broken_peer_record_is_refused(file, text, message):
    with pytest.raises(MotionError, match=message):
        read_record(file(text, "record.AT2"))


@pytest.mark.parametrize(
    ("settings", "fields"),
    [
        ({"dt": 0.01}, "motion.record_dt"),
        ({"unit": "g_0"}, "motion.record_unit"),
        ({"dt": 0.01, "unit": "g_0"}, "motion.record_dt and motion.record_unit"),
    ],
)
def test_peer_and_knet_records_state_their_own_step_and_unit(file, settings, fields):
    with pytest.raises(MotionError, match=f"is a PEER record and states its own time step and unit; leave out {fields}$"):
        read_record(file(TITLE + NEW + AT2, "record.AT2"), **settings)
    with pytest.raises(MotionError, match=f"is a K-NET record and states its own time step and unit; leave out {fields}$"):
        read_record(file(knet(np.arange(300))), **settings)


# K-NET


def knet(
    counts, scale="3920(gal)/6182761", rate="100Hz", maximum=None, duration=None, first="Origin Time       2006/01/18 23:25:00"
):
    """A file in the layout of K-NET: 17 lines of header, then counts, eight a line of nine characters."""
    numerator, denominator = scale.split("(gal)/")
    gal = (counts - np.mean(counts)) * float(numerator) / float(denominator)
    maximum = f"{abs(gal).max():.3f}" if maximum is None else maximum
    duration = round(len(counts) / float(rate[:-2])) if duration is None else duration
    header = [
        first,
        "Lat.              37.798",
        "Long.             142.200",
        "Depth. (km)       36",
        "Mag.              5.7",
        "Station Code      MYG002",
        "Station Lat.      38.7262",
        "Station Long.     141.5109",
        "Station Height(m) 79",
        "Record Time       2006/01/18 23:25:46",
        f"Sampling Freq(Hz) {rate}",
        f"Duration Time(s)  {duration}",
        "Dir.              N-S",
        f"Scale Factor      {scale}",
        f"Max. Acc. (gal)   {maximum}",
        "Last Correction   2006/01/18 23:25:31",
        "Memo.             ",
    ]
    rows = ["".join(f"{value:9d}" for value in counts[i : i + 8]) for i in range(0, len(counts), 8)]
    return "\n".join(header + rows) + "\n"


COUNTS = (-18000 + 30000 * np.sin(np.arange(1000) * 0.1) * np.exp(-(((np.arange(1000) - 400) / 150) ** 2))).round().astype(int)


@pytest.mark.parametrize(("scale", "factor"), [("3920(gal)/6182761", 39.20 / 6182761), ("7845(gal)/8223790", 78.45 / 8223790)])
@pytest.mark.parametrize(("rate", "dt"), [("100Hz", 0.01), ("200Hz", 0.005)])
@pytest.mark.parametrize("name", ["MYG0020601182325.NS", "record.txt"])
def test_knet_counts_become_accelerations_without_their_mean(file, scale, factor, rate, dt, name):
    """Values: count times scale in gal, a hundredth of it in m/s², less the mean, as the header's own maximum is stated."""
    pytest.importorskip("obspy")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        motion = read_record(file(knet(COUNTS, scale, rate), name))
    assert (motion.name, motion.dt) == (name, dt)
    np.testing.assert_allclose(motion.acceleration, (COUNTS - COUNTS.mean()) * factor, rtol=1e-12, atol=1e-15)
    assert abs(motion.acceleration.mean()) < 1e-15


def test_knet_with_line_ends_of_windows_and_an_empty_last_line(file):
    pytest.importorskip("obspy")
    motion = read_record(file(("\ufeff" + knet(COUNTS) + "\n").replace("\n", "\r\n")))
    assert len(motion.acceleration) == 1000


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (knet(COUNTS).replace("(gal)/6182761", "(gal)/6182.761"), "reaches 1.897e.04 gal, its header says 18.97 gal"),
        (knet(COUNTS, maximum="48.060"), "its header says 48.06 gal"),
        (knet(COUNTS, maximum="nan"), "its header says nan gal"),
        (knet(COUNTS, duration=108), "record.txt: holds 10 s, its header says 108 s"),
        ("\n".join(knet(COUNTS).split("\n")[:60]), "record.txt: holds 3.44 s, its header says 10 s"),
        ("\n".join(knet(COUNTS).split("\n")[:17]), "record.txt: ends with its header"),
        ("\n".join(knet(COUNTS, duration=1).split("\n")[:17]), "record.txt: ends with its header"),
        ("\n".join(knet(COUNTS).split("\n")[:9]), "without the last line of its header, 'Memo.'"),
        (
            knet(COUNTS).replace("-18000", "-18a00", 1),
            "not laid out as K-NET records are: could not convert string to float: b'-18a00'",
        ),
        (knet(COUNTS).replace("-18000", "nan", 1), "record.txt: "),
        (knet(COUNTS, rate="100Hz").replace("100Hz", "0Hz"), "record.txt: "),
        (knet(COUNTS).replace("Scale Factor      3920(gal)/6182761", "Scale Factor"), "not laid out as K-NET records are"),
        (knet(COUNTS).replace("Scale Factor      3920", "Scale Factor      0"), "its header says"),
        (knet(COUNTS).replace("Station Code", "Code"), "Expected line to start with Station Code"),
        (knet(COUNTS).replace("2006/01/18 23:25:00", "yesterday"), "not laid out as K-NET records are"),
        ("Origin Time", "without the last line of its header"),
        (knet(np.full(1000, -18000)), "record.txt: is zero throughout"),
    ],
)
def test_broken_knet_record_is_refused(file, text, message):
    pytest.importorskip("obspy")
    with pytest.raises(MotionError, match=message) as caught:
        read_record(file(text))
    assert "\n" not in str(caught.value)


def test_without_obspy_a_knet_record_says_what_to_install(file, monkeypatch):
    monkeypatch.setitem(sys.modules, "obspy", None)
    with pytest.raises(MotionError, match=r"is a K-NET record, which obspy reads: pip install obspy"):
        read_record(file(knet(COUNTS)))
    assert read_record(file(TITLE + NEW + AT2)).dt == 0.01


# Text

TIMES = ["0.00", "0.01", "0.02", "0.03", "0.04", "0.05", "0.06"]
WRITTEN = ["0.1", "-0.2", "+.3", "4e-1", "-5.0D-01", "0.6d0", "-7.E-1"]


@pytest.mark.parametrize(
    "around",
    [
        "{}",
        "\ufeff{}",
        "# from a database, 100 Hz\n\n% second comment\n{}\n\n# end\n",
        "Time (s); Acceleration (m/s2)\n{}",
        "Station: Ga Hòa Hưng\nComponent 090\nt,a\n{}",
        "acceleration:\n{}",
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("separator", [",", ";", "\t", " ", "   ", ", ", " ; ", " ,"])
def test_two_columns_are_times_and_accelerations(file, separator, end, around):
    lines = end.join(t + separator + a for t, a in zip(TIMES, WRITTEN, strict=True))
    motion = read_record(file(around.replace("\n", end).format(lines), "record.csv"), unit="m/s**2")
    assert motion.dt == 0.01
    np.testing.assert_array_equal(motion.acceleration, VALUES)


@pytest.mark.parametrize("end", ["", ",", ";", " \t", ", "])
@pytest.mark.parametrize("lead", ["", "   ", "\t"])
def test_one_column_is_accelerations(file, lead, end):
    motion = read_record(file("".join(f"{lead}{a}{end}\n" for a in WRITTEN)), dt=0.02, unit="m/s**2")
    assert motion.dt == 0.02
    np.testing.assert_array_equal(motion.acceleration, VALUES)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("m/s**2", 1.0),
        ("m/s^2", 1.0),
        ("m/s²", 1.0),
        ("cm/s**2", 0.01),
        ("Gal", 0.01),
        ("mm/s**2", 0.001),
        ("g_0", 9.80665),
        ("standard_gravity", 9.80665),
        ("mg_0", 9.80665e-3),
        ("ft/s**2", 0.3048),
    ],
)
def test_units_become_si_as_in_the_study(file, unit, factor):
    assert Motion(record_unit=unit).record_unit == unit
    motion = read_record(file("\n".join(WRITTEN)), dt=0.01, unit=unit)
    np.testing.assert_allclose(motion.acceleration, VALUES * factor, rtol=1e-15 * 8)  # a product of a few decimal numbers


@pytest.mark.parametrize(
    ("unit", "hint"),
    [
        ("g", r"must be a quantity in m/s\*\*2 or a unit like it, g is not \(the gram\); the standard gravity is g_0"),
        ("gal", r"gal is not \(the gallon\); the unit of gravimetry is Gal"),
        ("m/s", "m/s is not"),
        ("m/s2", "unit 'm/s2' is not known"),
        ("", "needs a unit"),
    ],
)
def test_unit_that_is_no_acceleration_is_refused_as_in_the_study(file, unit, hint):
    with pytest.raises(MotionError, match=f"record.txt: motion.record_unit = '{unit}': .*{hint}"):
        read_record(file("\n".join(WRITTEN)), dt=0.01, unit=unit)
    with pytest.raises(ValueError, match=hint):
        Motion(record_unit=unit)


UNIT = {"unit": "m/s**2"}
BOTH = {"dt": 0.01, "unit": "m/s**2"}
TWO = "\n".join(f"{t} {a}" for t, a in zip(TIMES, WRITTEN, strict=True))


@pytest.mark.parametrize(
    ("text", "settings", "message"),
    [
        # settings
        ("1\n2\n", {}, 'a record of one column needs motion.record_dt, as in "0.01 s" and motion.record_unit, as in "cm/s..2"$'),
        ("1\n2\n", UNIT, 'a record of one column needs motion.record_dt, as in "0.01 s"$'),
        ("1\n2\n", {"dt": 0.01}, 'a record of one column needs motion.record_unit, as in "cm/s..2"$'),
        (TWO, {}, 'a record of columns of text needs motion.record_unit, as in "cm/s..2"$'),
        (TWO, {"dt": 0.01}, "needs motion.record_unit"),
        (TWO, {"dt": 0.02, "unit": "m/s**2"}, "its times step by 0.01 s, motion.record_dt says 0.02 s"),
        ("1\n2\n", {"dt": 0.0, "unit": "m/s**2"}, "time step 0.0 must be above zero"),
        ("1\n2\n", {"dt": np.nan, "unit": "m/s**2"}, "time step nan must be above zero"),
        ("1\n2\n", {"dt": 10.0, "unit": "m/s**2"}, "steps by 10 s; is its time in seconds?"),
        # numbers
        (TWO.replace("4e-1", "abc"), UNIT, "line 4: 'abc' is not a number"),
        (TWO.replace("4e-1", "nan"), UNIT, "line 4: 'nan' is not a number"),
        (TWO.replace("4e-1", "Infinity"), UNIT, "line 4: 'Infinity' is not finite"),
        (TWO.replace("4e-1", "1e400"), UNIT, "line 4: '1e400' is not finite"),
        (TWO.replace("4e-1", "1_0"), UNIT, "line 4: '1_0' is not a number"),
        ("0.00 1\n0.01 1_0\n", UNIT, "line 2: '1_0' is not a number"),
        ("0.00 1\n0.01 ٣\n", UNIT, "line 2: '٣' is not a number"),
        ("nan\n1\n2\n", BOTH, "line 1: 'nan' is not a number"),
        ("1\n#N/A\n2\n", BOTH, "line 2: '#N/A' is not a number"),
        ("1\n#DIV/0!\n2\n", BOTH, "line 2: '#DIV/0!' is not a number"),
        ("NA\n1\n2\n", BOTH, "line 1: 'NA' is not a number"),
        ("****\n1\n2\n", BOTH, r"line 1: '\*\*\*\*' is not a number"),
        ("0.00 abc\n0.01 1\n0.02 2\n", UNIT, "line 1: 'abc' is not a number"),
        ("# a\n\n2008 Iwate\n0.00 1\n", UNIT, "line 3: 'Iwate' is not a number"),
        ("1\n2\nend of file\n", BOTH, "line 3: holds 3 values, the lines above hold 1"),
        ('"0.00","1"\n"0.01","2"\n', UNIT, "line 1: '\"0.00\"' is not a number"),
        ("1e308\n1\n", {"dt": 0.01, "unit": "km/s**2"}, "value 1 is not finite"),
        # columns
        ("0 1 2\n1 2 3\n", BOTH, "line 1: holds 3 columns; must be accelerations, or times and accelerations"),
        ("t,ns,ew\n0.00,1,2\n0.01,1,2\n", UNIT, "line 2: holds 3 columns"),
        ("0.00,,1\n0.01,,2\n", UNIT, "line 1: holds 3 columns"),
        ("0.00 1\n0.01\n", UNIT, "line 2: holds 1 values, the lines above hold 2"),
        ("0.00,1\n0.01,\n", UNIT, "line 2: holds 1 values, the lines above hold 2"),
        ("0.00 1\n0.01 1 2\n", UNIT, "line 2: holds 3 values, the lines above hold 2"),
        ("0.5\n", BOTH, "must hold at least two values"),
        ("0.01 0.5\n", UNIT, "must hold at least two values"),
        ("", BOTH, "holds no line of numbers"),
        ("# nothing\nnor here\n", BOTH, "holds no line of numbers"),
        ("word\n" * 101 + "1\n2\n", BOTH, "holds no line of numbers"),
        # decimal commas
        ("0,01;1,5\n0,02;1,6\n", UNIT, "line 1: '0,01;1,5' has decimal commas; write decimal points"),
        ("t;a\n0;0\n0,01;1,5\n", UNIT, "line 3: '0,01;1,5' has decimal commas"),
        ("0,01\t1,5\n0,02\t1,6\n", UNIT, "line 1: '0,01.+1,5' has decimal commas"),
        ("0,01 1,5\n0,02 1,6\n", UNIT, "line 1: '0,01 1,5' has decimal commas"),
        ("0,01;1,5E-02\n0,02;1,6E-02\n", UNIT, "line 1: '0,01;1,5E-02' has decimal commas"),
        ("0,015\n-0,021\n0,030\n", BOTH, "line 1: '0,015' has decimal commas"),
        ("0,01,1,5\n0,02,1,6\n", UNIT, "line 1: '0,01,1,5' has decimal commas"),
        # times
        ("0.00 1\n0.01 2\n0.01 3\n0.02 1\n", UNIT, "line 3: time 0.01 s does not rise above 0.01 s; are its decimals too few?"),
        ("0.02 1\n0.01 2\n0.00 3\n", UNIT, "line 2: time 0.01 s does not rise above 0.02 s"),
        (TWO.replace("0.03 4e-1\n", ""), UNIT, "line 4: time 0.04 s does not follow 0.02 s by the others' step of about 0.0"),
        (TWO.replace("0.03 ", "0.035 "), UNIT, "line 4: time 0.035 s does not follow 0.02 s"),
        ("0 1\n5 2\n10 3\n", UNIT, "steps by 5 s; is its time in seconds"),
        ("-1e308 1\n1e308 2\n", UNIT, "holds a time of 1e.308 s; are its times in seconds?"),
        # peaks
        ("0.0\n-1667.0\n", BOTH, "reaches 170 g; no earthquake has been recorded above 5 g; is the unit right?"),
        ("0.0\n-50.1\n", BOTH, "reaches 5.11 g; no earthquake"),
        ("0.0\n9.9e-5\n", BOTH, "reaches 9.9e-05 m/s² only; is the unit right?"),
        ("0.0\n0.0\n", BOTH, "is zero throughout"),
    ],
)  # fmt: skip
def test_text_that_cannot_be_used_is_refused(file, text, settings, message):
    with pytest.raises(MotionError, match=message) as caught:
        read_record(file(text), **settings)
    assert str(caught.value).startswith("record.txt: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("peak", [50.0, 1e-4])
def test_peaks_at_the_limits_are_taken(file, peak):
    assert read_record(file(f"0.0\n{peak}\n0.0\n"), **BOTH).peak == peak


def test_a_step_given_with_a_time_column_must_agree_and_is_then_the_step(file):
    assert read_record(file(TWO), **BOTH).dt == 0.01
    times = "\n".join(f"{i / 128:.3f} 1.0" for i in range(200))
    assert read_record(file(times), dt=1 / 128, unit="m/s**2").dt == 1 / 128


# Files


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        ("1\n2\né\n".encode("latin-1"), r"is not UTF-8 text \(byte 4\); save it as UTF-8"),
        ("1\n2\n".encode("utf-16"), "is not text, or not UTF-8; save it as UTF-8"),
        (b"1\n2\n\0", "is not text, or not UTF-8"),
        (bytes(range(1, 256)) * 8, "is not UTF-8 text"),
        (b"\x1f\x8b\x08\x08\xff\xfe", "is not UTF-8 text"),
        (b"1\n" * (MOST_BYTES // 2) + b"1", "is larger than 20 MB; is it a record?"),
        (b"\n" * MOST_BYTES, "holds more than 250,000 lines; is it a record?"),
    ],
)
@pytest.mark.parametrize("name", ["record.txt", "record.AT2"])
def test_files_that_hold_no_text_are_refused(file, raw, message, name):
    path = file(raw, name)
    begin = time.process_time()
    with pytest.raises(MotionError, match=f"{name}: {message}"):
        read_record(path, **BOTH)
    assert time.process_time() - begin < 2.0


@pytest.mark.parametrize(
    "line", ["x\n", "1\n", "1.5 2.5\n", "#\n", "1 2 3 4 5 6 7 8 9 0\n", "0,5\n", "1_0\n", "\ufffd\n", "1" * 50 + "\n"]
)
def test_every_refusal_of_a_large_file_is_quick(file, line):
    """As much as is read at all, with a mistake at the end."""
    n = min(MOST_BYTES // len(line.encode()), 250_000) - 10
    path = file(line * n + "mistake\n")
    begin = time.process_time()
    with pytest.raises(MotionError):
        read_record(path, **BOTH)
    assert time.process_time() - begin < 4.0  # a second where nothing else runs


def test_missing_file_and_folder_are_told(tmp_path):
    with pytest.raises(MotionError, match=r"none\.AT2: cannot be read: No such file"):
        read_record(tmp_path / "none.AT2")
    with pytest.raises(MotionError, match="cannot be read: is no file"):
        read_record(tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_named_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(MotionError, match="pipe: cannot be read: is no file"):
        read_record(tmp_path / "pipe")


fragments = st.sampled_from(
    ["0.01", "1e5", "-3", "nan", "1D400", ",", ";", "\t", " ", "\n", "\n", "#", "NPTS= 3, DT= .01 SEC\n", "Origin Time ", "x",
     "é", "1e", "0E99999", "1e-99999", "0.0E" + "9" * 5000, "-", ".", "2 0.01 NPTS, DT\n", "UNITS OF CM", "\u2028", "\x0c", "١"]
)  # fmt: skip


@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(fragments, max_size=40).map("".join).map(str.encode) | st.binary(max_size=300), st.sampled_from([{}, UNIT, BOTH]))
@example(b"0E99999 1\n1 2\n", UNIT)
@example(("0.0E" + "9" * 5000 + " 1\n1 2\n").encode(), UNIT)
@example(b"0 1\n1e-323 2\n2e-323 1", UNIT)
def test_whatever_a_file_holds_it_is_a_motion_or_one_line(tmp_path, content, settings):
    path = tmp_path / "record.txt"
    path.write_bytes(content)
    try:
        motion = read_record(path, **settings)
    except MotionError as error:
        message = str(error)
    else:
        message = "record.txt: "
        assert 1e-4 <= motion.peak <= 50.0
        assert 0 < motion.dt <= 1.0
    assert message.startswith("record.txt: ")
    assert "\n" not in message
