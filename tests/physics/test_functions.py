"""Fails if the models as CasADi functions differ from the exact releases, the C core, or their
derivatives from differences."""

import casadi as ca
import numpy as np
import pytest
from release_cases import function_inputs, reference_case, smoothed
from throwplan.models import flight, limit_surface_step, release_dynamics
from throwplan.models.release import SteppedRelease, exact_pivot_release

FUNCTIONS = {each.__name__: each() for each in (release_dynamics, limit_surface_step, flight)}
BAR = {"mass": 0.24, "inertia": 5.35e-4, "com_offset": 0.1}
PADS = {"friction": 1.0, "patch_radius": 0.0025, "torsion": 0.6, "faces": 2.0}
HAND = {"pose": [0.1, 0.9, 0.3], "twist": [1.5, 1.0, 4.0], "acceleration": [3.0, -2.0, 8.0]}
#: Inputs of each function: an object that slips under a falling grip, one that flies.
INPUTS = {
    "release_dynamics": HAND
    | BAR
    | PADS
    | {"state": [1e-4, -2e-4, -0.05, 0.01, -0.02, -1.0], "normal_force": 8.0}
    | {"gravity": 9.81, "width": 0.01},
    "limit_surface_step": PADS
    | {"mass": 0.24, "inertia": 5.35e-4}
    | {"object": [0.2, 0.93, 0.28, 1.3, 1.35, 3.5], "pose": [0.1, 0.9, 0.3], "normal_force": 8.0}
    | {"next_pose": [0.103, 0.902, 0.308], "next_twist": [1.506, 0.996, 4.016]}
    | {"dt": 2e-3, "gravity": 9.81},
    "flight": {"object": [0.2, 0.95, 0.4, 1.5, 1.2, 5.0], "height": 0.2, "gravity": 9.81},
}


@pytest.mark.parametrize("name", ["drop_h100_faces2", "throw_decelerating"])
def test_release_dynamics_is_the_exact_release_up_to_the_smoothing(name) -> None:
    """The error falls with the square of the width: halving it removes three quarters."""
    case = reference_case(name)
    exact, wide, narrow = exact_pivot_release(case).end, smoothed(case, 0.02), smoothed(case, 0.01)
    assert np.linalg.norm(narrow - exact) < 0.4 * np.linalg.norm(wide - exact) < 0.02


@pytest.mark.parametrize("name", ["drop_h100_faces2", "throw_decelerating"])
def test_limit_surface_steps_are_those_of_the_core(name) -> None:
    case, steps = reference_case(name), 100
    dt, state, step = case.grip.opening / steps, case.start(), FUNCTIONS["limit_surface_step"]
    for i in range(steps):
        start, end = (case.hand.at(np.array([(i + k) * dt])) for k in (0, 1))
        state = step(
            object=state,
            pose=start.pose,
            next_pose=end.pose,
            next_twist=end.twist,
            normal_force=float(case.grip.force((i + 0.5) * dt)),
            dt=dt,
            **function_inputs(case, step),
        )["next_object"]
    expected = SteppedRelease(steps).release(case).end
    np.testing.assert_allclose(np.array(state).ravel(), expected, rtol=1e-7, atol=1e-9)


#: Where 0/0 waits: no wrench, with and without grip and offset.
QUIET = {"state": [0.0, 0, 0.3, 0, 0, 0], "twist": [0.0, 0, 0], "acceleration": [0.0, -9.81, 0]}


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        *((name, {}) for name in FUNCTIONS),
        *((name, {"normal_force": 200.0}) for name in FUNCTIONS if name != "flight"),
        ("release_dynamics", QUIET),
        ("release_dynamics", QUIET | {"normal_force": 0.0}),
        ("release_dynamics", QUIET | {"normal_force": 0.0, "com_offset": 0.0}),
    ],
)
def test_derivatives_are_those_of_differences(name, changes) -> None:
    function = FUNCTIONS[name]
    inputs = {key: np.array(value) for key, value in (INPUTS[name] | changes).items()}
    symbols = [ca.SX.sym(each, function.size1_in(each)) for each in function.name_in()]
    outputs = ca.vertcat(*function(*symbols)) if function.n_out() > 1 else function(*symbols)
    jacobian = ca.Function("jacobian", symbols, [ca.jacobian(outputs, ca.vertcat(*symbols))])
    values = np.concatenate([inputs[each].ravel() for each in function.name_in()])
    ends = np.cumsum([function.size1_in(each) for each in function.name_in()])[:-1]

    def at(vector):
        found = function(*np.split(vector, ends))
        return np.array(ca.vertcat(*found) if function.n_out() > 1 else found).ravel()

    found = np.array(jacobian(*np.split(values, ends)))
    assert np.isfinite(found).all()
    for i, value in enumerate(values):
        move = np.zeros_like(values)
        move[i] = 1e-6 * max(abs(value), 1e-2)
        slope = (at(values + move) - at(values - move)) / (2 * move[i])
        np.testing.assert_allclose(
            found[:, i], slope, rtol=1e-4, atol=1e-5 * (1 + abs(slope).max())
        )
