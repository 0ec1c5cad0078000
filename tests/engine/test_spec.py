"""The description of a model: its defaults are the reference problem, and what it cannot be is refused."""

import math
from typing import Any

import pytest
from pydantic import ValidationError

from engine import PRESETS, Spec
from engine.spec import (
    Box,
    Damping,
    Domain,
    Gravity,
    Joint,
    Layer,
    MeshOptions,
    Motion,
    Output,
    Pressure,
    Section,
    Supports,
    Time,
)

FILE = {"from_file": True}


def test_defaults_are_the_reference_problem():
    """Every number of DESIGN's table coral-2010, with the record and the finer mesh as the source does not give them."""
    spec = Spec()
    assert spec.domain == Domain(width=20.0, depth=14.0)
    assert spec.box == Box(width=5.0, height=4.0, wall=0.5, depth=4.0, offset=0.0, E=34e9, nu=0.3, density=2500.0)
    layers = [(layer.bottom, layer.E, layer.nu, layer.density, layer.friction) for layer in spec.layer]
    assert layers == [
        (1.0, 2.8e8, 0.22, 2500.0, 0.21),
        (4.0, 2.1e9, 0.25, 2800.0, 0.32),
        (8.0, 2.0e10, 0.25, 2900.0, 0.41),
        (10.0, 2.6e9, 0.25, 2000.0, 0.47),
        (14.0, 2.3e10, 0.25, 3000.0, 0.38),
    ]
    assert spec.damping == Damping(ratio=0.05, frequencies=None, joints=False)
    assert spec.pressure == Pressure(p0=2e6, reference_height=14.0)
    assert (spec.motion.peak, spec.motion.scale, spec.motion.vertical_record) == (1.7085, 1.0, "none")
    assert spec.motion.vertical_peak is None
    assert spec.time == Time(dt=0.005, duration=20.0, newmark_beta=0.25, newmark_gamma=0.5)
    assert spec.joint.thickness == 0.05
    assert spec.joint.thickness_ratio is None
    assert spec.joint.quadrature == "nodal"
    assert spec.supports.sides == "tied"
    assert spec.gravity == Gravity(self_weight=True, acceleration=9.81)
    assert spec.mesh.mass == "consistent"
    assert spec.mesh.order == 2  # one triangle of three nodes through a wall is four to eight times too stiff
    assert (spec.mesh.wall_elements, spec.mesh.corner_levels) == (1, 4)
    assert spec.output.sections == 5
    assert spec.output.points == {}
    assert Spec.model_validate(PRESETS["coral-2010"], context=FILE) == spec


def test_pressures_of_the_reference_problem():
    """DESIGN's roof 0.571 MPa, floor 1.143 MPa and uplift 2.857 MN/m follow from the defaults."""
    spec = Spec()
    roof, floor = (spec.pressure.p0 * d / spec.pressure.reference_height for d in (4.0, 8.0))
    assert roof == pytest.approx(0.571e6, rel=1e-3)  # as many digits as the table has
    assert floor == pytest.approx(1.143e6, rel=1e-3)
    assert (floor - roof) * spec.box.width == pytest.approx(2.857e6, rel=1e-3)


def test_units_of_the_source_give_the_reference_problem():
    """Its N, cm, kg with the units written out; last digits may differ by the conversion."""
    written = {
        "domain": {"width": "2000 cm", "depth": "1400 cm"},
        "box": {"width": "500 cm", "height": "400 cm", "wall": "50 cm", "E": "0.34e7 N/cm**2", "density": "2.5e-3 kg/cm**3"},
        "pressure": {"p0": "200 N/cm**2", "reference_height": "1400 cm"},
        "motion": {"peak": "170.85 cm/s**2"},
        "damping": {"ratio": "5 %"},
        "time": {"dt": "5 ms", "duration": "20 s"},
    }
    spec, expected = Spec.model_validate(written, context=FILE), Spec()
    for table, fields in written.items():
        for name in fields:
            value = getattr(getattr(spec, table), name)
            assert value == pytest.approx(getattr(getattr(expected, table), name), rel=1e-14)


def refused(found: dict[str, Any], context: Any = None) -> str:
    with pytest.raises(ValidationError) as caught:
        Spec.model_validate(found, context=context)
    return str(caught.value)


@pytest.mark.parametrize(
    ("table", "field", "value"),
    [
        *[("domain", name, value) for name in ("width", "depth") for value in (0, -1.0)],
        *[("box", name, value) for name in ("width", "height", "wall", "E", "density") for value in (0, -1.0)],
        ("box", "depth", -0.1),
        *[("box", "nu", value) for value in (-0.01, 0.5, 0.7)],
        ("pressure", "reference_height", 0),
        ("motion", "peak", 0),
        ("motion", "vertical_peak", -1),
        *[("damping", "ratio", value) for value in (-0.01, 1.0, 1.5)],
        *[("damping", "frequencies", value) for value in ((0, 1), (1, -1), (1,), (1, 2, 3), 5)],
        *[("damping", "joints", value) for value in ("perhaps", "yes", 1)],
        *[("gravity", "self_weight", value) for value in ("no", 0)],
        *[("time", name, value) for name in ("dt", "duration") for value in (0, -1.0)],
        *[("time", "newmark_beta", value) for value in (0, 0.51)],
        *[("time", "newmark_gamma", value) for value in (0.49, 1.01)],
        *[("mesh", "wall_elements", value) for value in (0, 21, 1.5, "2", True)],
        *[("mesh", name, value) for name in ("roof_elements", "side_elements") for value in (0, 1, 3, 202)],
        *[("mesh", name, 0) for name in ("first", "largest_width", "largest_height")],
        *[("mesh", "growth", value) for value in (0.99, 4.1)],
        ("mesh", "mass", "heavy"),
        *[("joint", name, 0) for name in ("thickness", "thickness_ratio")],
        ("joint", "quadrature", "gauss"),
        ("supports", "sides", "free"),
        ("gravity", "acceleration", 0),
        *[("output", "every", value) for value in (0, 100_001, 2.5, "2", True)],
        ("output", "points", {"P": (0.0,)}),
    ],
)
def test_value_outside_its_rule_is_refused_by_name(table, field, value):
    message = refused({table: {field: value}})
    assert f"{table}.{field}" in message


@pytest.mark.parametrize(
    ("field", "value"),
    [("bottom", 0), ("bottom", -1), ("nu", 0.5), ("nu", -0.1), ("friction", -0.1), ("E", 0), ("density", -1)],
)
def test_value_of_a_layer_outside_its_rule_is_refused(field, value):
    layer = {"bottom": 20.0, "E": 1e9, "nu": 0.2, "density": 2000.0, "friction": 0.3, field: value}
    assert f"layer.0.{field}" in refused({"layer": [layer]})


def quantities() -> list[tuple[str, str, str]]:
    """(table, field, unit) of every quantity of a spec."""
    found = []
    for table, info in Spec.model_fields.items():
        if isinstance(info.default, Section):
            for name, schema in type(info.default).model_json_schema()["properties"].items():
                unit = next((part["unit"] for part in [schema, *schema.get("anyOf", [])] if "unit" in part), None)
                found += [] if unit is None else [(table, name, unit)]
    return found


def test_every_quantity_is_listed_with_unit_and_meaning():
    assert len(quantities()) > 25
    assert {unit for _, _, unit in quantities()} == {"m", "1", "Pa", "kg/m**3", "m/s**2", "s", "Hz"}
    for section in (type(info.default) for info in Spec.model_fields.values() if isinstance(info.default, Section)):
        for name, schema in section.model_json_schema()["properties"].items():
            parts = [schema, *schema.get("anyOf", [])]
            assert any(part.get("description") for part in parts), f"{section.__name__}.{name}: says nothing of its meaning"


@pytest.mark.parametrize(("table", "field", "unit"), quantities())
def test_every_quantity_refuses_what_is_no_quantity(table, field, unit):
    """A wrong unit, not a number, infinity, a truth value, a huge string; nothing but a message comes of them."""
    wrong = "kg" if unit != "kg" else "m"
    for value in (
        f"1 {wrong}",
        math.nan,
        math.inf,
        -math.inf,
        "nan",
        "inf m",
        True,
        False,
        "9" * 100_000,
        [],
        {},
        "1 parsec" * 20,
    ):
        assert f"{table}.{field}" in refused({table: {field: value}})


@pytest.mark.parametrize(("table", "field", "unit"), quantities())
def test_bare_number_is_refused_from_a_file_alone(table, field, unit):
    value = getattr(getattr(Spec(), table), field)
    value = 12.0 if value is None else value  # a reference domain of 12 m x 12 m holds the box
    assert Spec.model_validate({table: {field: value}}) is not None
    if unit == "1" or value == 0.0:
        assert Spec.model_validate({table: {field: value}}, context=FILE) is not None
    else:
        message = refused({table: {field: value}}, FILE)
        assert f"{table}.{field}" in message
        assert "needs a unit" in message
        assert Spec.model_validate({table: {field: f"{value!r} {unit}"}}, context=FILE) is not None


def test_quantities_in_lists_and_tables_need_units_too():
    assert "needs a unit" in refused({"damping": {"frequencies": [5.0, 10.0]}}, FILE)
    assert "needs a unit" in refused({"output": {"points": {"P": [9.0, -1.0]}}}, FILE)
    assert "needs a unit" in refused(
        {"layer": [{"bottom": 20.0, "E": "1 GPa", "nu": 0.2, "density": "2 t/m**3", "friction": 0}]}, FILE
    )
    found = {"damping": {"frequencies": ["5 Hz", "10 1/s"]}, "output": {"points": {"P": ["900 cm", "-1 m"]}}}
    spec = Spec.model_validate(found, context=FILE)
    assert spec.damping.frequencies == (5.0, 10.0)
    assert spec.output.points == {"P": (9.0, -1.0)}


def test_all_mistakes_are_reported_at_once():
    message = refused({"domain": {"width": "2 s"}, "box": {"nu": 0.6}, "damping": {"ratio": 1.5}})
    assert "3 validation errors" in message


@pytest.mark.parametrize("found", [{"dmain": {}}, {"domain": {"widht": 3}}, {"layer": [{"bottom": 1, "depth": 2}]}])
def test_unknown_names_are_refused(found):
    assert "Extra inputs are not permitted" in refused(found)


def test_values_are_frozen():
    spec = Spec()
    with pytest.raises(ValidationError, match="frozen"):
        spec.time = Time()
    with pytest.raises(ValidationError, match="frozen"):
        spec.box.width = 3.0


# Layers


def layer(**given: Any) -> Layer:
    return Layer(bottom=10.0, nu=0.25, friction=0.4, **given)


def test_stiffness_of_a_layer_may_be_given_in_three_ways():
    """E = 2(1+nu) G and G = rho Vs²; the constrained modulus is E(1-nu)/((1+nu)(1-2nu))."""
    rho, Vs = 2000.0, 300.0
    G = rho * Vs**2
    E = 2.5 * G
    for given in ({"E": E}, {"G": G}, {"Vs": Vs}):
        found = layer(density=rho, **given)
        # A few products of decimal numbers.
        assert found.young_modulus == pytest.approx(E, rel=1e-15 * 4)
        assert found.shear_modulus == pytest.approx(G, rel=1e-15 * 4)
        assert found.constrained_modulus == pytest.approx(E * 0.75 / (1.25 * 0.5), rel=1e-15 * 4)


def test_density_of_a_layer_may_be_given_as_unit_weight():
    assert layer(E=1e9, unit_weight=19620.0).rho == pytest.approx(2000.0, rel=1e-15)
    assert layer(Vs=100.0, unit_weight=19620.0).shear_modulus == pytest.approx(2e7, rel=4e-15)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"density": 1.0}, "exactly one of E, G, Vs, has none"),
        ({"E": 1.0, "Vs": 1.0, "density": 1.0}, "exactly one of E, G, Vs, has E and Vs"),
        ({"E": 1.0}, "exactly one of density, unit_weight, has none"),
        ({"E": 1.0, "density": 1.0, "unit_weight": 1.0}, "exactly one of density, unit_weight, has density and unit_weight"),
    ],
)
def test_layer_needs_exactly_one_stiffness_and_one_density(given, message):
    with pytest.raises(ValidationError, match=message):
        layer(**given)


@pytest.mark.parametrize(
    ("table", "field", "value"),
    [
        ("mesh", "order", 0),
        ("mesh", "order", 3),
        ("mesh", "order", 1.5),
        ("mesh", "corner_levels", -1),
        ("mesh", "corner_levels", 9),
        ("mesh", "corner_growth", 1.0),
        ("mesh", "corner_growth", 4.1),
        ("output", "sections", 1),
        ("output", "sections", 101),
    ],
)
def test_mesh_and_sections_keep_within_their_limits(table, field, value):
    assert f"{table}.{field}" in refused({table: {field: value}})


def test_ground_needs_a_layer():
    assert "at least 1 item" in refused({"layer": []})


# Rules between fields


def soft(*bottoms: float) -> tuple[Layer, ...]:
    return tuple(Layer(bottom=b, E=1e9, nu=0.2, density=2000.0, friction=0.3) for b in bottoms)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"domain": Domain(depth=8.0)}, "box.depth = 4 m: box's floor at 8 m must lie above domain.depth = 8 m"),
        ({"domain": Domain(width=5.0)}, "box.width = 5 m: box must lie inside domain.width = 5 m"),
        ({"box": Box(offset=7.5)}, "box.offset = 7.5 m: box must lie inside domain.width = 20 m"),
        ({"box": Box(offset=-7.6)}, "box.offset = -7.6 m: box must lie inside"),
        ({"box": Box(wall=2.0)}, "box.wall = 2 m: two walls must leave room inside 5 m x 4 m"),
        ({"layer": soft(1, 4, 4)}, "layer.3.bottom = 4 m: must lie below the layer above it, which ends at 4 m"),
        ({"layer": soft(5, 4)}, "layer.2.bottom = 4 m: must lie below"),
        ({"time": Time(dt=0.1, duration=0.05)}, "time.duration = 0.05 s: must be at least one time.dt = 0.1 s"),
        ({"time": Time(dt=1e-6, duration=20)}, "time.duration = 20 s: must be at most two million steps"),
        ({"time": Time(newmark_gamma=0.6)}, "time.newmark_beta = 0.25: must be at least 0.3025"),
        ({"time": Time(newmark_beta=0.2)}, "time.newmark_beta = 0.2: must be at least 0.25"),
        ({"supports": Supports(sides="shear")}, 'supports.sides = "shear": would carry the self-weight'),
        (
            {
                "supports": Supports(sides="shear"),
                "gravity": Gravity(self_weight=False),
                "motion": Motion(vertical_record="up.AT2"),
            },
            'supports.sides = "shear": is for horizontal motion only',
        ),
        (
            {"mesh": MeshOptions(mass="lumped")},
            'mesh.mass = "lumped": six-node triangles (mesh.order = 2) have no sound lumped mass',
        ),
        ({"joint": Joint(quadrature="one-point")}, 'joint.quadrature = "one-point": cannot hold a joint of six nodes'),
        ({"output": Output(sections=4)}, "output.sections = 4: must be odd, to have ends and a middle"),
        ({"output": Output(points={"A": (9.0, -1.0)})}, "output.points.A: is a name the model has already"),
        ({"output": Output(points={"P": (10.1, -1.0)})}, "output.points.P = [10.1 m, -1 m]: must lie in the ground"),
        ({"output": Output(points={"P": (0.0, 0.1)})}, "must lie in the ground or in the box's walls"),
        ({"output": Output(points={"P": (0.0, -14.1)})}, "must lie in the ground or in the box's walls"),
        ({"output": Output(points={"P": (0.0, -6.0)})}, "must lie in the ground or in the box's walls"),
    ],
)
def test_rule_between_fields_names_field_value_and_rule(given, message):
    with pytest.raises(ValidationError) as caught:
        Spec(**given)
    assert message in str(caught.value)


def test_all_rules_between_fields_are_reported_at_once():
    message = refused({"domain": Domain(width=4.0, depth=3.0), "time": Time(dt=1.0, duration=0.5)})
    assert message.count(" must ") == 3


@pytest.mark.parametrize(
    "given",
    [
        {"domain": Domain(depth=8.001)},
        {"box": Box(offset=-7.4)},
        {"box": Box(depth=0.0)},
        {"time": Time(dt=0.05, duration=0.05)},
        {"time": Time(newmark_beta=0.3025, newmark_gamma=0.6)},
        {"supports": Supports(sides="shear"), "gravity": Gravity(self_weight=False)},
        {"output": Output(points={"P": (2.25, -6.0), "Q": (0.0, -4.25), "R": (10.0, -14.0), "T": (-10.0, 0.0)})},
        {"mesh": MeshOptions(wall_elements=1, roof_elements=2, side_elements=2, first=3, growth=1)},
        {"mesh": MeshOptions(order=1, mass="lumped"), "joint": Joint(quadrature="one-point")},
        {"mesh": MeshOptions(corner_levels=0), "output": Output(sections=3)},
        {"layer": soft(100.0)},
        {"layer": soft(4.0 + 1e-12, 6.001, 14.0 - 1e-6)},  # on the roof's line, far enough from the middle; the last one goes on
    ],
)
def test_what_lies_just_inside_the_rules_is_a_model(given):
    spec = Spec(**given)
    for name, value in given.items():
        assert getattr(spec, name) == value
