"""Section `models`: which release model to take, and how many steps of it."""

from __future__ import annotations

from .model_choice import choice, single
from .model_laws import laws
from .model_measures import measure
from .model_rows import diagram, rows_table
from .model_runs import methods
from .model_samples import sample_tables
from .model_throws import HEIGHT, four_throws, throws_table
from .model_widths import width_study
from .page import Effort, Section, Table

INTRODUCTION = f"""Each release is computed by every method, and the object lands {-HEIGHT:g} m
 below the hand. Two errors are told apart. The own error is the distance to the converged
 answer of the law that the method approximates: for `sp` that of no rounding (ε → 0) and
 infinitely many steps, for `ls`, `ils` and `ls-step` the limit surface without smoothing (d → 0).
 More steps make it smaller. The model error is the distance to a patch meshed into 64
 points with Coulomb friction, which no number of steps makes smaller than the law's own
 distance. Errors are those of landing x and θ and of the twist at detach (|Δv| + |Δω| l/2);
 where one number is needed, as in the Pareto sets, it is the scaled landing error |Δx| + |Δθ|
 l/2 with the object's length l. Lengths in the tables of throws: h from the grasp to the CoM, l of
 the object, patch radius r_p; I is the moment of inertia about the CoM, c the torsional limit over
 r_p times the tangential one, faces the pads that rub.""".replace("\n", "")
#: The methods by name.
NAMES = (
    ("sp", "sliding pivot (Liu and Billard): the bar sticks, pivots about the pads, slides"),
    ("sp-paper", "the same with the paper's jump of the rates as sliding begins"),
    ("ls", "limit surface (ellipsoid of force and torque), explicit Euler steps, sticking by "
     "Karnopp's threshold"),
    ("ils", "limit surface smoothed over the slip speed d [m/s], by implicit integrators"),
    ("ls-step", "limit surface, time steps with an implicit friction impulse"),
    ("patch", "pads meshed into 64 points with Coulomb friction: the measure of model errors"),
    ("LuGre", "bristles of the stiffness σ₀ [1/m] at those points"),
)  # fmt: skip
TIMES = """Times are processor time on one core, the least of several runs after a first one that
 is not counted (slow ones, over 0.2 s, or 0.03 s in a quick report, run once), with nothing
 kept between runs but the compiled loop. The instants at which slip begins are left out, where a
 model finds them apart; `ls` and `ils` contain about half a millisecond for them. `sp`, RK4 and
 Euler, and `ls-step` run as CasADi's own loops; located events, `ls`, `ils` and the patch in
 Python. Batches are far faster, see the last tables.""".replace("\n", "")


def make(effort: Effort) -> Section:
    """The whole section."""
    section = Section("models", "Release models: error against time")
    throws, ways = four_throws(), list(methods(effort.quick))
    total = len(throws) * (len(ways) + 2) + 1
    done = iter(range(1, total + 1))

    def tick() -> None:
        effort.tell(next(done), total)

    measured = [measure(throw, ways, effort, tick) for throw in throws]
    section.add(INTRODUCTION, Table("models-names", "Methods", ("method", "what it is"), NAMES))
    section.add(throws_table(throws), TIMES, *choice(measured), *laws(measured))
    for one in measured:
        section.add(rows_table(one), diagram(one))
    section.add(*width_study(measured, effort, tick))
    sample = sample_tables(effort)
    section.add(*sample.parts)
    tick()
    section.short += [single(measured), sample.short]
    return section
