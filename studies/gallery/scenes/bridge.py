"""Bridge: eleven bars with two loads; the forces in the bars are those of the method of joints."""

import anctmm as at

SIDE, LOAD, ENDS = 2.0, 2e4, ("start", "end")  # m, N
below = [(SIDE * k, 0.0) for k in range(4)]
above = [(SIDE * (k + 0.5), SIDE * 0.75**0.5) for k in range(3)]
bars = {f"bottom{k}": (below[k], below[k + 1]) for k in range(3)}
bars |= {f"top{k}": (above[k], above[k + 1]) for k in range(2)}
bars |= {f"up{k}": (below[k], above[k]) for k in range(3)}
bars |= {f"down{k}": (above[k], below[k + 1]) for k in range(3)}
steel, tube = at.Material(E=2.1e11, density=7850.0), at.Rectangle(0.04, 0.04)
ends = {f"{bar}.{end}": place for bar, pair in bars.items() for end, place in zip(ENDS, pair, strict=True)}
pins = [at.Pin(*(e for e in ends if ends[e] == corner)) for corner in (*below[1:], *above)]
supports = [at.Pin("bottom0.start", "up0.start", grounded=True), at.Slider("bottom2.end", direction=(1, 0))]
loads = [at.Force("bottom0.end", (0, -LOAD)), at.Force("bottom1.end", (0, -LOAD))]
scene = at.Scene(
    "bridge", [at.Beam(bar, *pair, tube, steel) for bar, pair in bars.items()], [*pins, *supports], loads
)
CASES = [at.Case(scene, ["bottom1.start", "top0.end"], t_end=None)]
RUN = {"mesh": 1}


def known(s):
    force, exact = 1e-3 * s.section_force(("bottom1", 0.5))[-1, 0], 2e-3 * LOAD / 3**0.5
    return "force in the middle bar below", force, exact, 1e-3 * exact, "kN", "a cut through three bars"
