"""Straight line: Peaucellier's linkage (1864): a crank and six rigid bars move a point on a straight line."""

from cmath import exp

import anctmm as at

ARM, SIDE, CRANK = 1.0, 0.5, 0.35  # m
start = CRANK * (1 + exp(-1.22j))  # the crank's end, as a complex number: it is on a circle through (0, 0)
end = (ARM**2 - SIDE**2) / start.conjugate()  # and this is its image by inversion: it is on a straight line
half = 1j * (end - start) / abs(end - start) * (SIDE**2 - abs(end - start) ** 2 / 4) ** 0.5
P, A, B, C, D, E = 0j, CRANK + 0j, (start + end) / 2 + half, end, (start + end) / 2 - half, start
bars = {"PB": (P, B), "PD": (P, D), "EB": (E, B), "ED": (E, D), "CB": (C, B), "CD": (C, D), "AE": (A, E)}

steel, section = at.Material(E=2.1e11, density=7850.0), at.Rectangle(0.02, 0.02)
drive = at.Clamp("AE.start", angle=at.Quintic(turn=2.44, duration=1.0))
fixed = at.Pin("PB.start", "PD.start", grounded=True)
sides = [at.Pin("EB.end", "PB.end", "CB.end"), at.Pin("ED.end", "PD.end", "CD.end")]
tips = [at.Pin("AE.end", "EB.start", "ED.start"), at.Pin("CB.start", "CD.start")]
bodies = [at.Beam(n, (p.real, p.imag), (q.real, q.imag), section, steel) for n, (p, q) in bars.items()]
scene = at.Scene("straight-line", bodies, [drive, fixed, *sides, *tips])
CASES = [at.Case(scene, ["CB.start"], t_end=1.0, output_dt=0.02)]
RUN = {"mesh": 1, "element": "rigid", "dt": 1e-2}


def known(s):
    x, line = s.position("CB.start")[:, 0], (ARM**2 - SIDE**2) / (2 * CRANK)
    worst = x[abs(x - line).argmax()]
    return "x of the guided point, where it is farthest off", worst, line, 1e-9, "m", "inversion at a circle"
