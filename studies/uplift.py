"""The water pressure's net uplift of the box."""

from engine import Spec


def uplift_over_weight(spec: Spec) -> float:
    """Net upward resultant of the water pressure on the box, p0 width height / H_ref, over the box's weight under gravity."""
    box = spec.box
    uplift = spec.pressure.p0 / spec.pressure.reference_height * box.width * box.height
    solid = box.width * box.height - (box.width - 2 * box.wall) * (box.height - 2 * box.wall)
    return uplift / (solid * box.density * spec.gravity.acceleration)
