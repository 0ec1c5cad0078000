"""Where a dataset comes from: what the study was, with which program and records, and one digest of all that decides it."""

import pytest

from studies import make_study
from studies.provenance import provenance, study_hash

from .conftest import study_of


def test_provenance(reopened, quick):
    attrs = reopened.attrs
    assert attrs["Conventions"].startswith("CF-1.11")
    assert "UGRID-1.0" in attrs["Conventions"]
    assert (attrs["title"], attrs["study_name"], attrs["study"]) == ("Quick", "quick", quick.text)
    assert attrs["study_hash"] == study_hash(quick)
    assert attrs["records_sha256"].startswith("ridgecrest-2019-clc-360.AT2 ")
    assert len(attrs["records_sha256"].split()[1]) == 64
    for package in ("coralquake", "numpy", "numba", "scipy", "xarray", "netCDF4"):
        assert f"{package} " in attrs["package_versions"]
    assert {"commit", "created", "history"} <= attrs.keys()


@pytest.mark.parametrize(
    "changed",
    [
        {"title": "Other"},
        {"pressure": {"p0": 0}},
        {"sweep": {"scale": [1]}},
        {"motion": {"record": "ridgecrest-2019-clc-090.AT2"}},
        {"sweep": {"scale": [1.0]}, "time": {"dt": "1 ms"}},
        {"mesh": {"order": 1}},
        {"mesh": {"corner_levels": 3}},
        {"mesh": {"corner_growth": 2}},
        {"output": {"sections": 9}},
    ],
    ids=str,
)
def test_hash_of_a_study_changes_with_what_decides_its_result(changed):
    assert study_hash(make_study(changed)) != study_hash(make_study({}))
    assert study_hash(make_study(changed)) == study_hash(make_study(changed))


def test_a_study_without_records_says_so():
    assert provenance(study_of('[motion]\nrecord = "none"\n'))["records_sha256"] == "none"
