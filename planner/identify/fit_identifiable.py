"""Whether throws can tell the unknowns of a fit, and if not, why."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...problems import InputError

Array = npt.NDArray[np.float64]

#: Throws count as alike where their derivatives differ by less than this share: repeated
#: throws of an arm by 3 to 20 %, throws of different motions by 80 %.
ALIKE = 0.2
#: Units in which a standard deviation above 1 says that a combination is not seen.
UNITS = {"friction": 1.0, "patch_radius": 1.0, "delay": 0.03, "grip_scale": 1.0}
CURE = "give throws with other motions or objects, or --prior SCENE"


def check_identifiable(slopes: Array, names: tuple[str, ...], precision: Array) -> None:
    """InputError where there is one kind of throw only, or a combination that none depends on.

    slopes (T, 2, P): derivatives of the residuals in sigmas; precision (P, P) of what is
    known beforehand. That friction and radius are seen through their product only is no
    error: their own deviations say so.
    """
    count = len(slopes)
    words = ", ".join(names)
    if count < 2:
        raise InputError(
            f"not identifiable: {count} throw for {words}: an error of the model cannot be told "
            f"from one of theirs; {CURE}"
        )
    spread = np.sqrt(((slopes - slopes.mean(axis=0)) ** 2).sum(axis=(1, 2)).mean())
    size = np.sqrt((slopes**2).sum(axis=(1, 2)).mean())
    if spread <= ALIKE * size:
        raise InputError(
            f"not identifiable: {words}: all {count} throws are alike (their landings depend on "
            f"them in the same way within {100 * ALIKE:.0f} %), so that an error of the model "
            f"looks just like one of theirs; {CURE}"
        )
    _check_directions(slopes.reshape(-1, len(names)), names, precision)


def _check_directions(jacobian: Array, names: tuple[str, ...], precision: Array) -> None:
    """InputError for a combination, other than mu against r_p, that moves no landing."""
    units = np.array([UNITS[name] for name in names])
    information = (jacobian.T @ jacobian + precision) * np.outer(units, units)
    values, vectors = np.linalg.eigh(information)
    ridge = np.array([{"friction": 1.0, "patch_radius": -1.0}.get(name, 0.0) for name in names])
    for value, vector in zip(values, vectors.T, strict=True):
        alone = abs(vector @ ridge) / np.sqrt(2.0)
        if value >= 1.0 or (alone > 0.9 and value > 1e-6):
            continue
        parts = [name for name, share in zip(names, vector, strict=True) if abs(share) > 0.3]
        together = f"{' and '.join(parts)}" + (" in one combination" if len(parts) > 1 else "")
        raise InputError(
            f"not identifiable: {together}: these throws hardly depend on it (a change by a "
            f"factor of e, or by {1e3 * UNITS['delay']:.0f} ms, stays within the noise); {CURE}"
        )
