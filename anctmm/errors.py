"""Exceptions. Every message names the thing, its value and what is allowed."""


class AnctmmError(Exception):
    """Base of everything this package raises on purpose."""


class SceneError(AnctmmError, ValueError):
    """The physics of a scene is wrong or inconsistent."""


class PropertyError(SceneError):
    """A physical property is not finite, has the wrong sign or is out of its range."""


class DegenerateBodyError(SceneError):
    """A body has no length."""


class DuplicateNameError(SceneError):
    """Two bodies carry one name."""


class UnknownNameError(SceneError, KeyError):
    """A body, a body end or a probe is not part of the scene."""

    def __str__(self) -> str:  # KeyError would print the repr of the message
        return str(self.args[0]) if self.args else ""


class TopologyError(SceneError):
    """The joints do not fit each other, or the bodies, or what a solver can do."""


class EndJoinedTwiceError(TopologyError):
    """A joint names one end twice, or an end is in more joints than a solver can do."""


class RepeatedJointError(TopologyError):
    """A joint holds what other joints hold already."""


class ContradictingJointsError(TopologyError):
    """Joints hold a thing in different ways."""


class BranchError(TopologyError):
    """A joint connects more ends than a solver can do."""


class ClosedLoopError(TopologyError):
    """Bodies close a loop, which a solver cannot do."""


class JointGapError(TopologyError):
    """The ends a joint connects are not at one place, or do not move as one."""


class DiscretisationError(AnctmmError, ValueError):
    """Mesh, element, integrator or step cannot be used."""


class MeshError(DiscretisationError):
    """The mesh misses a body, names an unknown one or has no elements."""


class UnknownOptionError(DiscretisationError):
    """An element, quadrature, integrator or other option has an unknown name."""


class StepError(DiscretisationError):
    """The time step, run length or output interval is impossible."""


class StabilityError(StepError):
    """The time step lies above the stability limit of an explicit integrator."""


class MemoryLimitError(DiscretisationError, MemoryError):
    """A run takes more memory than is free."""


class SolverError(AnctmmError, RuntimeError):
    """A solver could not start, for a reason that lies in the scene as discretised."""


class UnknownSolverError(AnctmmError, KeyError):
    """No solver is registered by this name."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class PluginError(SolverError):
    """A registered solver cannot be loaded, lacks what is asked of it, or answers with nonsense."""


class OutputError(AnctmmError, OSError):
    """A file or directory cannot be written."""
