"""A scene's NLPs with their solvers, built when first needed and kept."""

from __future__ import annotations

from dataclasses import dataclass

from ...problems import Pose, Scene
from ..check import Guard, Mover
from ..compile import Compile
from ..ocp import HEAVY, Solver, ThrowNlp, Window, bounds, build_nlp, structure_of, window_of
from .correction import Problem, Search


@dataclass(frozen=True)
class Kind:
    """Which of a scene's NLPs: theta fixed or open, with which guards, robust how."""

    angle: bool
    guards: frozenset[Guard]
    robust: str = ""


def patient(compiling: Compile, guards: frozenset[Guard]) -> Compile:
    """How to compile an NLP: nobody waits for one whose rows seldom decide."""
    return "background" if compiling == "wait" and guards else compiling


class Workbench:
    """NLPs and problems by their kind."""

    def __init__(self, scene: Scene, mover: Mover, compiling: Compile) -> None:
        self.scene, self.mover = scene, mover
        self._compiling = compiling
        self._nlps: dict[Kind, ThrowNlp] = {}
        self._problems: dict[tuple[Kind, str], Problem] = {}

    @property
    def compiled(self) -> bool:
        """Whether all problems so far run as machine code."""
        problems = self._problems.values()
        return bool(problems) and all(problem.solver.compiled for problem in problems)

    @property
    def awaited(self) -> bool:
        """Whether machine code is still being compiled for any of them."""
        return any(problem.solver.awaited for problem in self._problems.values())

    def nlp(self, target: Pose, search: Search, robust: str = "") -> ThrowNlp:
        """The NLP for a target, with what the search has seen to be needed."""
        kind = Kind(target.theta is not None, search.guards, robust)
        if kind not in self._nlps:
            with search.clock("build"):
                structure = structure_of(
                    self.scene,
                    self.mover,
                    kind.angle,
                    guards=kind.guards,
                    robust=robust,
                    window=self._window(robust),
                )
                self._nlps[kind] = build_nlp(structure, self.mover)
        return self._nlps[kind]

    def problem(self, target: Pose, name: str, search: Search, robust: str = "") -> Problem:
        """The same with a solver, 'fatrop' or 'ipopt'; IPOPT in any case for `HEAVY` guards."""
        kind = Kind(target.theta is not None, search.guards, robust)
        name = "ipopt" if kind.guards & HEAVY else name
        if (kind, name) not in self._problems:
            nlp = self.nlp(target, search, robust)
            with search.clock("build"):
                window = self._window(robust)
                solver = Solver(nlp, name, compiling=patient(self._compiling, kind.guards))
                limits = bounds(nlp, self.scene, self.mover, window)
                self._problems[kind, name] = Problem(nlp, solver, limits, window)
        return self._problems[kind, name]

    def kind_of(self, nlp: ThrowNlp) -> Kind | None:
        """Which of the NLPs built here it is, None if it is another's."""
        return next((kind for kind, known in self._nlps.items() if known is nlp), None)

    def _window(self, robust: str) -> Window | None:
        return window_of(self.scene) if robust else None
