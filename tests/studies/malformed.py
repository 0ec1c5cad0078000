"""Study files and records with mistakes, and what the lines that tell them must hold."""

from typing import NamedTuple


class Bad(NamedTuple):
    """A malformed study file, and for each of its mistakes what the line must hold: field, value as written, rule."""

    name: str
    text: str
    told: tuple[tuple[str, str, str], ...]


def bad(name, text, *told):
    return Bad(name, text, told)


LAYER = 'nu = 0.2\nfriction = 0.3\nE = "1 GPa"\ndensity = "2000 kg/m**3"\n'

FILES = [
    # the file's own keys
    bad("title that is a number", "title = 3", ("title", "3", "text in quotes")),
    bad("unknown model", 'model = "coral-2011"', ("model", '"coral-2011"', "coral-2010")),
    bad("model that is a number", "model = 3", ("model", "3", "coral-2010")),
    bad("unknown key", 'modle = "coral-2010"', ("modle", '"coral-2010"', "did you mean model?")),
    bad("unknown table", "[presure]\np0 = 1", ("presure", "{ p0 = 1 }", "did you mean pressure?")),
    bad("field without its table", 'p0 = "2 MPa"', ("p0", '"2 MPa"', "did you mean pressure.p0?")),
    bad("unknown field", '[box]\nwidht = "5 m"', ("box.widht", '"5 m"', "did you mean box.width?")),
    bad("table that is a number", "pressure = 3", ("pressure", "3", "must be a table")),
    bad("table that is a list", "pressure = [1]", ("pressure", "[", "must be a table")),
    # quantities
    bad("no unit", "[pressure]\np0 = 2e6", ("pressure.p0", "2e+06", 'needs a unit, as in "2e+06 Pa"')),
    bad("no unit in quotes", '[pressure]\np0 = "2"', ("pressure.p0", '"2"', "needs a unit")),
    bad("wrong unit", '[pressure]\np0 = "2 cm"', ("pressure.p0", '"2 cm"', "must be a quantity in Pa")),
    bad("unknown unit", '[pressure]\np0 = "2 xyz"', ("pressure.p0", '"2 xyz"', "not known; must be a unit like Pa")),
    bad("no number", '[pressure]\np0 = "high"', ("pressure.p0", '"high"', "must be a number and a unit")),
    bad("decimal comma", '[box]\nwall = "0,5 m"', ("box.wall", '"0,5 m"', "write a decimal point")),
    bad("boolean for a quantity", "[pressure]\np0 = true", ("pressure.p0", "true", "must be a number with a unit")),
    bad(
        "list for a quantity",
        "[pressure]\np0 = [1]",
        ("pressure.p0", "[1]", 'must be a number with a unit in quotes, as in "2.5 Pa"; several values belong in [sweep]'),
    ),
    bad("table for a quantity", "[pressure]\np0 = {a = 1}", ("pressure.p0", "", "must be a number with a unit")),
    bad("date for a quantity", "[pressure]\np0 = 1979-05-27", ("pressure.p0", "= 1979-05-27:", "must be a number with a unit")),
    bad("not a number", "[pressure]\np0 = nan", ("pressure.p0", "nan", "must be finite")),
    bad("infinite", "[pressure]\np0 = inf", ("pressure.p0", "inf", "must be finite")),
    bad("infinite in SI", '[domain]\nwidth = "1e300 Gm"', ("domain.width", '"1e300 Gm"', "must be finite")),
    bad("unit on a pure number", '[box]\nnu = "0.2 m"', ("box.nu", '"0.2 m"', "must be")),
    # ranges of single fields
    bad("nu of a fluid", "[box]\nnu = 0.5", ("box.nu", "0.5", "must be less than 0.5")),
    bad("negative nu", "[box]\nnu = -0.1", ("box.nu", "-0.1", "must be 0 or more")),
    bad("no stiffness", '[box]\nE = "0 Pa"', ("box.E", '"0 Pa"', "must be greater than 0")),
    bad("damping of one", "[damping]\nratio = 1.0", ("damping.ratio", "1", "must be less than 1")),
    bad("no time step", '[time]\ndt = "0 s"', ("time.dt", '"0 s"', "must be greater than 0")),
    bad("negative peak", '[motion]\npeak = "-1 m/s**2"', ("motion.peak", '"-1 m/s**2"', "must be greater than 0")),
    bad("shrinking mesh", "[mesh]\ngrowth = 0.5", ("mesh.growth", "0.5", "must be 1 or more")),
    bad("no elements", "[mesh]\nwall_elements = 0", ("mesh.wall_elements", "0", "must be 1 or more")),
    bad("corners that hardly grow", "[mesh]\ncorner_growth = 1.01", ("mesh.corner_growth", "1.01", "must be 1.1 or more")),
    bad("half an element", "[mesh]\nwall_elements = 1.5", ("mesh.wall_elements", "1.5", "must be a whole number")),
    bad("odd number of elements", "[mesh]\nroof_elements = 5", ("mesh.roof_elements", "5", "must be even")),
    bad("text for a whole number", '[mesh]\nwall_elements = "2"', ("mesh.wall_elements", '"2"', "must be a whole number")),
    bad("boolean for a whole number", "[mesh]\nwall_elements = true", ("mesh.wall_elements", "true", "must be a whole number")),
    bad("text for a boolean", '[damping]\njoints = "yes"', ("damping.joints", '"yes"', "must be true or false")),
    bad("number for a boolean", "[gravity]\nself_weight = 1", ("gravity.self_weight", "1", "must be true or false")),
    bad("unknown choice", '[mesh]\nmass = "heavy"', ("mesh.mass", '"heavy"', "'consistent' or 'lumped'")),
    bad("number for a choice", "[supports]\nsides = 1", ("supports.sides", "1", "'tied', 'shear', 'roller' or 'fixed'")),
    bad("one frequency", '[damping]\nfrequencies = ["1 Hz"]', ("damping.frequencies", '["1 Hz"]', "must have 2 entries")),
    bad("three frequencies", '[damping]\nfrequencies = ["1 Hz", "2 Hz", "3 Hz"]', ("damping.frequencies", "[", "at most 2")),
    bad("unstable Newmark", "[time]\nnewmark_beta = 0.2", ("time.newmark_beta", "0.2", "must be at least 0.25")),
    bad("beta too small for gamma", "[time]\nnewmark_gamma = 0.6", ("time.newmark_beta", "0.25", "must be at least 0.3025")),
    bad("elements of no order", "[mesh]\norder = 0", ("mesh.order", "0", "must be 1 or more")),
    bad("elements of third order", "[mesh]\norder = 3", ("mesh.order", "3", "must be 2 or less")),
    bad("half an order", "[mesh]\norder = 1.5", ("mesh.order", "1.5", "must be a whole number")),
    bad("corners that grow", "[mesh]\ncorner_levels = -1", ("mesh.corner_levels", "-1", "must be 0 or more")),
    bad("corners without end", "[mesh]\ncorner_levels = 9", ("mesh.corner_levels", "9", "must be 8 or less")),
    bad("corners of equal elements", "[mesh]\ncorner_growth = 1", ("mesh.corner_growth", "1", "must be 1.1 or more")),
    bad("too few sections", "[output]\nsections = 2", ("output.sections", "2", "must be 3 or more")),
    bad("too many sections", "[output]\nsections = 101", ("output.sections", "101", "must be 99 or less")),
    # rules between fields
    bad(
        "sections without a middle", "[output]\nsections = 4", ("output.sections", "4", "must be odd, to have ends and a middle")
    ),
    bad(
        "lumped mass of six-node triangles",
        '[mesh]\norder = 2\nmass = "lumped"',
        ("mesh.mass", '"lumped"', "six-node triangles (mesh.order = 2) have no sound lumped mass; choose consistent"),
    ),
    bad("lumped mass of the default", '[mesh]\nmass = "lumped"', ("mesh.mass", '"lumped"', "choose consistent")),
    bad(
        "joint of six nodes with one point",
        '[joint]\nquadrature = "one-point"',
        ("joint.quadrature", '"one-point"', "cannot hold a joint of six nodes (mesh.order = 2); choose nodal"),
    ),
    bad(
        "all that six-node triangles do not take",
        '[mesh]\nmass = "lumped"\n[joint]\nquadrature = "one-point"\n[output]\nsections = 6',
        ("mesh.mass", '"lumped"', "choose consistent"),
        ("joint.quadrature", '"one-point"', "choose nodal"),
        ("output.sections", "6", "must be odd"),
    ),
    bad("box deeper than the domain", '[box]\ndepth = "12 m"', ("box.depth", "12 m", "must lie above domain.depth = 14 m")),
    bad("box wider than the domain", '[box]\nwidth = "20 m"', ("box.width", "20 m", "must lie inside domain.width = 20 m")),
    bad("walls without room", '[box]\nwall = "2 m"', ("box.wall", "2 m", "must leave room")),
    bad("box beside the domain", '[box]\noffset = "8 m"', ("box.offset", "8 m", "must lie inside domain.width = 20 m")),
    bad("shorter than a step", '[time]\nduration = "1 ms"', ("time.duration", "0.001 s", "at least one time.dt = 0.005 s")),
    bad("too many steps", '[time]\ndt = "1 us"', ("time.duration", "20 s", "at most two million steps")),
    bad("weight on shear sides", '[supports]\nsides = "shear"', ("supports.sides", '"shear"', "self-weight")),
    # layers
    bad("no layers", "layer = []", ("layer", "[]", "must have at least one entry")),
    bad("layer that is a table", '[layer]\nE = "1 GPa"', ("layer", "", "must be a list of tables, each headed [[layer]]")),
    bad(
        "layer without nu and friction",
        '[[layer]]\nbottom = "1 m"\nE = "1 GPa"\ndensity = "2 t/m**3"',
        ("layer.1.nu", "", "is missing"),
        ("layer.1.friction", "", "is missing"),
    ),
    bad(
        "layer with E and G",
        f'[[layer]]\nbottom = "14 m"\nG = "1 GPa"\n{LAYER}',
        ("layer.1", "E and G", "exactly one of E, G, Vs"),
    ),
    bad(
        "layers out of order",
        f'[[layer]]\nbottom = "4 m"\n{LAYER}[[layer]]\nbottom = "2 m"\n{LAYER}',
        ("layer.2.bottom", "2 m", "must lie below the layer above it"),
    ),
    bad(
        "layer that ends a hair below the roof",
        f'[[layer]]\nbottom = "4.000001 m"\n{LAYER}[[layer]]\nbottom = "14 m"\n{LAYER}',
        ("layer.1.bottom", "4.000001 m", "lies 1e-06 m beside the top of the roof, at 4 m; must be on it"),
    ),
    bad(
        "layer that ends a hair above the middle of the box",
        f'[[layer]]\nbottom = "5.999999 m"\n{LAYER}[[layer]]\nbottom = "14 m"\n{LAYER}',
        ("layer.1.bottom", "5.999999 m", "lies 1e-06 m beside the middle of the box's height, at 6 m; must be on it"),
    ),
    bad(
        "layer as thick as a hair",
        f'[[layer]]\nbottom = "2 m"\n{LAYER}[[layer]]\nbottom = "2.00001 m"\n{LAYER}[[layer]]\nbottom = "14 m"\n{LAYER}',
        ("layer.2.bottom", "2.00001 m", "makes a layer of 1e-05 m; must be 0.0001 m thick or more"),
    ),
    bad(
        "box a hair below the surface",
        '[box]\ndepth = "1e-6 m"\nheight = "5.3 m"',
        ("box.depth", "1e-06 m", "leaves 1e-06 m of ground to the surface"),
    ),
    bad(
        "layer with a typing mistake",
        f'[[layer]]\nbotom = "4 m"\nbottom = "4 m"\n{LAYER}',
        ("layer.1.botom", '"4 m"', "did you mean layer.1.bottom?"),
    ),
    # points
    bad("point with a taken name", '[output.points]\nA = ["1 m", "-1 m"]', ("output.points.A", "", "has already")),
    bad("point outside", '[output.points]\nX = ["99 m", "-1 m"]', ("output.points.X", "[99 m, -1 m]", "must lie in the ground")),
    bad(
        "point in the void", '[output.points]\nX = ["0 m", "-6 m"]', ("output.points.X", "[0 m, -6 m]", "must lie in the ground")
    ),
    bad("point without unit", "[output.points]\nX = [0, -1]", ("output.points.X.2", "-1", "needs a unit")),
    # the sweep
    bad("sweep that is a number", "sweep = 3", ("sweep", "3", "must be a table")),
    bad("empty axis", "[sweep]\np0 = []", ("sweep.p0", "[]", "at least one value")),
    bad("axis of one bare value", '[sweep]\np0 = "1 MPa"', ("sweep.p0", '"1 MPa"', "must be a list")),
    bad("nested list", '[sweep]\np0 = [["1 MPa"]]', ("sweep.p0", "[", "must be a value or a range")),
    bad("unknown axis", "[sweep]\ndamping_ration = [0.05]", ("sweep.damping_ration", "", "did you mean damping.ratio?")),
    bad("axis of several fields", '[sweep]\ndepth = ["1 m"]', ("sweep.depth", "", "write domain.depth or box.depth")),
    bad("axis without unit", '[sweep]\np0 = ["1 MPa", 2]', ("sweep.p0", "2", "needs a unit")),
    bad("value twice", '[sweep]\np0 = ["1 MPa", "1e6 Pa"]', ("sweep.p0", "1e+06 Pa", "twice")),
    bad(
        "field twice",
        '[sweep]\np0 = ["1 MPa"]\npressure.p0 = ["2 MPa"]',
        ("sweep.pressure.p0", "", "pressure.p0 is swept already"),
    ),
    bad("value outside its range", "[sweep]\ndamping_ratio = [0.05, 1.5]", ("sweep.damping_ratio", "1.5", "must be less than 1")),
    bad("values that do not fit", '[sweep]\ndomain_width = ["15 m", "4 m"]', ("sweep.domain_width", "4 m", "must lie inside")),
    bad(
        "axes that do not fit together",
        '[sweep]\ndomain_width = ["15 m", "12 m"]\nbox_width = ["5 m", "13 m"]',
        ("sweep", "13 m", "must lie inside domain.width = 12 m"),
    ),
    bad("layer that is not there", '[sweep]\nlayer.9.E = ["1 GPa"]', ("sweep.layer.9.E", "", "there are 5 layers")),
    bad("layer without its number", '[sweep]\nlayer.N.E = ["1 GPa"]', ("sweep.layer.N.E", "", "did you mean layer.1.E?")),
    bad(
        "range of a billion",
        '[sweep]\np0 = { from = "0 Pa", to = "1 MPa", num = 1e9 }',
        ("sweep.p0.num", "1e+09", "must be a whole number from 2 to 1,000,000"),
    ),
    bad("range of one", '[sweep]\np0 = { from = "0 Pa", to = "1 MPa", num = 1 }', ("sweep.p0.num", "1", "from 2 to")),
    bad(
        "range without its parts",
        '[sweep]\np0 = { spacing = "log" }',
        ("sweep.p0.from", "", "is missing"),
        ("sweep.p0.to", "", "is missing"),
        ("sweep.p0.num", "", "is missing"),
    ),
    bad(
        "range with an unknown part",
        '[sweep]\np0 = { from = "0 Pa", to = "1 MPa", step = 3, num = 3 }',
        ("sweep.p0.step", "", "must be from, to, num or spacing"),
    ),
    bad(
        "range with a wrong spacing",
        '[sweep]\np0 = { from = "1 Pa", to = "1 MPa", num = 3, spacing = "cubic" }',
        ("sweep.p0.spacing", '"cubic"', '"linear" or "log"'),
    ),
    bad(
        "logarithmic range from zero",
        '[sweep]\np0 = { from = 0, to = "1 MPa", num = 3, spacing = "log" }',
        ("sweep.p0", "", "must lie above zero"),
    ),
    bad(
        "range without a unit",
        '[sweep]\np0 = { from = "1 MPa", to = 3, num = 3 }',
        ("sweep.p0.to", "3", "needs a unit"),
    ),
    bad(
        "a billion cases",
        '[sweep]\np0 = { from = 0, to = "1 MPa", num = 1000 }\nscale = { from = 0, to = 1, num = 1000 }\n'
        'dt = { from = "1 ms", to = "9 ms", num = 1000 }',
        ("sweep", "1,000,000,000 cases", "must be at most 1,000,000"),
    ),
    # records
    bad("record that is a number", "[motion]\nrecord = 3", ("motion.record", "3", "must be text in quotes")),
    bad("unknown record", '[motion]\nrecord = "nix.AT2"', ("motion.record", '"nix.AT2"', "no such file beside the study")),
    bad("unknown record in the sweep", '[sweep]\nrecord = ["none", "x.AT2"]', ("motion.record", '"x.AT2"', "no such file")),
    bad("empty name of a record", '[motion]\nrecord = ""', ("motion.record", '""', "no such file")),
    bad("name with a zero byte", '[motion]\nrecord = "a\\u0000b"', ("motion.record", '"a\\x00b"', "no such file")),
    bad(
        "steps of no common multiple",
        '[time]\ndt = "0.0123456789 s"',
        ("motion", "0.0123457 s", "cannot be brought to"),
    ),
    # several at once
    bad(
        "a mistake in every table",
        'titel = "x"\n[box]\nwidht = "5 m"\nnu = 0.7\n[pressure]\np0 = "200 cm"\n[motion]\nrecord = "nix.AT2"\n'
        '[sweep]\np1 = [1]\ndamping_ratio = { from = 0.1, to = "3 m", num = 2 }\n',
        ("titel", '"x"', "did you mean title?"),
        ("box.widht", '"5 m"', "did you mean box.width?"),
        ("box.nu", "0.7", "must be less than 0.5"),
        ("pressure.p0", '"200 cm"', "must be a quantity in Pa"),
        ("motion.record", '"nix.AT2"', "no such file"),
        ("sweep.p1", "", "is not a field"),
        ("sweep.damping_ratio.to", '"3 m"', "must be"),
    ),
    bad(
        "a value of the model and a value of the sweep",
        "[box]\nnu = 0.7\n[sweep]\ndamping_ratio = [1.5]",
        ("box.nu", "0.7", "must be less than 0.5"),
        ("damping_ratio", "1.5", "must be less than 1"),
    ),
    bad(
        "two rules between fields",
        '[box]\ndepth = "12 m"\nwall = "2 m"',
        ("box.depth", "12 m", "must lie above domain.depth"),
        ("box.wall", "2 m", "must leave room"),
    ),
    # words and types that TOML takes and a study does not
    bad("title that is a list", 'title = ["a"]', ("title", '["a"]', "text in quotes")),
    bad("title that is a date", "title = 1979-05-27", ("title", "= 1979-05-27:", "text in quotes")),
    bad("time of day", "[pressure]\np0 = 12:00:00", ("pressure.p0", "12:00:00", "must be a number with a unit")),
    bad("keys that nest", "a.b.c.d = 1", ("a = ", "{ b = { c = { d = 1 } } }", "is not a table")),
    bad("dotted key in quotes", '"box.width" = "5 m"', ("box.width", '"5 m"', "write box.width without quotes")),
    bad("table in capitals", '[Pressure]\np0 = "1 Pa"', ("Pressure", '{ p0 = "1 Pa" }', "did you mean pressure?")),
    bad("field in capitals", '[box]\nWidth = "5 m"', ("box.Width", '"5 m"', "did you mean box.width?")),
    bad("table in the plural", "layers = 3", ("layers", "3", "did you mean layer?")),
    bad("box in double brackets", '[[box]]\nwidth = "5 m"', ("box", '[{ width = "5 m" }]', "write [box] in single brackets")),
    bad("sweep in double brackets", '[[sweep]]\np0 = ["1 Pa"]', ("sweep", "[{", "write [sweep] in single brackets")),
    bad("table that is a value", 'box = "5 m"', ("box", '"5 m"', "must be a table: [box], and its fields below it")),
    bad(
        "list for a field",
        '[box]\nwidth = ["5 m", "6 m"]',
        ("box.width", '["5 m", "6 m"]', "several values belong in [sweep]"),
    ),
    bad(
        "range for a field",
        '[pressure]\np0 = { from = 0, to = "1 Pa", num = 2 }',
        ("pressure.p0", "", "several values belong in [sweep]"),
    ),
    bad("field of another table", '[motion]\ndt = "5 ms"', ("motion.dt", '"5 ms"', "did you mean time.dt?")),
    bad("field like no other", "[time]\nsteps = 100", ("time.steps", "100", "is not a field")),
    bad("beginning of a field", '[ricker]\nfreq = "5 Hz"', ("ricker.freq", '"5 Hz"', "did you mean ricker.frequency?")),
    # units
    bad("the issue's wrong unit", '[pressure]\np0 = "200 cm"', ("pressure.p0", '"200 cm"', "must be a quantity in Pa")),
    bad("siemens for seconds", '[time]\ndt = "5 S"', ("time.dt", '"5 S"', "must be a quantity in s")),
    bad("gram for gravity", '[motion]\npeak = "0.2 g"', ("motion.peak", '"0.2 g"', "the standard gravity is g_0")),
    bad("gallon for galileo", '[motion]\npeak = "170 gal"', ("motion.peak", '"170 gal"', "the unit of gravimetry is Gal")),
    bad("velocity for a peak", '[motion]\npeak = "20 cm/s"', ("motion.peak", '"20 cm/s"', "must be a quantity in m/s**2")),
    bad("unit in small letters", '[box]\nE = "34 gpa"', ("box.E", '"34 gpa"', "not known; must be a unit like Pa")),
    bad("sum for a quantity", '[box]\nE = "1 Pa + 2 Pa"', ("box.E", '"1 Pa + 2 Pa"', "not known")),
    bad("spaces in a number", '[box]\nE = "34 000 MPa"', ("box.E", '"34 000 MPa"', "write one number without spaces")),
    bad("two signs", '[box]\nE = "--1 Pa"', ("box.E", '"--1 Pa"', 'must be a number and a unit, as in "2.5 Pa"')),
    bad("empty quantity", '[box]\nE = ""', ("box.E", '""', "must be a number and a unit")),
    bad("temperature", '[box]\nE = "5 degC"', ("box.E", '"5 degC"', "must be a quantity in Pa")),
    bad("too large for its square", '[pressure]\np0 = "1e31 Pa"', ("pressure.p0", '"1e31 Pa"', "from 1e-30 to 1e+30 Pa")),
    bad("denormal", '[box]\nwall = "1e-310 m"', ("box.wall", '"1e-310 m"', "zero or of a size from 1e-30")),
    bad("too small, of no unit", "[motion]\nscale = 1e-40", ("motion.scale", "1e-40", "from 1e-30 to 1e+30")),
    bad(
        "damping of a domain beyond all meshes",  # it was meshed, for ever
        '[damping]\nreference_width = "1e9 m"',
        ("mesh.first", "1 m", "of the damping's domain of 1e+09 m x 14 m; must be at most 500,000"),
    ),
    bad("too large in SI", '[box]\nE = "1e308 GPa"', ("box.E", '"1e308 GPa"', "must be finite")),
    bad("angular frequency", '[ricker]\nfrequency = "5 rad/s"', ("ricker.frequency", '"5 rad/s"', "divide by 2 pi")),
    bad("percent without its sign", '[damping]\nratio = "5"', ("damping.ratio", '"5"', "must be less than 1")),
    bad("hardly a fluid", "[box]\nnu = 0.500000001", ("box.nu", "0.500000001", "must be less than 0.5")),
    bad("unit on a factor", '[motion]\nscale = "2 m"', ("motion.scale", '"2 m"', "a number without a unit")),
    # where the box lies
    bad("box above the ground", '[box]\ndepth = "-1 m"', ("box.depth", '"-1 m"', "must be 0 or more")),
    bad("box as deep as the domain", '[box]\nheight = "10 m"', ("box.depth", "4 m", "floor at 14 m must lie above")),
    bad("box beside the domain on the left", '[box]\noffset = "-8 m"', ("box.offset", "-8 m", "must lie inside")),
    bad("domain shallower than the box", '[domain]\ndepth = "5 m"', ("box.depth", "4 m", "must lie above domain.depth = 5 m")),
    bad("domain as wide as the box", '[domain]\nwidth = "5 m"', ("box.width", "5 m", "must lie inside domain.width = 5 m")),
    bad("box without width", '[box]\nwidth = "0 m"', ("box.width", '"0 m"', "must be greater than 0")),
    bad(
        "record below the base",
        '[motion]\nreference_depth = "20 m"',
        ("motion.reference_depth", "20 m", "must not lie below the base, domain.depth = 14 m"),
    ),
    bad(
        "width of the damping too small",
        '[damping]\nreference_width = "5 m"',
        ("damping.reference_width", "5 m", "must be wide enough for the box"),
    ),
    bad(
        "depth of the damping too small",
        '[damping]\nreference_depth = "8 m"',
        ("damping.reference_depth", "8 m", "box's floor at 8 m must lie above it"),
    ),
    # layers
    bad("layers in single brackets", f'[layer.1]\nbottom = "4 m"\n{LAYER}', ("layer", "", "each headed [[layer]]")),
    bad("layer of words", 'layer = ["1 m"]', ("layer.1", '"1 m"', "must be a table")),
    bad("layer without its bottom", f"[[layer]]\n{LAYER}", ("layer.1.bottom", "", "is missing")),
    bad("layer of no thickness", f'[[layer]]\nbottom = "0 m"\n{LAYER}', ("layer.1.bottom", '"0 m"', "greater than 0")),
    bad(
        "two layers of one bottom",
        f'[[layer]]\nbottom = "4 m"\n{LAYER}[[layer]]\nbottom = "4 m"\n{LAYER}',
        ("layer.2.bottom", "4 m", "which ends at 4 m"),
    ),
    bad(
        "layer of a fluid",
        f'[[layer]]\nbottom = "14 m"\n{LAYER}'.replace("0.2", "0.5"),
        ("layer.1.nu", "0.5", "must be less than 0.5"),
    ),
    bad(
        "layer with negative friction",
        f'[[layer]]\nbottom = "14 m"\n{LAYER}'.replace("0.3", "-0.3"),
        ("layer.1.friction", "-0.3", "must be 0 or more"),
    ),
    bad(
        "layer with density and unit weight",
        f'[[layer]]\nbottom = "14 m"\nunit_weight = "20 kN/m**3"\n{LAYER}',
        ("layer.1", "density and unit_weight", "exactly one of density, unit_weight"),
    ),
    bad(
        "layer without stiffness",
        '[[layer]]\nbottom = "14 m"\nnu = 0.2\nfriction = 0.3\ndensity = "2 t/m**3"',
        ("layer.1", "none", "exactly one of E, G, Vs"),
    ),
    bad(
        "layer with a name",
        f'[[layer]]\nbottom = "14 m"\nname = "sand"\n{LAYER}',
        ("layer.1.name", '"sand"', "is not a field"),
    ),
    # the other tables
    bad("whole number as a float", "[output]\nevery = 2.0", ("output.every", "2.0", "must be a whole number")),
    bad("too seldom", "[output]\nevery = 100001", ("output.every", "100001", "must be 100,000 or less")),
    bad("points that are a list", "[output]\npoints = [1]", ("output.points", "[1]", "must be a table: [output.points]")),
    bad("point of one length", '[output.points]\nX = ["1 m"]', ("output.points.X", '["1 m"]', "must have 2 entries")),
    bad("point in space", '[output.points]\nX = ["1 m", 0, 0]', ("output.points.X", '["1 m", 0, 0]', "at most 2 entries")),
    bad("point in the air", '[output.points]\nX = [0, "1 m"]', ("output.points.X", "[0 m, 1 m]", "must lie in the ground")),
    bad("no frequencies", "[damping]\nfrequencies = []", ("damping.frequencies", "[]", "must have 2 entries")),
    bad("frequencies that are one", '[damping]\nfrequencies = "1 Hz"', ("damping.frequencies", '"1 Hz"', "must be a list")),
    bad("choice in capitals", '[supports]\nsides = "Tied"', ("supports.sides", '"Tied"', "'tied', 'shear'")),
    bad(
        "vertical motion on shear sides",
        '[supports]\nsides = "shear"\n[gravity]\nself_weight = false\n[motion]\nvertical_record = "ricker"',
        ("supports.sides", '"shear"', "is for horizontal motion only"),
    ),
    bad("quoted truth", '[gravity]\nself_weight = "true"', ("gravity.self_weight", '"true"', "must be true or false")),
    bad("too many elements in a wall", "[mesh]\nwall_elements = 21", ("mesh.wall_elements", "21", "must be 20 or less")),
    bad(
        "mesh of a million cells",
        '[mesh]\nfirst = "1 cm"\ngrowth = 1\nlargest_width = "1 cm"\nlargest_height = "1 cm"',
        ("mesh.first", "0.01 m", "must be at most 500,000"),
    ),
    bad("step longer than the motion", '[time]\ndt = "30 s"', ("time.duration", "20 s", "at least one time.dt = 30 s")),
    bad("a year", '[time]\nduration = "1 year"', ("time.duration", "3.15576e+07 s", "at most two million steps")),
    # generated motions
    bad("seed below zero", "[synthetic]\nseed = -1", ("synthetic.seed", "-1", "must be 0 or more")),
    bad("half a seed", "[synthetic]\nseed = 1.5", ("synthetic.seed", "1.5", "must be a whole number")),
    bad(
        "seed of 20 figures",
        "[synthetic]\nseed = 99999999999999999999",
        ("synthetic.seed", "99999999999999999999", "must be 9,223,372,036,854,775,807 or less"),
    ),
    bad("noise without damping", "[synthetic]\nlow_damping = 0", ("synthetic.low_damping", "0", "must be greater than 0")),
    bad("noise that never falls", '[synthetic]\ndecay = "3 m"', ("synthetic.decay", '"3 m"', "must be a quantity in s")),
    bad("length of the noise", '[synthetic]\nduration = "9 s"', ("synthetic.duration", '"9 s"', "did you mean time.duration?")),
    bad(
        "ground above the noise's step",
        '[motion]\nrecord = "synthetic"\n[synthetic]\nground_frequency = "100 Hz"',
        ("synthetic.ground_frequency", "100 Hz", "must lie between 0.0001 and 25 Hz for synthetic.step = 0.01 s"),
    ),
    bad(
        "noise with hardly any damping",
        '[motion]\nrecord = "synthetic"\n[synthetic]\nground_damping = 1e-5',
        ("synthetic.ground_damping", "1e-05", "must be 0.001 or more"),
    ),
    bad(
        "noise of no common multiple",
        '[motion]\nrecord = "synthetic"\n[synthetic]\nstep = "0.00123456789 s"',
        ('record = "synthetic"', "0.00123457 s", "cannot be brought to 0.005 s"),
    ),
    bad(
        "wavelet too fast for the step",
        '[motion]\nrecord = "ricker"\n[ricker]\nfrequency = "100 Hz"',
        ("ricker.frequency", "100 Hz", "needs a time.dt of at most 0.0025 s"),
    ),
    bad(
        "wavelet after the end",
        '[motion]\nrecord = "ricker"\n[ricker]\narrival = "25 s"',
        ("ricker.arrival", "25 s", "must lie within the 20 s that are followed"),
    ),
    bad("wavelet before the start", '[ricker]\narrival = "0 s"', ("ricker.arrival", '"0 s"', "must be greater than 0")),
    bad(
        "one wavelet of a sweep too fast",
        '[motion]\nrecord = "ricker"\n[sweep]\nricker.frequency = ["5 Hz", "100 Hz"]',
        ("ricker.frequency", "100 Hz", "needs a time.dt"),
    ),
    bad("generator in capitals", '[motion]\nrecord = "Synthetic"', ("motion.record", '"Synthetic"', "are generated")),
    # what is said of a record
    bad("unit that is a number", "[motion]\nrecord_unit = 3", ("motion.record_unit", "3", "must be text in quotes")),
    bad("unit that is empty", '[motion]\nrecord_unit = ""', ("motion.record_unit", '""', "needs a unit")),
    bad("unit of a length", '[motion]\nrecord_unit = "m"', ("motion.record_unit", '"m"', "must be a quantity in m/s**2")),
    bad("unit of mass", '[motion]\nrecord_unit = "g"', ("motion.record_unit", '"g"', "the standard gravity is g_0")),
    bad("rate for a step", '[motion]\nrecord_dt = "100 Hz"', ("motion.record_dt", '"100 Hz"', "must be a quantity in s")),
    bad("step without a unit", "[motion]\nrecord_dt = 0.01", ("motion.record_dt", "0.01", 'as in "0.01 s"')),
    bad("step of a PEER record", '[motion]\nrecord_dt = "5 ms"', ("motion.record", "", "leave out motion.record_dt")),
    bad("record in a list", '[motion]\nrecord = ["a", "b"]', ("motion.record", '["a", "b"]', "belong in [sweep]")),
    bad("record that is a folder", '[motion]\nrecord = "/tmp"', ("motion.record", '"/tmp"', "no such file")),
    bad("record in a folder that is not there", '[motion]\nrecord = "x/y.csv"', ("motion.record", '"x/y.csv"', "no such file")),
    bad("record with a long name", f'[motion]\nrecord = "{"x" * 5000}"', ("motion.record", "xxx...", "no such file")),
    # keys of the sweep
    bad("layer with an underscore", '[sweep]\nlayer_9_E = ["1 GPa"]', ("sweep.layer_9_E", "", "there are 5 layers")),
    bad("layer zero", '[sweep]\nlayer.0.E = ["1 GPa"]', ("sweep.layer.0.E", "", "there are 5 layers")),
    bad("layer of twenty figures", f'[sweep]\nlayer.{"9" * 20}.E = ["1 Pa"]', ("sweep.layer.9999", "", "there are 5 layers")),
    bad("all layers", '[sweep]\nlayer.E = ["1 GPa"]', ("sweep.layer.E", "", "did you mean layer.1.E?")),
    bad("no field of a layer", '[sweep]\nlayer.2 = ["1 GPa"]', ("sweep.layer.2", "", "is a table; name one of its fields")),
    bad("field of a layer alone", '[sweep]\nbottom = ["1 m"]', ("sweep.bottom", "", "did you mean layer.1.bottom?")),
    bad("E of anything", '[sweep]\nE = ["1 GPa"]', ("sweep.E", "", "write box.E or layer.1.E")),
    bad("width of anything", '[sweep]\nwidth = ["20 m"]', ("sweep.width", "", "write domain.width or box.width")),
    bad(
        "depth of the record or of the damping",
        '[sweep]\nreference_depth = ["9 m"]',
        ("sweep.reference_depth", "", "write motion.reference_depth or damping.reference_depth"),
    ),
    bad(
        "second stiffness of a layer",
        '[sweep]\nlayer.1.G = ["1 GPa"]',
        ("sweep.layer.1.G", "has E and G", "exactly one of E, G, Vs"),
    ),
    bad(
        "layers out of order in the sweep",
        '[sweep]\nlayer.1.bottom = ["5 m"]',
        ("sweep.layer.1.bottom", "layer.2.bottom = 4 m", "must lie below the layer above it"),
    ),
    bad(
        "table swept", '[sweep]\nmotion = ["x"]', ("sweep.motion", "", "is a table; name one of its fields, as in motion.record")
    ),
    bad("two frequencies swept", '[sweep]\nfrequencies = [["1 Hz"]]', ("sweep.frequencies", "", "holds several values")),
    bad("points swept", "[sweep]\npoints = [1]", ("sweep.points", "", "holds several values and cannot be swept")),
    bad(
        "sections swept",
        "[sweep]\noutput.sections = [3, 5]",
        ("sweep.output.sections", "", "decides what the results hold and cannot be swept; write a study for each"),
    ),
    bad("sections swept by their last name", "[sweep]\nsections = [3, 5]", ("sweep.sections", "", "cannot be swept")),
    bad(
        "order of a lumped mesh",
        '[mesh]\nmass = "lumped"\norder = 1\n[sweep]\nmesh.order = [1, 2]',
        ("sweep.mesh.order", "", "lumped"),
    ),
    bad("title swept", '[sweep]\ntitle = ["a"]', ("sweep.title", "", "is not a field")),
    bad("swept field in capitals", '[sweep]\nP0 = ["1 Pa"]', ("sweep.P0", "", "did you mean pressure.p0?")),
    bad("no name", '[sweep]\n"" = [1]', ("sweep.", "", "is not a field")),
    bad("value below its field", '[sweep.p0]\np0 = ["1 Pa"]', ("sweep.p0", '{ p0 = ["1 Pa"] }', "must be { from, to, num }")),
    # values of the sweep
    bad("an empty range", "[sweep]\np0 = {}", ("sweep.p0", "{}", "must be { from, to, num }")),
    bad("an empty range in a list", "[sweep]\np0 = [0, {}]", ("sweep.p0", "{}", "must be { from, to, num }")),
    bad(
        "range of other words",
        '[sweep]\np0 = { start = "1 Pa", stop = "2 Pa", n = 3 }',
        ("sweep.p0", '{ start = "1 Pa", stop = "2 Pa", n = 3 }', "must be { from, to, num }"),
    ),
    bad(
        "range of a billion, whole", '[sweep]\np0 = { from = 0, to = "1 Pa", num = 1000000000 }', ("p0.num", "1000000000", "to 1")
    ),
    bad("range of three, as a float", '[sweep]\np0 = { from = 0, to = "1 Pa", num = 3.0 }', ("p0.num", "3.0", "a whole number")),
    bad("range of minus three", '[sweep]\np0 = { from = 0, to = "1 Pa", num = -3 }', ("p0.num", "-3", "a whole number from 2")),
    bad("range of truth", '[sweep]\np0 = { from = 0, to = "1 Pa", num = true }', ("p0.num", "true", "a whole number from 2")),
    bad("range of words in quotes", '[sweep]\np0 = { from = 0, to = "1 Pa", num = "3" }', ("p0.num", '"3"', "a whole number")),
    bad("range from nothing to nothing", '[sweep]\np0 = { from = "1 Pa", to = "1 Pa", num = 3 }', ("p0", "1 Pa", "twice")),
    bad("range from no number", '[sweep]\np0 = { from = nan, to = "1 Pa", num = 3 }', ("p0.from", "nan", "must be finite")),
    bad(
        "logarithmic range through zero",
        '[sweep]\np0 = { from = "-1 Pa", to = "1 Pa", num = 3, spacing = "log" }',
        ("sweep.p0", "", "must lie above zero"),
    ),
    bad(
        "spacing that is a list",
        '[sweep]\np0 = { from = 0, to = "1 Pa", num = 3, spacing = ["log"] }',
        ("sweep.p0.spacing", '["log"]', '"linear" or "log"'),
    ),
    bad(
        "range of choices",
        '[sweep]\nsides = { from = "tied", to = "roller", num = 2 }',
        ("sweep.sides", "", 'a range is of numbers; list the values, as in ["tied", "shear"]'),
    ),
    bad(
        "range of truth values",
        "[sweep]\nself_weight = { from = 0, to = 1, num = 2 }",
        ("sweep.self_weight", "", "list the values, as in [true, false]"),
    ),
    bad("range of records", "[sweep]\nrecord = { from = 0, to = 1, num = 2 }", ("sweep.record", "", 'as in ["a", "b"]')),
    bad("range of halves", "[sweep]\nevery = { from = 1, to = 2, num = 3 }", ("sweep.every", "1.5", "must be a whole number")),
    bad("truth for a quantity", "[sweep]\np0 = [true]", ("sweep.p0", "true", "must be a number with a unit")),
    bad("date in the sweep", "[sweep]\np0 = [1979-01-01]", ("sweep.p0", "1979-01-01", "must be a number with a unit")),
    bad("words for a truth value", '[sweep]\nself_weight = ["yes"]', ("sweep.self_weight", '"yes"', "must be true or false")),
    bad("unknown choice in the sweep", '[sweep]\nsides = ["tied", "tide"]', ("sweep.sides", '"tide"', "'tied', 'shear'")),
    bad("numbers for records", "[sweep]\nrecord = [3]", ("sweep.record", "3", "must be text in quotes")),
    bad("one record, not a list", '[sweep]\nrecord = "none"', ("sweep.record", '"none"', "must be a list")),
    bad(
        "records that are not there",
        '[sweep]\nrecord = ["a.AT2", "b.csv", "none"]',
        ("motion.record", '"a.AT2"', "no such file"),
        ("motion.record", '"b.csv"', "no such file"),
    ),
    bad("a vertical record", '[sweep]\nvertical_record = ["none", "u"]', ("motion.vertical_record", '"u"', "no such file")),
    bad("steps of a record swept", '[sweep]\nrecord_dt = ["1 s", "2 s"]', ("motion.record", "", "cannot be swept")),
    bad("seed twice", "[sweep]\nseed = [1, 2, 1]", ("sweep.seed", "1", "twice")),
    bad("depth in SI", '[sweep]\nbox_depth = ["4 m", "-2 m"]', ("sweep.box_depth", "box.depth = -2 m", "must be 0 or more")),
    bad(
        "hundreds of values out of range",
        "[sweep]\ndamping_ratio = { from = 1, to = 2, num = 300 }",
        ("sweep.damping_ratio", "= 1:", "must be less than 1"),
        ("sweep.damping_ratio", "= 1.00334", "must be less than 1"),
        ("sweep.damping_ratio", "= 1.00668", "must be less than 1"),
        ("sweep.damping_ratio", "damping.ratio", "297 more like this"),
    ),
    # the domain's size
    bad("domain_size that is a number", "domain_size = 3", ("domain_size", "3", "must be a table: [domain_size]")),
    bad(
        "domain_size in double brackets",
        '[[domain_size]]\nwidth = { from = "10 m", num = 3 }',
        ("domain_size", "[{", "write [domain_size] in single brackets"),
    ),
    bad("no sizes", "[domain_size]", ("domain_size", "", "must have width or depth, as { from, factor, num }")),
    bad("one size", '[domain_size]\nwidth = "20 m"', ("domain_size.width", '"20 m"', "must be { from, factor, num }")),
    bad("sizes in a list", '[domain_size]\nwidth = ["9 m"]', ("domain_size.width", '["9 m"]', "must be { from, factor, num }")),
    bad("sizes without a number", '[domain_size]\nwidth = { from = "10 m" }', ("domain_size.width.num", "", "is missing")),
    bad(
        "sizes without a unit", "[domain_size]\nwidth = { from = 10, num = 3 }", ("domain_size.width.from", "10", 'as in "10 m"')
    ),
    bad("two sizes", '[domain_size]\nwidth = { from = "10 m", num = 2 }', ("domain_size.width.num", "2", "must be 3 or more")),
    bad(
        "sizes by halves",
        '[domain_size]\nwidth = { from = "9 m", num = 3.0 }',
        ("domain_size.width.num", "3.0", "a whole number"),
    ),
    bad(
        "sizes that hardly grow",
        '[domain_size]\nwidth = { from = "10 m", num = 3, factor = 1.1 }',
        ("domain_size.width.factor", "1.1", "must be 1.25 or more"),
    ),
    bad(
        "sizes to an end",
        '[domain_size]\nwidth = { from = "10 m", num = 3, to = "30 m" }',
        ("domain_size.width.to", '"30 m"', "must be from, factor or num"),
    ),
    bad(
        "sizes by another name",
        '[domain_size]\nheight = { from = "10 m", num = 3 }\nwidth = { from = "10 m", num = 3 }',
        ("domain_size.height", "", "must be width, depth, tolerance or measure"),
    ),
    bad(
        "no tolerance",
        '[domain_size]\nwidth = { from = "10 m", num = 3 }\ntolerance = 0',
        ("domain_size.tolerance", "0", "must be greater than 0"),
    ),
    bad(
        "unknown measure",
        '[domain_size]\nwidth = { from = "10 m", num = 3 }\nmeasure = "drift"',
        ("domain_size.measure", '"drift"', "'u_x at A', 'racking'"),
    ),
    bad(
        "size beside a sweep",
        '[domain_size]\nwidth = { from = "10 m", num = 3 }\n[sweep]\np0 = ["1 Pa"]',
        ("domain_size", "", "stands alone; leave out [sweep]"),
    ),
    bad(
        "sizes that the box does not fit",
        '[domain_size]\nwidth = { from = "4.5 m", num = 3 }',
        ("domain_size", "box.width = 5 m", "must lie inside domain.width = 4.5 m"),
    ),
    bad(
        "sizes beyond all meshes",
        '[domain_size]\nwidth = { from = "10 m", num = 49, factor = 4 }',
        ("domain_size", "mesh.first", "7.1e+05 cells"),
        ("domain_size", "mesh.first", "2.8e+06 cells"),
        ("domain_size", "mesh.first", "1.1e+07 cells"),
        ("domain_size", "mesh.first", "39 more like this"),
    ),
]


UNIT = 'record_unit = "cm/s**2"\n'
BOTH = UNIT + 'record_dt = "0.01 s"\n'
HEADER = "NPTS= 3, DT= .0100 SEC\n"
TABLE = "t, a\n" + "".join(f"{0.01 * i:.2f},{50 * (-1) ** i}\n" for i in range(50))
KNET = (
    "Origin Time       2006/01/18 23:25:00\nLat.              37.798\nLong.             142.200\nDepth. (km)       36\n"
    "Mag.              5.7\nStation Code      MYG002\nStation Lat.      38.7262\nStation Long.     141.5109\n"
    "Station Height(m) 79\nRecord Time       2006/01/18 23:25:46\nSampling Freq(Hz) 100Hz\nDuration Time(s)  1\n"
    "Dir.              N-S\nScale Factor      1000(gal)/1000\nMax. Acc. (gal)   50.000\n"
    "Last Correction   2006/01/18 23:25:31\nMemo.\n" + "".join(f"{50 * (-1) ** i:9d}" for i in range(100)) + "\n"
)
"""A hundred counts of 1 gal, up and down."""


class Broken(NamedTuple):
    """A record that cannot be used: its file and what the study says of it, and what the line must hold."""

    name: str
    file: str
    content: bytes
    settings: str
    reason: str


def broken(name, file, content, settings, reason):
    return Broken(name, file, content if isinstance(content, bytes) else content.encode(), settings, reason)


RECORDS = [
    broken("AT2, empty", "a.AT2", b"", "", "NPTS"),
    broken("AT2, no header", "a.AT2", "1 2 3\n", "", "is it a PEER AT2 file?"),
    broken("AT2, too few values", "a.AT2", "NPTS= 4, DT= .0100 SEC\n1 2 3\n", "", "holds 3 values, its header says 4"),
    broken("AT2, too many values", "a.AT2", "NPTS= 2, DT= .0100 SEC\n1 2 3\n", "", "holds 3 values, its header says 2"),
    broken("AT2, a word among the values", "a.AT2", HEADER + "1 x 3\n", "", "line 2: 'x' is not a number"),
    broken("AT2, not a number", "a.AT2", HEADER + "1 nan 3\n", "", "line 2: 'nan' is not a number"),
    broken("AT2, infinite", "a.AT2", HEADER + "1 inf 3\n", "", "is not finite"),
    broken("AT2, too large for a float", "a.AT2", HEADER + "1 1e400 3\n", "", "is not finite"),
    broken("AT2, too large for a float in SI", "a.AT2", HEADER + "1 1e308 3\n", "", "is not finite"),
    broken("AT2, one value", "a.AT2", "NPTS= 1, DT= .0100 SEC\n1\n", "", "at least two values"),
    broken("AT2, no time step", "a.AT2", "NPTS= 2, DT= 0 SEC\n1 2\n", "", "must be above zero"),
    broken("AT2, step of milliseconds", "a.AT2", "NPTS= 2, DT= 10 SEC\n1 2\n", "", "steps by 10 s; is its time in seconds?"),
    broken("AT2, binary", "a.AT2", bytes(range(256)), "", "is not text"),
    broken("AT2, zero throughout", "a.AT2", HEADER + "0 0 0\n", "", "is zero throughout"),
    broken("AT2, in cm/s²", "a.AT2", HEADER + "100 200 300\n", "", "reaches 300 g; no earthquake"),
    broken("AT2, of nothing", "a.AT2", HEADER + "1e-9 0 0\n", "", "m/s² only; is the unit right?"),
    broken("AT2, of velocities", "a.AT2", "UNITS OF CM/S\n" + HEADER + "1 2 3\n", "", "says units of CM/S; a PEER record"),
    broken("AT2, with another unit", "a.AT2", HEADER + ".1 .2 .3\n", BOTH, "leave out motion.record_dt and motion.record_unit"),
    broken("CSV without its unit", "a.csv", TABLE, "", 'needs motion.record_unit, as in "cm/s**2"'),
    broken("CSV in g", "a.csv", TABLE, 'record_unit = "g_0"\n', "reaches 50 g; no earthquake"),
    broken("CSV, empty", "a.csv", b"", UNIT, "holds no line of numbers"),
    broken("CSV, header alone", "a.csv", "t,a\n", UNIT, "holds no line of numbers"),
    broken("CSV, not a number", "a.csv", TABLE.replace("0.10,50", "0.10,NaN"), UNIT, "line 12: 'NaN' is not a number"),
    broken("CSV, infinite", "a.csv", TABLE.replace("0.10,50", "0.10,inf"), UNIT, "line 12: 'inf' is not finite"),
    broken(
        "CSV, value missing", "a.csv", TABLE.replace("0.10,50", "0.10,"), UNIT, "line 12: holds 1 values, the lines above hold 2"
    ),
    broken("CSV, line missing", "a.csv", TABLE.replace("0.10,50\n", ""), UNIT, "0.11 s does not follow 0.09 s"),
    broken("CSV, time that falls", "a.csv", TABLE.replace("0.10,50", "0.05,50"), UNIT, "does not rise above 0.09 s"),
    broken("CSV, three columns", "a.csv", "0.00,1,2\n0.01,1,2\n", UNIT, "line 1: holds 3 columns"),
    broken("CSV, decimal commas", "a.csv", "0,00;1,5\n0,01;2,5\n", UNIT, "has decimal commas; write decimal points"),
    broken("CSV, quotes", "a.csv", '"0.00","1"\n"0.01","2"\n', UNIT, "line 1: '\"0.00\"' is not a number"),
    broken("CSV, milliseconds", "a.csv", "0 1.5\n10 2.5\n20 3.5\n", UNIT, "steps by 10 s; is its time in seconds?"),
    broken(
        "CSV, other step", "a.csv", TABLE, UNIT + 'record_dt = "0.02 s"\n', "times step by 0.01 s, motion.record_dt says 0.02 s"
    ),
    broken("CSV, one value", "a.csv", "0.00 1\n", UNIT, "at least two values"),
    broken("CSV, latin-1", "a.csv", "t,a (m/s²)\n0.00,1\n".encode("latin-1"), UNIT, "is not UTF-8 text (byte 8)"),
    broken("CSV, UTF-16", "a.csv", TABLE.encode("utf-16"), UNIT, "is not text, or not UTF-8"),
    broken("a spreadsheet", "a.xlsx", b"PK\x03\x04\x00\x00", BOTH, "is not text, or not UTF-8"),
    broken("text without step and unit", "a.txt", "1\n2\n", "", 'needs motion.record_dt, as in "0.01 s" and motion.record_unit'),
    broken("text without a step", "a.txt", "1\n2\n", UNIT, 'needs motion.record_dt, as in "0.01 s"'),
    broken("text, a dash for a value", "a.txt", "1\n-\n2\n", BOTH, "line 2: '-' is not a number"),
    broken("text, decimal commas", "a.txt", "1,5\n2,5\n", BOTH, "has decimal commas"),
    broken("text, zero throughout", "a.txt", "0\n0\n", BOTH, "is zero throughout"),
    broken("text, huge", "a.txt", b"1\n" * 10_000_001, BOTH, "is larger than 20 MB; is it a record?"),
    broken("K-NET, cut in its header", "a.EW", KNET[:300], "", "without the last line of its header, 'Memo.'"),
    broken(
        "K-NET, cut in its values", "a.EW", KNET.replace("Time(s)  1\n", "Time(s)  9\n"), "", "holds 1 s, its header says 9 s"
    ),
    broken("K-NET without values", "a.EW", KNET[: KNET.index("Memo.") + 6], "", "ends with its header"),
    broken("K-NET, other scale", "a.EW", KNET.replace("1000(gal)", "2000(gal)"), "", "reaches 100 gal, its header says 50 gal"),
    broken("K-NET, letter in a value", "a.EW", KNET.replace("-50", "-5O", 1), "", "is not laid out as K-NET records are"),
    broken("K-NET with a unit", "a.EW", KNET, UNIT, "is a K-NET record and states its own time step and unit"),
]
