"""Natural modes as results: frequencies, damping, shapes, pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import kind_of
from anctmm.errors import DiscretisationError, shown
from anctmm.integrators.output import field_of
from anctmm.model.bodies import Beam
from anctmm.model.rigid_bodies import PointMass
from anctmm.model.scene import Probe, Scene
from anctmm.results.export.pictures import plot_shapes
from anctmm.results.fields import RigidField, beam_field
from anctmm.results.solution import Energy, Solution
from anctmm.small_motions.eigenvalues import grows
from anctmm.system.body_meshes import MassMesh
from anctmm.validation import positive, whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Frames of a period.
FRAMES = 48


@dataclass(frozen=True)
class Modes:
    """Natural modes, motions ∝ exp(λt) with λ = growth rate + 2πi frequency.

    Those that grow come first, the fastest of them first: without oscillation (divergence, as of a column beyond its
    critical load) or with it (flutter). Then those that oscillate, by ascending |λ|: without damping, by ascending
    frequency. At last those that decay without oscillation, by ascending |λ|.

    Parameters
    ----------
    scene : Scene
    run : Discretisation
    frequencies : ndarray, shape (count,)
        Im λ/2π, of the damped motion, Hz. Motions that need no force, as of a free body, have about 0; so have those
        that grow or decay without oscillation: `growth_rates` has their rates.
    damping : ndarray, shape (count,)
        −Re λ/|λ|, where a motion oscillates the ratio to the critical damping: 1 of motions that decay without
        oscillation, −1 of those that grow without, 0 where λ is 0.
    growth_rates : ndarray, shape (count,)
        Re λ, 1/s: positive of motions that grow, negative of those that decay. Where nothing oscillates there are two:
        with damping both are modes, without damping only the one that grows is. So a scene with damping has up to twice
        as many modes as free motions.
    shapes : mapping of body name to ndarray, shape (count, nodes, vectors, dim)
        Complex: the motion is the real part of shape × exp(λt). Of all displacements of nodes and centres of mass in a
        period the longest has 1 m, and is that at its beginning. A rigid body has one node: its centre of mass and,
        except for a point mass, a unit vector that turns with it.
    equilibrium : mapping of body name to ndarray, shape (nodes, vectors, dim)
        The configuration about which they move.
    """

    scene: Scene
    run: Discretisation
    frequencies: Array
    damping: Array
    growth_rates: Array
    shapes: Mapping[str, Complex]
    equilibrium: Mapping[str, Array]

    @property
    def unstable(self) -> NDArray[np.bool_]:
        """Which modes grow, (count,): where the damping is negative by more than rounding."""
        return grows(self.damping)

    def displacement(self, place: Probe, fractions: Sequence[float] | Array | None = None) -> Complex:
        """Displacements of a place in each mode, (count, 2); of k fractions (count, k, 2).

        Raises
        ------
        UnknownNameError
            If there is no such place.
        """
        if fractions is not None:
            return np.stack([self.displacement((str(place), float(x))) for x in fractions], axis=1)
        name, at = self.scene.probe(place)
        parts = [self._field(name, part) for part in (self.shapes[name].real, self.shapes[name].imag)]
        return np.asarray(parts[0].position(at) + 1j * parts[1].position(at))  # linear in the coordinates

    def _field(self, name: str, q: Array) -> Any:
        """Motion of a body from coordinates as those of shapes, (n, nodes, vectors, dim)."""
        body = self.scene.body(name)
        if isinstance(body, Beam):
            return beam_field(kind_of(self.run.of(self.scene)[name][1]), body, q)
        if isinstance(body, PointMass):
            return field_of(MassMesh(body), q[None], None)
        arms: Any = {key: body.arm(key) for key in body.points}
        return RigidField(q[:, 0], arms)

    def motion(self, mode: int = 1, amplitude: float | None = None) -> Solution:
        """One period of a mode, as a solution: to be animated, drawn or written.

        Parameters
        ----------
        mode : int
            Number, from 1 on.
        amplitude : float, optional
            Largest displacement, m; default 15 % of the scene's extent.

        Returns
        -------
        Solution
            Its times are those of one period of the mode, or of 1 s if it does not oscillate; energies are unknown.

        Raises
        ------
        DiscretisationError
            If there is no such mode, or the amplitude is no positive number.
        """
        k = whole("mode", mode, len(self.frequencies), DiscretisationError) - 1
        every = np.concatenate([q[:, 0] for q in self.equilibrium.values()])
        size = 0.15 * (float(np.ptp(every, axis=0).max()) or self.scene.length)
        if amplitude is not None:
            size = positive("amplitude (m)", amplitude, DiscretisationError)
        phase = np.exp(2j * np.pi * np.linspace(0.0, 1.0, FRAMES + 1))[:, None, None, None]
        fields = {
            name: self._field(name, self.equilibrium[name] + size * (shape[k] * phase).real)
            for name, shape in self.shapes.items()
        }
        f = float(self.frequencies[k])
        t = np.linspace(0.0, 1.0 / f if f > 0.0 else 1.0, FRAMES + 1)
        return Solution(f"mode {k + 1}", self.scene, self.run, t, fields, Energy.unknown(len(t)))

    def plot(self, modes: int | Sequence[int] | None = None) -> "Figure":
        """Shapes of modes, each at both extremes, with the equilibrium in grey.

        Parameters
        ----------
        modes : int or sequence of int, optional
            Numbers, from 1 on; default the first twelve.

        Raises
        ------
        DiscretisationError
            If there is no such mode.
        ResultError
            If matplotlib is not installed.
        """
        count = len(self.frequencies)
        chosen = range(1, min(count, 12) + 1) if modes is None else np.atleast_1d(np.asarray(modes))
        if not len(chosen):
            raise DiscretisationError(f"modes is {shown(modes)}; numbers from 1 to {count} are needed")
        motions = [self.motion(k) for k in chosen]
        return plot_shapes(motions, [f"{k}: {self._speed(k)}" for k in chosen], self.scene.name)

    def animate(self, path: str | PathLike[str], mode: int = 1, fps: float = 25.0) -> Path:
        """Write an animation of a mode: a page with a player (".html") or an animated picture (".gif").

        Errors are those of `Solution.animate` and `motion`.
        """
        return self.motion(mode).animate(path, fps)

    def _speed(self, mode: int) -> str:
        """Frequency of a mode, or its rate where it does not oscillate."""
        f, rate = self.frequencies[mode - 1], self.growth_rates[mode - 1]
        if f > 0.0 or rate == 0.0:
            return f"{f:.4g} Hz"
        return f"{'grows' if rate > 0.0 else 'decays'} at {abs(rate):.4g} 1/s"

    def __repr__(self) -> str:
        """Frequencies, damping and growth rates, a line a mode."""
        columns = zip(self.frequencies, self.damping, self.growth_rates, self.unstable, strict=True)
        marks = {True: "  unstable (flutter)", False: "  unstable (divergence)"}
        rows = [
            f"  {k + 1:3d}  {f:14.6g} Hz  {z:10.3g}  {rate:11.4g} 1/s{marks[bool(f > 0.0)] if unstable else ''}"
            for k, (f, z, rate, unstable) in enumerate(columns)
        ]
        head = "  mode       frequency     damping      growth rate"
        return "\n".join([f"Modes of scene {self.scene.name!r}:", head, *rows])
