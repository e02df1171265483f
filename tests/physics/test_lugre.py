"""Fails if LuGre bristles differ from an independent integration of the law as printed, from the
rigid patch as they stiffen, or give energy."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from release_cases import energy_of, reference_case
from scipy.integrate import solve_ivp
from throwplan.models.release import LinearGrip, ReleaseCase
from throwplan.models.release.patch import PatchRelease, critical_damping, disc

DROP = "drop_h100_faces2"


def reference(case: ReleaseCase, model: PatchRelease) -> np.ndarray:
    """The law as printed, by a stiff integrator, for a still hand at angle 0: detach (6,)."""
    patch = disc("uniform", model.points, float(case.contact.torsion_arm))
    body, mu, count = case.body, case.contact.friction, len(patch.x)
    grip = case.contact.faces * float(case.grip.force(0.0))
    damping = model.damping_ratio * critical_damping(body.mass, grip, model.stiffness)
    weight = body.mass * case.gravity

    def rates(t: float, state: np.ndarray) -> np.ndarray:
        (x, z, _), (v_x, v_z, omega) = state[:3], state[3:6]
        bristle = state[6:].reshape(2, count)
        v = np.array([v_x + omega * (z - patch.z), v_z - omega * (x - patch.x)])
        bent = v - model.stiffness * np.hypot(v[0], v[1]) * bristle / mu
        force = -case.contact.faces * float(case.grip.force(t)) * patch.weights
        force = force * (model.stiffness * bristle + damping * bent)
        torque = ((patch.x - x) * force[1] - (patch.z - z) * force[0]).sum()
        a = np.array([force[0].sum() / body.mass, force[1].sum() / body.mass - case.gravity])
        return np.concatenate([state[3:6], a, [torque / body.inertia], bent.ravel()])

    # Bristles of a linear pad that carry weight and its torque about the pads.
    at = np.array([[np.ones(count), 0 * patch.x, -patch.z], [0 * patch.x, np.ones(count), patch.x]])
    spread = np.einsum("ajp,p,akp->jk", at, patch.weights, at)
    load = np.array([0.0, -weight, -weight * body.com_offset]) / (grip * model.stiffness)
    bristle = np.einsum("ajp,j->ap", at, np.linalg.solve(spread, load))
    start = np.concatenate([case.start(), bristle.ravel()])
    run = solve_ivp(rates, (0.0, case.grip.opening), start, "LSODA", rtol=1e-7, atol=1e-11)
    return np.asarray(run.y[:6, -1])


@pytest.mark.parametrize(
    "model", [PatchRelease(points=8, stiffness=1e6, damping_ratio=0.3, steps=2000)]
)
def test_agrees_with_an_independent_integration(model: PatchRelease) -> None:
    # A light load at first, so that linear and loaded bristles are the same.
    case = dataclasses.replace(reference_case(DROP), grip=LinearGrip(300.0, 0.0, 0.05))
    found, expected = model.release(case).end, reference(case, model)
    assert found[5] == pytest.approx(expected[5], rel=0.01)
    np.testing.assert_allclose(found[3:5], expected[3:5], atol=1e-3)
    np.testing.assert_allclose(found[:3], expected[:3], atol=1e-4)


@pytest.mark.parametrize("name", [DROP, "throw_decelerating"])
def test_stiff_bristles_become_the_rigid_patch(name: str) -> None:
    case = reference_case(name)
    rigid = PatchRelease(steps=300).release(case).end
    apart = []
    for stiffness in (1e6, 1e8, 1e10, 1e12):
        bristled = PatchRelease(stiffness=stiffness, steps=300).release(case)
        apart.append(float(np.abs(bristled.end - rigid).max()))
    # At least with the root of the stiffness, as the damping does.
    assert apart[1] < 0.01
    assert apart[2] < 1e-3
    assert apart[3] < 3e-4


def test_a_still_hand_gives_no_energy_beyond_that_of_the_bristles() -> None:
    # Bristles hold at most N mu^2 / (2 sigma_0), and lose it as the grip falls.
    case = reference_case("drop_h100_faces1")
    for ratio in (0.1, 10.0):
        release = PatchRelease(stiffness=1e5, damping_ratio=ratio).release(case)
        energy = energy_of(case, release)
        bristles = case.contact.faces * case.grip.full * case.contact.friction**2 / 2e5
        assert (energy <= energy[0] + bristles).all()
