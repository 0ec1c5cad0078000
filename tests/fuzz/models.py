"""Random study tables, each decided by a seed and a number alone: what a user might write, up to the edges of what is allowed."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

Table = dict[str, Any]
Generator = np.random.Generator

GRAVITY = 9.81
MOST_STEPS, FEW_STEPS = 120, 40
COARSEST = {"wall_elements": 1, "roof_elements": 2, "side_elements": 2, "corner_levels": 0}
CORAL_RECORDS = ("ridgecrest-2019-clc-360.AT2", "ridgecrest-2019-clc-up.AT2")


@dataclass(frozen=True)
class Drawn:
    """A study table as TOML holds it, and what sets it apart from others."""

    seed: int
    number: int
    table: Table
    features: tuple[str, ...]


def draw(seed: int, number: int, small: bool = False) -> Drawn:
    """Model `number` of a seed; its cases share mesh and time step, so that they march side by side.

    small : on the coarsest meshes there are, and not for long
    """
    rng = np.random.default_rng([seed, number])
    features: list[str] = []
    box, domain = _places(rng, features)
    order = int(rng.choice([1, 1, 2]))
    features.append(f"T{3 * order}")
    sides = str(rng.choice(["tied", "shear", "roller", "fixed"]))
    weight = sides != "shear" and bool(rng.integers(2))
    features += [f"sides {sides}", "self-weight" if weight else "no self-weight"]
    time = _time(rng, FEW_STEPS if small else MOST_STEPS, features)
    table: Table = {
        "box": box,
        "domain": domain,
        "layer": _layers(rng, box, domain, features),
        "joint": _joint(rng, order, features),
        "mesh": _mesh(rng, order, box) | (COARSEST if small else {}),
        "supports": {"sides": sides},
        "gravity": {"self_weight": weight},
        "damping": _damping(rng, features),
        "time": time,
        "output": {"every": int(rng.choice([1, 1, 2, 7])), "sections": 3},
        **_motion(rng, sides, time, domain, features),
        "sweep": _sweep(rng, features),
    }
    return Drawn(seed, number, _with_units(table), tuple(features))


def _chance(rng: Generator, share: float) -> bool:
    return bool(rng.random() < share)


def _log(rng: Generator, low: float, high: float) -> float:
    """Between two powers of ten."""
    return float(10 ** rng.uniform(low, high))


def _places(rng: Generator, features: list[str]) -> tuple[Table, Table]:
    """Box and domain; the box may touch the surface, or nearly the base or a side."""
    width, height = _log(rng, 0.0, 1.1), _log(rng, 0.0, 1.1)
    wall = min(width, height) * rng.uniform(0.04, 0.3)
    room = max(width, height)
    depth, below = room * rng.uniform(0.02, 2), room * rng.uniform(0.1, 2)
    left, right = room * rng.uniform(0.1, 2, 2)
    edge = int(rng.integers(20))
    if edge == 0:
        depth = 0.0
    elif edge == 1:
        below = height * _log(rng, -4, -2)
    elif edge == 2:
        left = width * _log(rng, -4, -2)
    features += [("roof at the surface", "floor near the base", "wall near the side")[edge]] if edge < 3 else []
    box = {"width": width, "height": height, "wall": wall, "depth": depth, "offset": (left - right) / 2}
    box |= {"E": _log(rng, 9, 11), "nu": rng.uniform(0, 0.45), "density": rng.uniform(500, 8000)}
    return box, {"width": left + width + right, "depth": depth + height + below}


def _layers(rng: Generator, box: Table, domain: Table, features: list[str]) -> list[Table]:
    """Layers of a stiffness contrast of up to 1e4; some boundaries lie at or next to the box's own lines."""
    decades = rng.uniform(0, 4)
    softest = _log(rng, 6.5, 8.5)
    features.append(f"contrast 1e{int(decades)} to 1e{int(decades) + 1}")
    roof, floor = box["depth"], box["depth"] + box["height"]
    lines = [roof, floor, roof + box["wall"], floor - box["wall"], roof + box["height"] / 2]
    bottoms = set((domain["depth"] * rng.uniform(0.02, 1.1, rng.integers(1, 5))).tolist())
    if _chance(rng, 0.2):
        features.append("boundary at a corner")
        near = float(rng.choice([0.0, 1e-12, -1e-12, 1e-10, -1e-10, 1e-3, -1e-3]))
        bottoms.add(float(rng.choice(lines)) * (1 + near))
    most = float(rng.choice([0.0, 0.5, 1.0, 2.0], p=[0.1, 0.3, 0.3, 0.3]))
    features.append(f"friction up to {most:g}")
    return [
        {
            "bottom": bottom,
            "E": softest * 10 ** (decades * rng.random()),
            "nu": rng.uniform(0, 0.48),
            "density": rng.uniform(1200, 3000),
            "friction": most if _chance(rng, 0.1) else rng.uniform(0, most),
        }
        for bottom in sorted(bottoms)
        if bottom > 0
    ]


def _joint(rng: Generator, order: int, features: list[str]) -> Table:
    """Thickness over six decades."""
    decade = rng.uniform(-4.3, 1.7)
    features.append(f"joint thickness 1e{int(np.floor(decade))} m")
    joint: Table = {"thickness": 10**decade}
    if order == 1 and _chance(rng, 0.4):
        joint["quadrature"] = "one-point"
        features.append("one-point")
    if _chance(rng, 0.1):
        joint["thickness_ratio"] = _log(rng, -4, 1)
    return joint


def _mesh(rng: Generator, order: int, box: Table) -> Table:
    """Coarse: few elements round the box, and large ones away from it."""
    size = max(box["width"], box["height"])
    mesh: Table = {
        "order": order,
        "wall_elements": int(rng.choice([1, 1, 1, 1, 2])),
        "roof_elements": int(rng.choice([2, 2, 2, 4])),
        "side_elements": int(rng.choice([2, 2, 2, 4])),
        "corner_levels": int(rng.choice([0, 1, 2, 3], p=[0.8, 0.1, 0.07, 0.03])) if 8 * box["wall"] > size else 0,
        "first": size * rng.uniform(0.3, 1.2),
        "growth": rng.uniform(1.5, 4),
        "largest_width": size * rng.uniform(1, 4),
        "largest_height": size * rng.uniform(1, 4),
    }
    return mesh | ({"mass": "lumped"} if order == 1 and _chance(rng, 0.3) else {})


def _damping(rng: Generator, features: list[str]) -> Table:
    damping: Table = {"ratio": float(rng.choice([0.0, 0.02, 0.05, rng.uniform(0, 0.5)]))}
    if _chance(rng, 0.1):
        damping["joints"] = True
        features.append("damped joints")
    return damping


def _time(rng: Generator, most: int, features: list[str]) -> Table:
    """Steps of 1e-4 to 0.05 s, of three digits, so that records can be brought to them."""
    dt = float(f"{_log(rng, -4, np.log10(0.05)):.2e}")
    n = 1 if _chance(rng, 0.02) else int(rng.integers(20, most + 1))
    features += [f"dt 1e{int(np.floor(np.log10(dt)))} s", *(["one step"] if n == 1 else [])]
    time = {"dt": dt, "duration": float(f"{n * dt:.6e}")}
    if _chance(rng, 0.1):
        features.append("dissipative scheme")
        time |= {"newmark_beta": 0.3025, "newmark_gamma": 0.6}
    return time


def _motion(rng: Generator, sides: str, time: Table, domain: Table, features: list[str]) -> Table:
    """A record, a generated motion or none, of 1e-12 to 3 g, along x or along both."""
    kind = str(rng.choice(["synthetic", "ricker", "record", "none"], p=[0.55, 0.2, 0.15, 0.1]))
    size = float(rng.choice([1e-12, 3.0, _log(rng, -3, 0.5)], p=[0.1, 0.1, 0.8]))
    features += [f"motion {kind}", "motion of 1e-12 g" if size == 1e-12 else f"motion 1e{int(np.floor(np.log10(size)))} g"]
    dt, length = time["dt"], time["duration"]
    names = dict(zip(("record", "vertical_record"), CORAL_RECORDS, strict=True)) if kind == "record" else {}
    motion: Table = {"record": names.get("record", kind), "scale": float(rng.choice([1.0, -0.7]))}
    if kind != "none":
        motion["peak"] = size * GRAVITY
    if sides != "shear" and kind != "none" and _chance(rng, 0.4):
        features.append("motion along both")
        motion |= {"vertical_record": names.get("vertical_record", kind)}
        motion |= {"vertical_peak": size * GRAVITY * rng.uniform(0.1, 1)} if _chance(rng, 0.5) else {}
    if _chance(rng, 0.05):
        features.append("record above the base")
        motion["reference_depth"] = domain["depth"] * rng.uniform(0.3, 1)
    found: Table = {"motion": motion}
    if kind == "synthetic":
        step = dt * float(rng.choice([0.5, 1, 2]))
        ground = _log(rng, -2, np.log10(0.2)) / step
        found["synthetic"] = {"seed": int(rng.integers(2**31)), "step": step, "ground_frequency": ground}
        found["synthetic"] |= {
            "low_frequency": 0.1 * ground,
            "rise": 0.2 * length,
            "plateau": 0.5 * length,
            "decay": 0.2 * length,
        }
    elif kind == "ricker":
        found["ricker"] = {"frequency": _log(rng, -2, np.log10(0.2)) / dt, "arrival": length * rng.uniform(0, 0.9)}
    return found


def _sweep(rng: Generator, features: list[str]) -> Table:
    """Pressures of both signs, zero among them, and sometimes two strengths of the shaking."""
    sizes = [float(s) * _log(rng, 3, 7) for s in rng.choice([-1, 1], int(rng.integers(1, 4)))]
    pressures = [*sizes, *([0.0] if _chance(rng, 0.4) else [])]
    sweep: Table = {"p0": [pressures[i] for i in rng.permutation(len(pressures))]}
    if _chance(rng, 0.3):
        sweep["scale"] = [1.0, float(rng.uniform(-3, 3))]
    return sweep


UNITS = {
    "m": "width height wall depth offset bottom thickness first largest_width largest_height reference_depth",
    "s": "dt duration step rise plateau decay arrival",
    "Pa": "E p0",
    "kg/m**3": "density",
    "m/s**2": "peak vertical_peak",
    "Hz": "frequency ground_frequency low_frequency",
}
_UNIT_OF = {name: unit for unit, names in UNITS.items() for name in names.split()}


def _with_units(value: Any, unit: str | None = None) -> Any:
    """The table with every quantity as text with its unit."""
    if isinstance(value, dict):
        return {key: _with_units(inner, _UNIT_OF.get(key)) for key, inner in value.items()}
    if isinstance(value, list):
        return [_with_units(inner, unit) for inner in value]
    if isinstance(value, float):
        return f"{float(value)!r} {unit}" if unit else float(value)
    return value


def as_toml(table: Table) -> str:
    """The study file that reads back as this table."""
    return "\n".join(_lines(table)) + "\n"


def _lines(table: Table, path: str = "") -> Iterable[str]:
    inner = {key: value for key, value in table.items() if isinstance(value, dict) or _is_tables(value)}
    yield from (f"{key} = {_literal(value)}" for key, value in table.items() if key not in inner)
    for key, value in inner.items():
        name = f"{path}{key}"
        for part in [value] if isinstance(value, dict) else value:
            yield f"[{name}]" if isinstance(value, dict) else f"[[{name}]]"
            yield from _lines(part, f"{name}.")


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], dict)


def _literal(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(map(_literal, value))}]"
    return f'"{value}"' if isinstance(value, str) else repr(value)
