"""Kernels are compiled before processes start: what the runner calls afterwards is compiled already."""

import gc
import subprocess
import sys

import numba
import pytest

from engine import compile_kernels

CHECK = """
import numpy as np
from numba.core.dispatcher import Dispatcher
from engine import Spec, build_model, compile_kernels, free_field, simulate_cases
from engine.kernels import blocks, condense, contact, dense, direct, follow, inverse, joint
from engine.kernels import loop, march, observe, panels, release, sparse, triangle
from engine.warm import COARSE

def compiled():
    modules = (blocks, condense, contact, dense, direct, follow, inverse, joint)
    modules += (loop, march, observe, panels, release, sparse, triangle)
    kernels = (x for m in modules for x in vars(m).values() if isinstance(x, Dispatcher))
    return {kernel.__qualname__: len(kernel.signatures) for kernel in kernels if kernel.signatures}

print(len(compiled()))
compile_kernels()
first = compiled()
print(len(first))
for changes in CHANGES:
    tree = COARSE.model_dump()
    for table, values in changes.items():
        tree[table] |= values
    spec = Spec.model_validate(tree)
    model = build_model(spec)
    motion = np.zeros((30, 2))
    motion[1:, :] = [20.0, -8.0]
    simulate_cases(model, [spec] * 3, [motion] * 3)
    free_field(model, [motion] * 3)
    assert compiled() == first, (changes, first, compiled())
"""

CHANGES = [
    {},
    {"damping": {"joints": True}},
    {"joint": {"quadrature": "one-point"}, "mesh": {"order": 1}},
    {"mesh": {"corner_levels": 2}, "output": {"sections": 3, "points": {"P": [3.1, -1.3]}}},
    {"mesh": {"order": 1, "mass": "lumped"}, "supports": {"sides": "roller"}},
    {"pressure": {"p0": 0.0}, "gravity": {"self_weight": False}, "output": {"every": 5}},
]
"""What a study can vary in the calls of kernels; `motion` is strong enough to open the joint."""


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs compiled kernels")
def test_a_batch_calls_no_kernel_in_a_form_that_was_not_compiled():
    done = subprocess.run([sys.executable, "-c", f"CHANGES = {CHANGES}\n{CHECK}"], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    before, after = map(int, done.stdout.split())
    assert before == 0 < after


@pytest.mark.parametrize("collected", [True, False])
def test_garbage_is_collected_afterwards_as_before(collected, monkeypatch):
    monkeypatch.setattr(gc, "isenabled", lambda: collected)
    done = []
    monkeypatch.setattr(gc, "disable", lambda: done.append("off"))
    monkeypatch.setattr(gc, "enable", lambda: done.append("on"))
    compile_kernels.__wrapped__()
    assert done == (["off", "on"] if collected else ["off"])
