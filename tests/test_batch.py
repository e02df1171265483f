"""Batches of throws: the single models' answers, whatever the chunking; bad arrays."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest
import throwplan as tp
from throwplan.models import (
    LOST,
    BatchRelease,
    Body,
    Contact,
    LinearRelease,
    Path,
    ReleaseCase,
    SlidingPivotRelease,
    SteppedRelease,
    land,
    sliding_pivot_batch,
    stepped_batch,
)
from throwplan.planner.check.simulate_batch import STEPS


def throws(count: int, seed: int = 0) -> dict:
    rng = np.random.default_rng(seed)
    mass, speed, up = (
        rng.uniform(0.1, 0.4, count),
        rng.uniform(1, 3, count),
        rng.uniform(0, 1.2, count),
    )
    return {
        "object": {
            "mass": mass,
            "inertia": mass * rng.uniform(0.03, 0.07, count) ** 2,
            "com_offset": rng.uniform(0.02, 0.2, count),
        },
        "contact": {
            "friction": rng.uniform(0.3, 1.0, count),
            "patch_radius": rng.uniform(0.0025, 0.01, count),
        },
        "gripper": {"force": np.full(count, 100.0), "opening": rng.uniform(0.03, 0.1, count)},
        "hand": {
            "pose": np.column_stack([np.zeros((count, 2)), rng.uniform(-1.5, 1.0, count)]),
            "twist": np.column_stack(
                [speed * np.cos(up), speed * np.sin(up), rng.uniform(-4, 4, count)]
            ),
            "acceleration": np.column_stack(
                [rng.uniform(-10, 10, (count, 2)), rng.uniform(-20, 20, count)]
            ),
        },
    }


def single(values: dict, i: int) -> ReleaseCase:
    body, contact, hand = values["object"], values["contact"], values["hand"]
    return ReleaseCase(
        Body(body["mass"][i], body["inertia"][i], body["com_offset"][i]),
        Contact(contact["friction"][i], contact["patch_radius"][i], 0.6, 2),
        LinearRelease(100.0, 0.0, values["gripper"]["opening"][i]),
        Path.accelerating(*(hand[k][i] for k in ("pose", "twist", "acceleration"))),
    )


DROP = tp.load_scene("drop")


def landing(detach: np.ndarray) -> np.ndarray:
    return land(detach, -0.9, 9.81)


@pytest.mark.parametrize(
    ("model", "exact", "position", "angle"),
    [
        ("sp", SlidingPivotRelease(steps=300, events=True), 1e-4, 0.1),
        ("sp-paper", SlidingPivotRelease("paper", steps=300, events=True), 1e-3, 0.2),
        ("ls-step", SteppedRelease(8000), 1e-3, 0.5),
    ],
)
def test_batch_lands_where_the_single_models_do(model, exact, position, angle) -> None:
    values = throws(25)
    batch = landing(tp.simulate_batch(DROP, model, **values).detach)
    for i in range(25):
        release = exact.release(single(values, i))
        one = landing(np.concatenate([release.com[:, -1], release.com_twist[:, -1]])[None])[0]
        assert batch[i, 0] == pytest.approx(one[0], abs=position)
        assert batch[i, 1] == pytest.approx(one[1], abs=np.radians(angle))


def test_default_steps_are_converged_over_many_throws() -> None:
    from throwplan.planner.check.simulate_batch import _batch

    values = throws(3000, seed=5)
    batch = _batch(DROP, values["hand"], values["contact"], values["object"], values["gripper"])
    for run, steps, position, angle in (
        (sliding_pivot_batch, 1500, 1e-4, 0.1),
        (stepped_batch, 2000, 1e-3, 0.5),
    ):
        difference = np.abs(landing(run(batch)) - landing(run(batch, steps)))
        assert np.percentile(difference[:, 0], 99.9) < position
        assert np.degrees(np.percentile(difference[:, 1], 99.9)) < angle


def test_workers_and_chunks_do_not_change_a_digit() -> None:
    values = throws(9000)
    alone = tp.simulate_batch(DROP, **values).detach
    with ThreadPoolExecutor(2) as threads, ProcessPoolExecutor(2) as processes:
        for executor in (threads, processes):
            spread = tp.simulate_batch(DROP, **values, executor=executor).detach
            assert np.array_equal(spread, alone)


def test_numbers_stand_for_the_scene_and_landing_is_given_at_its_height() -> None:
    scene = DROP.replace(target=tp.Pose(x=0.0, z=-1.0))
    result = tp.simulate_batch(scene, contact={"friction": np.array([0.4, 0.8, 1.6])})
    assert result.detach.shape == (3, 6)
    plain = tp.simulate(scene, "sp")["sp"]
    assert result.detach[1, 5] == pytest.approx(plain.release.com_twist[2, -1], rel=3e-4)
    assert result.landing is not None
    assert result.landing[1, 0] == pytest.approx(plain.landing.x, abs=1e-5)
    # More friction holds the bar longer: it leaves with a smaller rate.
    assert (np.diff(np.abs(result.detach[:, 5])) < 0).all()


def test_sampled_hands_are_the_constant_acceleration_they_sample() -> None:
    values = throws(6)
    t = np.linspace(-0.01, 0.12, 60)
    hand = values["hand"]
    poses = (
        hand["pose"][:, None]
        + hand["twist"][:, None] * t[:, None]
        + hand["acceleration"][:, None] * t[:, None] ** 2 / 2
    )
    plain = tp.simulate_batch(DROP, **values).detach
    sampled = tp.simulate_batch(DROP, **{**values, "hand": {"times": t, "poses": poses}}).detach
    assert sampled == pytest.approx(plain, rel=1e-7, abs=1e-9)


def test_delays_start_later_on_one_shared_motion() -> None:
    t = np.linspace(0.0, 0.2, 80)
    poses = np.column_stack([1.5 * t, 0.8 * t, 0.4 + 3.0 * t])[None]
    delays = np.array([0.0, 0.02, 0.05])
    result = tp.simulate_batch(DROP, hand={"times": t, "poses": poses, "delays": delays}).detach
    assert np.allclose(np.diff(result[:, 0]) > 0, True)
    turned = 0.4 + 3.0 * delays
    one = tp.simulate_batch(
        DROP, hand={"pose": [[0.0, 0.0, turned[2]]], "twist": [[1.5, 0.8, 3.0]]}
    ).detach[0]
    assert result[2, 3:] == pytest.approx(one[3:], rel=1e-6)


def test_a_hundred_thousand_throws_stay_under_a_gigabyte() -> None:
    code = (
        "import resource, numpy as np, throwplan as tp; n = 100_000; "
        "r = tp.simulate_batch(tp.load_scene('drop'), "
        "contact={'friction': np.linspace(0.3, 1.0, n)}); "
        "assert np.isfinite(r.detach).all(); "
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 1_000_000


def test_trouble_is_what_the_single_model_says() -> None:
    """A heavy bar in a slippery grip slides out of the pads; a light one is held."""
    values = throws(40, seed=3)
    values["object"]["mass"][::2] *= 20.0
    values["object"]["inertia"][::2] *= 20.0
    values["contact"]["friction"][::4] = 0.02
    values["gripper"]["opening"][::4] = 0.3
    result = tp.simulate_batch(DROP, **values)
    alone = [SlidingPivotRelease().release(single(values, i)).trouble for i in range(40)]
    assert list(result.trouble) == alone
    assert 0 < (result.trouble == "").sum() < 40
    assert (tp.simulate_batch(DROP, "ls-step", **values).trouble == "").all()


def test_what_could_not_be_computed_says_why() -> None:
    detach = np.zeros((3, 6))
    detach[1, 2] = np.nan
    release = BatchRelease(detach, np.array([True, True, False]), "no solution")
    assert list(release.trouble) == [LOST, "no solution", ""]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"model": "lss"}, "must be one of sp, sp-paper, ls-step, patch, lugre"),
        ({"contact": {"mu": 1.0}}, "contact: unknown key 'mu'"),
        ({"contact": {"friction": [0.5, np.nan]}}, "contact.friction: must be finite"),
        ({"contact": {"friction": [0.5, -1.0]}}, "contact.friction: must be above 0"),
        ({"object": {"mass": "heavy"}}, "object.mass: must be numbers"),
        (
            {"contact": {"friction": [0.5, 0.6]}, "object": {"mass": [0.1, 0.2, 0.3]}},
            "has 2 entries, other arrays have 3",
        ),
        ({"hand": {"poses": np.zeros((1, 5, 3))}}, "needs 'times' and 'poses'"),
        (
            {"hand": {"times": [0, 0.1, 0.1, 0.2], "poses": np.zeros((1, 4, 3))}},
            "hand.times: must rise",
        ),
        (
            {"hand": {"times": [0, 0.1, 0.2, 0.3], "poses": np.zeros((1, 5, 3))}},
            "hand.poses: must be (N, 4, 3)",
        ),
        ({"hand": {"pose": np.zeros((4, 2))}}, "hand.pose: must be an array (N, 3)"),
        ({"steps": 0}, "steps = 0: must be a whole number, 1 to 100000"),
        ({"steps": 12.5}, "steps = 12.5: must be a whole number"),
        ({"steps": True}, "steps = True: must be a whole number"),
    ],
)
def test_bad_arrays_are_one_clear_line(arguments: dict, words: str) -> None:
    with pytest.raises(tp.InputError) as caught:
        tp.simulate_batch(DROP, **arguments)
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(("model", "nearer"), [("sp", 50.0), ("ls-step", 8.0), ("patch", 4.0)])
def test_steps_that_are_asked_for_are_taken(model: str, nearer: float) -> None:
    """16 times the steps are nearer to many; without any the usual ones are taken.

    By less for the patch, whose points begin to slip one by one inside the steps.
    """
    few, more, many, usual = 20, 320, 2560, STEPS[model]
    found = {
        steps: tp.simulate_batch(DROP, model, steps=steps, **throws(8, 1)).detach
        for steps in (few, more, many, usual)
    }
    error = {n: float(np.median(np.abs(found[n] - found[many]).max(axis=1))) for n in (few, more)}
    assert error[more] < error[few] / nearer
    plain = tp.simulate_batch(DROP, model, **throws(8, 1)).detach
    np.testing.assert_array_equal(plain, found[usual])
