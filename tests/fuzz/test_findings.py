"""What fuzzing found in single steps, each with its smallest model; what it found elsewhere is tested beside its cause."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from engine import Spec, Status, build_model, static
from engine.spec import Damping, Gravity, Joint, MeshOptions, Pressure, Time
from studies import make_study, run_study
from tests.fuzz.against_reference import Verdict, told_steps
from tests.fuzz.examine import Depth, examine
from tests.fuzz.models import Drawn

MESH = MeshOptions(
    order=1, wall_elements=1, roof_elements=2, side_elements=2, corner_levels=0, first=3, largest_width=5, largest_height=5
)


@pytest.mark.parametrize("thickness", [1e-1, 1e-2, 1e-3, 1e-4])
def test_a_step_with_dashpots_in_stiff_joints_is_right(thickness):
    """Their force is a difference of numbers some 1e5 of it; a step was wrong in its 8th to 4th digit, its residual 1e-16."""
    spec = Spec(
        mesh=MESH,
        joint=Joint(thickness=thickness),
        damping=Damping(ratio=0.4, joints=True),
        pressure=Pressure(p0=-1e5),
        gravity=Gravity(self_weight=False),
        time=Time(dt=0.005, duration=0.05),
    )
    motion = np.random.default_rng(0).standard_normal((11, 2))
    steps = told_steps(build_model(spec), [spec], [motion], (1, 2, 5, 10))
    assert [step for step in steps if step.verdict not in (Verdict.AGREES, Verdict.ROUNDING)] == []


FOUND = sorted((Path(__file__).parent / "found").glob("*.toml"))


@pytest.mark.parametrize("path", FOUND, ids=[path.stem for path in FOUND])
def test_models_that_were_found_wanting_are_so_no_more(path):
    """Each says what was amiss with it."""
    seed, number = map(int, path.stem.split("-"))
    found = examine(Drawn(seed, number, tomllib.loads(path.read_text()), ()), Depth(reference=True))
    assert found.findings == []


def test_a_lane_that_needs_too_many_paths_is_given_up(monkeypatch):
    """Each may take seconds on a large mesh, and a load step has 500 iterations (model 1225 of seed 2: over five minutes)."""
    table = tomllib.loads((Path(__file__).parent / "found" / "1-6714.toml").read_text())
    assert run_study(make_study(table), workers=1)["status"].values.ravel().tolist() == [Status.DONE]
    monkeypatch.setattr(static, "PATH_WORK", 0.0)
    ended = run_study(make_study(table), workers=1)
    assert ended["status"].values.ravel().tolist() == [Status.NO_EQUILIBRIUM]
    assert ended["reason"].values.ravel()[0]
