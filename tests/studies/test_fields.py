"""Names, units, defaults and rules of the fields, as read off the engine's descriptions."""

from collections import Counter

import pytest

from engine.spec import Layer, Section, Spec
from engine.units import in_si
from studies.fields import catalogue, nearest, resolve

FIELDS = {field.name: field for field in catalogue()}
LEAVES = Counter(field.label for field in catalogue())
OUTSIDE_LAYERS = [field for field in catalogue() if field.path[0] != "layer"]


def names_of_spec():
    for table, info in Spec.model_fields.items():
        section = Layer if table == "layer" else type(info.default)
        assert issubclass(section, Section)
        yield from (f"{'layer.N' if table == 'layer' else table}.{name}" for name in section.model_fields)


def test_every_field_of_spec_is_in_the_catalogue_once():
    assert [field.name for field in catalogue()] == list(names_of_spec())


@pytest.mark.parametrize("field", catalogue(), ids=lambda field: field.name)
def test_every_field_says_what_it_means(field):
    assert len(field.meaning) > 3


@pytest.mark.parametrize("field", [field for field in catalogue() if field.unit], ids=lambda field: field.name)
def test_every_unit_can_be_written_in_a_study_file(field):
    assert in_si(f"1 {field.unit}", field.unit, unit_required=True) == 1.0


@pytest.mark.parametrize("field", [f for f in OUTSIDE_LAYERS if f.default != "–"], ids=lambda field: field.name)
def test_defaults_as_text_are_those_of_spec(field):
    table, name = field.path
    value = getattr(getattr(Spec(), table), name)
    if isinstance(value, float):
        assert in_si(field.default, field.unit or "1", unit_required=True) == pytest.approx(
            value, rel=1e-5
        )  # shown in six digits
    else:
        assert field.default == str(value).lower() or field.default == str(value)


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("box.nu", "≥ 0, < 0.5"),
        ("damping.ratio", "≥ 0, < 1"),
        ("domain.width", "> 0"),
        ("time.newmark_beta", "> 0, ≤ 0.5"),
        ("mesh.roof_elements", "≥ 2, ≤ 200, even"),
        ("mesh.mass", "consistent | lumped"),
        ("damping.joints", "true | false"),
        ("motion.peak", "> 0"),
        ("layer.N.Vs", "> 0"),
        ("box.offset", ""),
        ("output.every", "≥ 1, ≤ 100,000"),
        ("synthetic.seed", "≥ 0, ≤ 9,223,372,036,854,775,807"),
    ],
)
def test_rules_are_those_that_are_checked(name, rule):
    assert FIELDS[name].rule == rule


@pytest.mark.parametrize("field", OUTSIDE_LAYERS, ids=lambda field: field.name)
def test_dotted_name_resolves_also_with_underscores(field):
    assert resolve(field.name) == field
    assert resolve(field.name.replace(".", "_")) == field


@pytest.mark.parametrize("field", [f for f in OUTSIDE_LAYERS if LEAVES[f.label] == 1], ids=lambda field: field.name)
def test_last_part_resolves_where_it_is_unique(field):
    assert resolve(field.label) == field


@pytest.mark.parametrize("leaf", sorted(leaf for leaf, count in LEAVES.items() if count > 1))
def test_last_part_does_not_resolve_where_several_fields_have_it(leaf):
    """E alone could be the box's or a layer's."""
    assert resolve(leaf) is None


def test_fields_of_a_layer_resolve_by_its_number():
    field = resolve("layer.2.E")
    assert (field.name, field.unit, field.path) == ("layer.2.E", "Pa", ("layer", "2", "E"))


@pytest.mark.parametrize(
    "name", ["", "p1", "layer.2", "layer.2.e", "layer.N.E", "layer_N_E", "pressure", "pressure.p0.x", "Box.E"]
)
def test_other_names_do_not_resolve(name):
    assert resolve(name) is None


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("box.widht", "box.width"),
        ("dampingratio", "damping.ratio"),
        ("duratoin", "time.duration"),
        ("motion.dt", "time.dt"),
        ("mesh.wall_element", "mesh.wall_elements"),
        ("box.Width", "box.width"),
        ("Box.E", "box.E"),
        ("P0", "pressure.p0"),
        ("damping_ration", "damping.ratio"),
        ("ricker.freq", "ricker.frequency"),
        ("layer.2.botom", "layer.2.bottom"),
        ("layer_2_botom", "layer.2.bottom"),
        ("layer.3.unit_weigth", "layer.3.unit_weight"),
        ("layer.E", "layer.1.E"),
        ("layer_E", "layer.1.E"),
        ("bottom", "layer.1.bottom"),
    ],
)
def test_nearest_known_name(written, meant):
    assert nearest(written, list(FIELDS)) == f"; did you mean {meant}?"


@pytest.mark.parametrize("name", ["zzzzzz", "", ".", "studies", "time.steps", "layer.1.soil", "layer.2.name", "a.b.c"])
def test_nothing_is_proposed_for_a_name_like_no_other(name):
    """Least of all a field of another table that happens to share some letters."""
    assert nearest(name, list(FIELDS)) == ""


def test_a_known_name_in_quotes_is_one_key():
    assert nearest("box.width", list(FIELDS)) == "; write box.width without quotes"


def test_numbers_are_told_from_words():
    words = {field.name for field in catalogue() if field.single and not field.numeric}
    assert words == {
        "motion.record",
        "motion.vertical_record",
        "motion.record_unit",
        "damping.joints",
        "mesh.mass",
        "joint.quadrature",
        "supports.sides",
        "gravity.self_weight",
    }
    assert all(not field.unit for field in catalogue() if not field.numeric)
