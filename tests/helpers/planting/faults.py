"""Faults that `anctmm check` must see, of every kind of feature: see `planting`.

A new one is one line: its kind, the module and the function, and a change of the function's syntax.
"""

from planting import Fault, flip, replace, scale

ELEMENTS, MODEL, RESULTS = "anctmm.elements.", "anctmm.model.", "anctmm.results."
FORCES = RESULTS + "internal_forces."

FAULTS = (
    # elements
    Fault("mass", ELEMENTS + "shapes", "hermite_mass", replace("420.0", "421.0")),
    Fault("mass", ELEMENTS + "shapes", "quintic_mass", flip(1)),
    Fault("mass", ELEMENTS + "shear", "ShearElement.mass", scale("self.density * self.I * linear", 1.001)),
    Fault("weight", ELEMENTS + "shapes", "hermite_load", flip(0)),
    Fault("stiffness", ELEMENTS + "cable", "CableElement.of", scale("m.E * s.second_moment", 1.000001)),
    Fault("stiffness", ELEMENTS + "cable", "CableElement.of", scale("m.E * s.area", 1.000001)),
    Fault("stiffness", ELEMENTS + "shear", "ShearElement.of", replace("s.fourth_moment", "s.second_moment")),
    Fault("damping", ELEMENTS + "cable", "CableElement.of", scale("m.damping", 1.001)),
    Fault("damping", ELEMENTS + "shear", "ShearElement.of", scale("m.damping", 1.001)),
    Fault("section forces", ELEMENTS + "cable", "CableElement.force", flip(0)),
    Fault("section forces", ELEMENTS + "cable", "CableElement.force", replace("by_b", "by_c")),
    # model
    Fault("sections", MODEL + "sections", "Circle.__post_init__", replace("pi * r**4 / 4", "pi * r**4 / 2")),
    Fault(
        "sections", MODEL + "sections", "Rectangle.__post_init__", replace("b * h**5 / 80", "b * h**5 / 8")
    ),
    Fault(
        "sections", MODEL + "sections", "Rectangle.__post_init__", replace("b * h**3 / 12", "h * b**3 / 12")
    ),
    Fault("materials", MODEL + "bodies", "Material.lame", flip(2)),
    Fault("materials", MODEL + "bodies", "Material.lame", replace("self.E * nu", "self.E")),
    Fault("drives", MODEL + "drives", "Quintic.__call__", replace("x * y", "x")),
    Fault("drives", MODEL + "drives", "Quintic.__call__", replace("y - x", "y + x")),
    Fault(
        "loads", MODEL + "drives", "Pulse.__call__", replace("np.sin(np.pi * x) ** 2", "np.sin(np.pi * x)")
    ),
    Fault("rigid bodies", MODEL + "rigid_bodies", "WithPoints.arm", flip(0)),
    Fault("initial velocities", MODEL + "rigid_bodies", "WithPoints.velocity_at", flip(0)),
    Fault(
        "consistent velocities",
        MODEL + "consistent",
        "_equations",
        replace("c.driven", "-c.driven"),
    ),
    Fault("consistent velocities", MODEL + "consistent", "_inertia", replace("12.0", "3.0")),
    Fault("consistent velocities", MODEL + "velocities", "turned", flip(0)),
    Fault("consistent velocities", MODEL + "velocities", "RigidVelocity.__call__", flip(3)),
    # results
    Fault("places", RESULTS + "fields", "RigidField._point", flip(0)),
    Fault("tensions", FORCES + "actions", "_answer", replace("float(value) - free", "float(value)")),
    Fault("tensions", FORCES + "actions", "_answer", replace("connector.preload", "0.0")),
    Fault("tensions", FORCES + "actions", "_answer", replace("float(rate) - faster", "float(rate)")),
    Fault("section forces", FORCES + "section_forces", "section_force", flip(0)),
    Fault("section forces", FORCES + "section_forces", "HeldBeam.beyond", flip(1)),
    Fault("reactions", FORCES + "actions", "_of_connector", replace("-pull", "pull")),
    Fault("reactions", FORCES + "actions", "_of_connector", replace("-tension", "tension")),
    Fault("reactions", FORCES + "reactions", "inertia_of", replace("12.0", "3.0")),
    Fault("comparisons", RESULTS + "metrics", "history_error", replace("difference**2", "difference")),
    Fault("comparisons", RESULTS + "metrics", "compare", replace("largest / scale", "largest")),
    Fault("saved runs", RESULTS + "export.saving", "_value", scale("arrays[content].copy()", 2.0)),
)
