"""[calibration]: by how far measured throws land off their prediction, and how they scatter."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, ClassVar

from ..models.release import DECIDING
from .checks import InputError
from .files import toml_lines
from .section import Section, meanings, quantity, table_of


@dataclasses.dataclass(frozen=True)
class Calibration(Section):
    """Residuals of measured throws, measured less predicted landing, as `throwplan calibrate`
    writes them. A plan's landings include the bias, so that it aims beside the target and the
    object lands on it.

    The region holds for throws like the measured ones: `mass` to `faces` say what these
    were.
    """

    #: Limits of a level.
    LEVEL: ClassVar[dict[str, float]] = {"least": 0.5, "most": 0.999}

    throws: int = quantity("number of measured throws", least=1, most=1_000_000)
    level: float = quantity("share of new throws that land in the region", **LEVEL)
    x: float = quantity("m, bias of x along the throw's plane", least=-10, most=10)
    theta: float = quantity(
        "degrees, bias of the angle", degrees=True, least=-math.pi, most=math.pi
    )
    x_interval: tuple[float, float] = quantity("m, where the mean of many throws' x residuals is")
    theta_interval: tuple[float, float] = quantity("degrees, the same of the angle", degrees=True)
    position: float = quantity("m, half width of the region along x", least=0, most=10)
    angle: float = quantity("degrees, its half width in theta", degrees=True, least=0)
    speed: tuple[float, float] = quantity(
        "m/s, lowest and highest speed of the CoM at detach", least=0
    )
    rate: tuple[float, float] = quantity(
        "degrees/s, lowest and highest turning rate at detach", degrees=True
    )
    mass: float = quantity("kg, of the thrown object", above=0)
    com: float = quantity("m, from its end nearer the grasp to the CoM", least=0)
    force: float = quantity("N, full grip force of one pad", above=0)
    opening: float = quantity("s, in which the force fell to zero", above=0)
    friction: float = quantity("μ of the prediction", above=0)
    patch_radius: float = quantity("m, of the prediction", above=0)
    model: str = quantity("release model of the prediction", choices=DECIDING)
    torsion: float = quantity("c, of the prediction", above=0, default=0.6)
    faces: int = quantity("of the prediction", least=1, default=2)
    fitted: bool = quantity(
        "friction and radius were fitted to these throws, for each residual to the others",
        default=False,
    )

    def check(self) -> None:
        """Enough throws for the level; ranges in order."""
        self.check_level(self.throws, self.level)
        for name in ("x_interval", "theta_interval", "speed", "rate"):
            low, high = getattr(self, name)
            if low > high:
                raise InputError(f"{name}: the lowest comes first")

    @staticmethod
    def rank(throws: int, level: float) -> int:
        """Number k of `throws` whose region, of the k smallest scores, has `level`: the k-th of
        N + 1 exchangeable scores is at least as large as a new one with probability k / (N + 1)."""
        return math.ceil(level * (throws + 1) - 1e-9)

    @staticmethod
    def check_level(throws: int, level: float) -> None:
        """InputError if no region of so few throws has the level: its rank must be at most N.

        Three at least are needed, of which two differ from the mean in different ways.
        """
        needed = max(math.ceil(level / (1.0 - level) - 1e-9), 3)
        if throws < needed:
            raise InputError(
                f"level = {level:g}: {throws} throws are too few, needs at least {needed} throws"
            )

    @property
    def text(self) -> str:
        """The section as lines of a scene file, to six digits."""
        table = {key: _rounded(value) for key, value in table_of(self).items()}
        return "\n".join(toml_lines({"calibration": table}, {"calibration": meanings(type(self))}))

    @property
    def bias(self) -> tuple[float, float]:
        """dx [m], dtheta [rad]: mean of measured less predicted landing."""
        return self.x, self.theta


def _rounded(value: Any) -> Any:
    if isinstance(value, list):
        return [_rounded(one) for one in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value
