"""The object and its grip: bar, grasp, pads, and the grip force with its recordings."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any, overload

import numpy as np

from ..models import Array, PinchContact, SurfaceShape
from ..models.release import GripProfile, LinearGrip, TableGrip
from ..models.robot import segment_distance
from .arm_files import GripperData, load_gripper
from .checks import InputError, within
from .section import UNSET, Section, optional, quantity

#: Largest number of capsules in an outline.
MAX_PARTS = 12
#: Ends of an outline [m] may be off `length` and `width` by this.
ENDS_AGREE = 1e-4


@dataclasses.dataclass(frozen=True)
class OutlinePart(Section):
    """A capsule of an object's outline. Points are [along, across] in the object's frame: in the
    throw's plane, along its axis from the end nearer the grasp, and across it, up for a level
    axis.
    """

    begin: tuple[float, ...] = quantity("m, [along, across] of the middle of one end")
    end: tuple[float, ...] = quantity("m, that of the other")
    radius: float = quantity("m", above=0, most=10, unit="m")

    def check(self) -> None:
        """Two numbers for each point."""
        for key in ("begin", "end"):
            if len(point := getattr(self, key)) != 2:
                raise InputError(f"{key} = {list(point)}: must be [along, across]")


@dataclasses.dataclass(frozen=True)
class Object(Section):
    """The object: a rigid body whose axis goes from the grasp to the CoM; a bar, or with `outline`
    any shape. Required.
    """

    mass: float = quantity("kg", above=0, most=50, unit="kg (is it in grams?)")
    length: float = quantity("m, along the axis", above=0, most=100, unit="m")
    com: float = quantity("m, from the end nearer the grasp to the CoM; at most `length`", least=0)
    inertia: float = quantity(
        "kg m², about the CoM; at most mass·(com·(length − com) + width²/4); left out: a uniform "
        "bar's, mass·(length² + width²)/12",
        above=0,
        least=1e-12,
        most=1e6,
        default=None,
    )
    width: float = quantity(
        "m, across the axis; at most ten times `length`; with `outline` left out: as far as that "
        "reaches",
        least=0,
        most=100,
        unit="m",
        default=0.0,
    )
    outline: tuple[OutlinePart, ...] = quantity(
        "capsules `{ begin = [along, across], end = [along, across], radius }` in m that cover the "
        "object, for all clearances; along the axis from 0 to `length`, across it up for a level "
        "axis. Left out: a bar of `length` and `width`, as thick as wide",
        default=(),
    )
    mesh: str | None = optional(
        "STL file for the 3-D view and MuJoCo, as `import-object` writes: binary, in m, in the "
        "frame of `outline`, its y across the throw's plane; only with `outline`"
    )

    @functools.cached_property
    def capsules(self) -> Array:
        """The outline (K, 5) [m]: along and across of both ends, from the end nearer the grasp, and
        radius; K = 0 for a bar."""
        rows = [[*part.begin, *part.end, part.radius] for part in self.outline]
        return np.array(rows, float).reshape(-1, 5)

    def least_cup(self, reserve: float) -> tuple[float, str]:
        """Radius [m] of the narrowest cup that it fits into with a `reserve` [m] around, and for
        what that is. Thickness and width of a bar are equal; a round cup is narrower off its
        middle."""
        if self.outline:
            return max(self.capsules[:, 4]) + reserve, "the largest radius of the outline"
        return math.hypot(self.width / 2 + reserve, self.width / 2), "half the bar's width"

    def lowest_end(self, theta: float) -> tuple[float, float, float]:
        """The lowest end of an outline's capsules at an angle [rad]: along and across the axis [m]
        from the CoM, and radius [m]."""
        ends, radii = self.capsules[:, :4].reshape(-1, 2), self.capsules[:, 4].repeat(2)
        low = int((ends @ [np.sin(theta), np.cos(theta)] - radii).argmin())
        return float(ends[low, 0]) - self.com, float(ends[low, 1]), float(radii[low])

    def thickness_at(self, offset: float) -> float:
        """Thickness [m] between pads at `offset` [m] from the end nearer the grasp: of an outline
        twice the radius of the capsule whose surface is nearest to them."""
        if not self.outline:
            return self.width
        ends = np.insert(self.capsules[:, :4].reshape(-1, 2, 2), 2, 0.0, axis=2)
        pads = np.broadcast_to([offset, 0.0, 0.0], (len(ends), 3))
        away = segment_distance(pads, pads, ends[:, 0], ends[:, 1]) - self.capsules[:, 4]
        return float(2 * self.capsules[away.argmin(), 4])

    @functools.cached_property
    def half_length(self) -> float:
        """Half the length [m], or half the greatest extent of an outline: the lever of the angle in
        the pose error (39)."""
        if not self.outline:
            return self.length / 2
        ends, radii = self.capsules[:, :4].reshape(-1, 2), np.repeat(self.capsules[:, 4], 2)
        away = np.linalg.norm(ends[:, None] - ends, axis=2) + radii[:, None] + radii
        return float(away.max()) / 2

    @overload
    def pose_error(self, dx: float, dtheta: float) -> float: ...

    @overload
    def pose_error(self, dx: Array, dtheta: Array | float) -> Array: ...

    def pose_error(self, dx: Any, dtheta: Any) -> Any:
        """Pose error |dx| + |dtheta| length / 2 [m], (39): position plus angle times half the
        length.

        dx [m], dtheta [rad]: numbers or arrays (N,); NaN if either is NaN.
        """
        return abs(dx) + abs(dtheta) * self.half_length

    def _check_outline(self) -> None:
        """The outline is as long as the object; its width is the object's."""
        if not 1 <= len(self.outline) <= MAX_PARTS:
            raise InputError(f"outline: must have at most {MAX_PARTS} capsules")
        x, radii = self.capsules[:, [0, 2]], self.capsules[:, 4:]
        first, last = float((x - radii).min()), float((x + radii).max())
        if max(abs(first), abs(last - self.length)) > ENDS_AGREE:
            raise InputError(
                f"outline: reaches along the axis from {first:.4g} to {last:.4g} m: must be from 0 "
                f"to length = {self.length:g}"
            )
        width = 2 * float((np.abs(self.capsules[:, [1, 3]]) + radii).max())
        if self.width and abs(self.width - width) > ENDS_AGREE:
            raise InputError(
                f"width = {self.width:g}: must be {width:.4g} or left out: the outline reaches "
                "half of that from the axis"
            )
        object.__setattr__(self, "width", width)

    def check(self) -> None:
        """CoM inside the bar; inertia not above the two-point-mass bound for that CoM."""
        if self.outline:
            self._check_outline()
        elif self.mesh is not None:
            raise InputError("mesh: only with outline, by which clearances are judged")
        if self.com > self.length:
            raise InputError(f"com = {self.com:g}: must be at most the length {self.length:g} m")
        if self.width > 10 * self.length:
            raise InputError(
                f"width = {self.width:g}: must be at most ten times the length {self.length:g} m "
                "(is it in mm?)"
            )
        if self.outline and self.inertia is None:
            raise InputError("key 'inertia' is missing: with outline there is no default")
        largest = self.mass * (self.com * (self.length - self.com) + self.width**2 / 4)
        if self.inertia is None:
            uniform = self.mass * (self.length**2 + self.width**2) / 12
            if uniform > largest:
                raise InputError(
                    f"key 'inertia' is missing: with com = {self.com:g} the bar is not uniform"
                )
            words = f"inertia is left out: a uniform bar's, {uniform:.4g} kg m^2, is taken"
            self.assume("inertia", uniform, words)
        if self.inertia > largest * (1 + 1e-9):
            raise InputError(
                f"inertia = {self.inertia:g}: must be at most {largest:.4g} kg m^2, "
                "what mass, length, width and com allow"
            )


@dataclasses.dataclass(frozen=True)
class Grasp(Section):
    """Where and how the bar is held. Left out: the bar is held at its end, in line with the
    hand.
    """

    offset: float = quantity(
        "m, from the end nearer the grasp to the pads; at most `com` of [object]",
        least=0,
        default=0.0,
    )
    angle: float = quantity(
        "degrees, of the bar's axis (grasp towards CoM) against the hand's approach axis",
        degrees=True,
        default=0.0,
    )


@dataclasses.dataclass(frozen=True)
class Contact(Section):
    """Friction of the pads. Required."""

    friction: float = quantity("μ, of one pad", above=0, least=1e-6, most=100)
    patch_radius: float = quantity(
        "m, radius r_p of the pads' patch; left out: 0.0025, with a note",
        above=0,
        least=1e-6,
        most=1,
        unit="m",
        default=None,
    )
    torsion: float = quantity(
        "c: the torsional limit is c·r_p times the tangential one",
        above=0,
        least=1e-3,
        most=10,
        default=0.6,
    )
    faces: int = quantity("pads that rub; `force` is that of one", least=1, most=100, default=2)
    pressure: str = quantity(
        "how the models `patch` and `lugre` spread the force over the pad",
        choices=("uniform", "hertz"),
        default="uniform",
    )
    shape: str | None = optional(
        "of the limit surface, fixed to the hand, for `simulate` alone; left out: the ellipsoid of "
        "friction, patch_radius and torsion; `ellipsoid` and `quartic` need `coefficients`; "
        "`two-points`: on the hand's axis, torsion·patch_radius before and behind the middle",
        choices=tuple(SurfaceShape.SHAPES),
    )
    coefficients: tuple[float, ...] = quantity(
        "of the shape; x, y, t are force along and across the hand and torque as shares of their "
        "limits. 6 of an `ellipsoid` A₁₁ x² + A₂₂ y² + A₃₃ t² + 2 A₁₂ xy + 2 A₁₃ xt + 2 A₂₃ yt = "
        "1; 15 of a `quartic`, of x⁴, x³y, x³t, x²y², x²yt, x²t², xy³, xy²t, xyt², xt³, y⁴, y³t, "
        "y²t², yt³, t⁴",
        default=(),
    )

    @property
    def contact(self) -> PinchContact:
        """The contact of the release models."""
        return PinchContact(self.friction, self.patch_radius, self.torsion, self.faces)

    @functools.cached_property
    def surface(self) -> SurfaceShape | None:
        """The shape of the limit surface; None for the plain ellipsoid.

        InputError for coefficients without a shape, or that make no convex surface.
        """
        if self.shape is None:
            if self.coefficients:
                names = ", ".join(SurfaceShape.SHAPES)
                raise InputError(f"coefficients: only with shape, one of {names}")
            return None
        with within("coefficients", errors=ValueError):
            return SurfaceShape.of(self.shape, self.coefficients)

    def check_plain(self) -> None:
        """InputError with a shape."""
        if self.shape is not None:
            raise InputError(
                f"[contact] shape = {self.shape!r}: only `simulate` throws other shapes than the "
                "ellipsoid, of a scene with [motion]: leave the key out"
            )

    def check(self) -> None:
        """Assumes the patch radius of the built-in Panda scenes if none is given; checks the shape
        of the limit surface."""
        _ = self.surface
        if self.patch_radius is None:
            words = (
                "patch_radius is left out: 0.0025 m is taken; better press the closed pads on "
                "inked paper and measure the print, or fit it by `throwplan identify`"
            )
            self.assume("patch_radius", 0.0025, words)


@dataclasses.dataclass(frozen=True)
class Gripper(Section):
    """Grip force of one pad. Required. Either `force` and `opening`, or `times` and `forces`, or
    `table`.
    """

    force: float | None = optional("N, of one pad at full grip", above=0, least=1e-6, most=1e6)
    dwell: float = quantity(
        "s, from the command until the force starts to fall; left out: the file's, or 0",
        least=0,
        most=2,
        unit="s",
        default=UNSET,
    )
    opening: float | None = optional(
        "s, from there to zero, linear", above=0, least=1e-5, most=2, unit="s"
    )
    times: tuple[float, ...] = quantity(
        "s, from the command: a measured force's times, best every 0.5 ms", default=()
    )
    forces: tuple[float, ...] = quantity(
        "N, of one pad at `times`, monotone cubics (PCHIP) between; the last is 0", default=()
    )
    table: str | None = optional(
        "a CSV file with the columns t and f_N instead of `times` and `forces`, read as these"
    )
    file: str | None = optional(
        "a shipped gripper (`franka-hand`, `robotiq-2f-85`) or a gripper data file (.toml): its "
        "body in place of the arm's own hand, and its `force`, `dwell` and `opening` where they "
        "are left out"
    )
    continuous: float | None = optional(
        "N, of one pad, what the gripper holds continuously: a plan with more says so; left out: "
        "the file's `force` if that is not assumed, else not known",
        above=0,
        most=1e6,
    )
    peak: float | None = optional(
        "N, of one pad, the most that the gripper has; left out: the file's, else not known",
        above=0,
        most=1e6,
    )
    sticking_margin: float = quantity(
        "share of the full grip's friction limit that stays unused until the opening; a throw that "
        "leaves less is not solved",
        least=0,
        below=1,
        default=0.05,
    )
    raw: bool = quantity(
        "whether `table` is an unfiltered recording: the nearest falling curve is taken",
        default=False,
    )
    #: What `file` holds; None without one.
    data: GripperData | None = dataclasses.field(default=None, repr=False, compare=False)

    def check(self) -> None:
        """The force is given in exactly one way, or taken from the file; a table falls to zero."""
        measured = bool(self.times or self.forces or self.table)
        if self.file is not None and self.data is None:
            with within(f"file = {self.file!r}"):
                object.__setattr__(self, "data", load_gripper(self.file))
        if self.data is not None:
            self._take(self.data, measured)
        if math.isnan(self.dwell):
            object.__setattr__(self, "dwell", 0.0)
        linear = self.force is not None or self.opening is not None
        if linear == measured:
            raise InputError("give either 'force' and 'opening', or a measured 'table'")
        if measured and self.dwell:
            raise InputError(f"dwell = {self.dwell:g}: only with 'force': 'times' begin before it")
        if linear and (self.force is None or self.opening is None):
            missing = "force" if self.force is None else "opening"
            raise InputError(f"key '{missing}' is missing")
        full = self.profile().full
        if self.peak is not None and full > self.peak:
            given = f"force = {full:g}" if linear else f"table = {self.table}: {full:g} N"
            raise InputError(f"{given}: must be at most {self.peak:g} N, the gripper's peak")

    def _take(self, data: GripperData, measured: bool) -> None:
        """The file's values for keys that are left out."""
        # A force that is assumed is no maker's.
        continuous = None if "force" in data.assumed else data.force
        values: dict[str, Any] = {"continuous": continuous, "peak": data.force_peak}
        if not measured:
            values |= {"force": data.force, "dwell": data.dwell, "opening": data.opening}
        for name, value in values.items():
            if getattr(self, name) in (None, UNSET):
                if {"peak": "force_peak"}.get(name, name) in data.assumed:
                    self.assume(name, value)
                else:
                    object.__setattr__(self, name, value)

    def profile(self) -> GripProfile:
        """The grip-force profile of the models."""
        return self._profile

    def stretched(self, opening: float) -> Gripper:
        """The gripper with a fall of the force in `opening` [s], of unchanged shape; unchecked."""
        if self.opening is not None:
            return self.changed(opening=opening)
        grip = self.profile()
        times, stretch = np.array(self.times), opening / grip.opening
        stretched_times = grip.dwell + stretch * (times - grip.dwell)
        return self.changed(
            times=tuple(np.where(times > grip.dwell, stretched_times, times).tolist())
        )

    @functools.cached_property
    def _profile(self) -> GripProfile:
        if self.force is not None and self.opening is not None:
            return LinearGrip(self.force, self.dwell, self.opening)
        with within(f"table = {self.table or 'times, forces'}", errors=ValueError):
            return TableGrip(self.times, self.forces)
