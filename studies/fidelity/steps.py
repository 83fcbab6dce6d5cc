"""Explicit steps of a scene whose bodies are of different kinds."""

from collections.abc import Sequence
from contextlib import nullcontext
from math import ceil

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.integrators.stability import highest_frequency, highest_rate, step_limit
from anctmm.jit.interpreting import interpreted
from anctmm.model.case import Case
from anctmm.model.scene import Scene
from studies.engine.running.trial import Mesh

#: Part of the stability limit that a run takes.
MARGIN = 0.9
#: Elements up to which Python runs the kernels of the limit: compiling takes seconds, running so milliseconds.
FEW = 12


def stable_step(scene: Scene, mesh: Mesh, kinds: Sequence[str]) -> float:
    """Largest stable explicit step of the scene about its reference, s; infinite where nothing can vibrate."""
    names = [body.name for body in scene.beams]
    cut, element = dict(zip(names, mesh, strict=True)), dict(zip(names, kinds, strict=True))
    chain = Chain(scene, Discretisation(mesh=cut, element=element, integrator="zhai"))
    with interpreted() if sum(mesh) <= FEW else nullcontext():
        return step_limit(0.5, 0.5, highest_frequency(chain), highest_rate(chain))


def step_under(case: Case, limit: float) -> float:
    """The largest step below a limit and a thousandth of the run that divides the interval of output, s."""
    return case.interval / ceil(case.interval / min(limit, 1e-3 * case.duration))
