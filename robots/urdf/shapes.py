"""Shapes of a URDF's links: its meshes in the arm's frames, and capsules around them."""

from __future__ import annotations

import itertools
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...models import Array
from ...planner import segment_distance
from ...problems import InputError, LinkCapsule
from .chain import UrdfChain
from .reading import BEYOND

#: Decimals of the capsules' lengths [m], 1 mm.
DIGITS = 3
#: Largest distance of a shape from its link's frame, as a share of the arm's reach. Beyond it, its
#: unit or place is wrong.
EXTENT = 1.5
#: A still link is halved at most this often, where its capsule's radius is above this share of the
#: arm's reach and those of the halves have less than this share of its volume.
HALVINGS, THICK, SMALLER = 3, 0.1, 0.8
#: Distance [m] between points on a mesh, and their largest number.
SPACING, POINTS = 0.004, 20_000
#: Distance [m] that is allowed for links that stand still, too: a short arm may hang on a mast.
MAST = 2.0


@dataclass(frozen=True)
class LinkShapes:
    """Capsules of a robot's links.

    surfaces (N, 3) [m] each: points on the meshes in each capsule, in its link's frame;
    unread: the URDF's links whose meshes could not be read; tried: a file that was not found.
    not_z_up: links with a COLLADA mesh whose up axis is another than z.
    """

    capsules: tuple[LinkCapsule, ...]
    surfaces: tuple[Array, ...]
    unread: tuple[str, ...]
    tried: str = ""
    not_z_up: tuple[str, ...] = ()


def link_shapes(chain: UrdfChain, file: Path, reach: float) -> LinkShapes:
    """A capsule of about the least volume around the meshes of each URDF link that moves, several
    around one that stands still, such as a torso or a stand.

    A link inside a capsule of another link of its joint has none of its own. reach [m]: of the arm;
    InputError for shapes that do not fit it, see `EXTENT`.
    """
    meshes, unread = link_meshes(chain, file, reach)
    capsules_found = list[LinkCapsule]()
    aside = chain.fixed_links
    for number in sorted(meshes):
        own = {name: np.vstack([mesh.vertices for mesh in m]) for name, m in meshes[number].items()}
        for name in sorted(own, key=lambda name: -float(np.ptp(own[name], axis=0).max())):
            of_body = [c for c in capsules_found if (c.link, c.beside) == (number, name in aside)]
            if _outside(own[name], of_body) > 0.0:
                if number:
                    capsules_found.append(_around(number, own[name]))
                else:
                    parts = _around_halves(meshes[number][name], THICK * reach, HALVINGS)
                    capsules_found += [replace(part, beside=name in aside) for part in parts]
    capsules_found = _join_base(chain, capsules_found)
    tried = next(filter(None, unread.values()), "")
    turned = tuple(
        name
        for own in meshes.values()
        for name, parts in own.items()
        if any(part.metadata.get("up_axis", "Z") != "Z" for part in parts)
    )
    surfaces = _surfaces(meshes, capsules_found)
    return LinkShapes(tuple(capsules_found), surfaces, tuple(unread), tried, turned)


def link_meshes(
    chain: UrdfChain, file: Path, reach: float = math.inf
) -> tuple[dict[int, dict[str, list[Any]]], dict[str, str]]:
    """Meshes (trimesh) of each URDF link, by the `LinkCapsule.link` whose frame they are in.

    A link's collision geometry, else its visual one; fingers in all their places. Also the names of
    links whose meshes are not read, each with a file that was not found, or "". file: the URDF, see
    `_path`. InputError for a shape that does not fit an arm of that reach [m], see `EXTENT`.
    """
    robot, hand = chain.robot, len(chain.names) + 1
    frames, moved_by = chain.body_frames, chain.numbers
    still = dict.fromkeys(robot.actuated_joint_names, 0.0)
    fingers = {name for name in still if moved_by[robot.joint_map[name].parent] == hand}
    meshes, unread = dict[int, dict[str, list[Any]]](), dict[str, str]()
    for link in robot.link_map.values():
        number, placed = moved_by[link.name], list[Any]()
        try:
            parts = list(_parts(link, file))
        except Exception as error:  # trimesh lets through whatever its readers raise.
            unread[link.name] = str(error) if isinstance(error, _MissingMeshError) else ""
            continue
        far = max((np.linalg.norm(part.vertices, axis=1).max() for part in parts), default=0.0)
        if far > max(EXTENT * reach, 0.0 if number else MAST):
            raise InputError(
                f"link '{link.name}': its shape reaches {far:.3g} m from the link's frame, farther "
                f"than {EXTENT:g} times the arm's reach, {reach:.3g} m: correct its mesh's scale "
                "or unit, or take the shape out of the URDF"
            )
        frame, turn = frames[number]
        # Shares of the fingers' ranges.
        for share in (0.0, 0.25, 0.5, 0.75, 1.0) if number == hand else (0.0,):
            opened = {name: _between(robot.joint_map[name], share) for name in fingers}
            robot.update_cfg(still | (opened if number == hand else {}))
            pose = np.linalg.inv(turn) @ robot.get_transform(link.name, frame)
            placed += [part.copy().apply_transform(pose) for part in parts]
        if placed:
            meshes.setdefault(number, {})[str(link.name)] = placed
    robot.update_cfg(still)
    return meshes, unread


def _between(joint: Any, share: float) -> float:
    """A joint's position at a share of its range; 0 without one, or with one that no robot has."""
    low, high = (getattr(joint.limit, end, None) or 0.0 for end in ("lower", "upper"))
    ranged = abs(low) <= BEYOND and abs(high) <= BEYOND
    return float(low + share * (high - low)) if ranged else 0.0


def _parts(link: Any, file: Path) -> Iterator[Any]:
    """A link's collision geometry, else its visual one, in its own frame."""
    import trimesh

    mesh: Any
    for part in link.collisions or link.visuals:
        shape = part.geometry
        if shape.mesh is not None:
            mesh = _loaded(_path(shape.mesh.filename, file))
            mesh.apply_scale(1.0 if shape.mesh.scale is None else shape.mesh.scale)
        elif shape.box is not None:
            mesh = trimesh.creation.box(shape.box.size)
        elif shape.cylinder is not None:
            # The corners of the prism are 0.1 % of the radius inside.
            round_, long = shape.cylinder.radius, shape.cylinder.length
            mesh = trimesh.creation.cylinder(round_, long, sections=64)
        else:
            mesh = trimesh.creation.icosphere(4, shape.sphere.radius)
        mesh.apply_transform(np.eye(4) if part.origin is None else part.origin)
        if not (len(mesh.vertices) and np.abs(mesh.vertices).max() <= BEYOND):
            raise ValueError("an empty mesh, or one that no robot has")
        yield mesh


def _loaded(path: Path) -> Any:
    """A mesh in metres. COLLADA has a unit, which counts, and an up axis, which does not: ROS takes
    the coordinates as they stand, and its robots' meshes rely on it."""
    import trimesh

    mesh: Any = trimesh.load(path, force="mesh")
    if path.suffix.lower() == ".dae":
        mesh.convert_units("m")
        up_axis = re.search(rb"<up_axis>\s*([XYZ])_UP", path.read_bytes())
        mesh.metadata["up_axis"] = up_axis[1].decode() if up_axis else "Z"
    return mesh


class _MissingMeshError(Exception):
    """The path of a mesh that is not there."""


def _path(name: str, file: Path) -> Path:
    """The file that a URDF calls by a name: absolute, beside the URDF, or in a package.

    A package is looked for in the folders above the URDF, which may also be inside it, and in those
    that ROS names. A path from another machine's ROS is looked for as a package's, by what comes
    after its last `share/`. _MissingMeshError with a file that was tried.
    """
    plain = file.parent / name.removeprefix("file://")
    candidates = list[Path]()
    if not name.startswith("package://"):
        candidates, name = [plain], name.rpartition("/share/")[2] if "/share/" in name else ""
    package, _, rest = name.removeprefix("package://").partition("/")
    if rest:
        above, ros = list(file.resolve().parents), []
        for variable, inside in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
            folders = os.environ.get(variable, "").split(os.pathsep)
            ros += [Path(folder) / inside for folder in folders if folder]
        candidates += [folder / package / rest for folder in [*above, *ros]]
        candidates += [folder / rest for folder in above]
    if found := next((path for path in candidates if path.is_file()), None):
        return found
    raise _MissingMeshError(str(next(iter(candidates), name)))


# Capsules.


def _around(number: int, points: Array) -> LinkCapsule:
    """A capsule of about the least volume around points (N, 3), from three starts."""
    # Few commands need it, and it takes a while to import.
    from scipy.optimize import minimize

    middle = points.mean(axis=0)
    # It is fitted to the points that are outermost in one of many directions.
    ways = np.random.default_rng(0).normal(size=(500, 3))
    outer = points[np.unique((ways @ points.T).argmax(axis=1))]
    best, least = np.zeros(7), math.inf
    axes = np.linalg.svd(outer - outer.mean(axis=0), full_matrices=False)[2]
    for axis in axes:
        axial = (points - middle) @ axis
        half = max((axial.max() - axial.min()) / 4, 1e-3) * axis
        x = np.concatenate([middle - half, middle + half, [np.abs(axial).max()]])
        # Weights [1/m²] of points outside, beside the volume in litres.
        for penalty in (3e2, 3e4, 3e6):
            x = minimize(_cost, x, args=(outer, penalty), jac=True, method="L-BFGS-B").x
        x[:6] = x[:6].round(DIGITS) + 0.0
        x[6] = math.ceil(_distances(points, x)[0].max() * 10**DIGITS - 1e-6) / 10**DIGITS
        if (cost := _cost(x, outer, 0.0)[0]) < least:
            best, least = x, cost
    begin, end, radius = best[:3].tolist(), best[3:6].tolist(), float(best[6])
    return LinkCapsule(number, (begin[0], begin[1], begin[2]), (end[0], end[1], end[2]), radius)


def _around_halves(meshes: Sequence[Any], thick: float, times: int) -> list[LinkCapsule]:
    """Capsules around meshes of a link that stands still: one, or, if its radius is above `thick`
    [m], those of halves cut `times` times across their longest side, where these are smaller."""
    import trimesh

    mesh: Any = trimesh.util.concatenate(list(meshes))
    one = _around(0, mesh.vertices)
    if not times or one.radius < thick:
        return [one]
    across = np.eye(3)[int(np.ptp(mesh.vertices, axis=0).argmax())]
    middle = mesh.bounds.mean(axis=0)
    halves = [mesh.slice_plane(middle, sign * across) for sign in (1, -1)]
    if not all(len(half.vertices) for half in halves):
        return [one]
    parts = [part for half in halves for part in _around_halves([half], thick, times - 1)]
    return parts if sum(map(_volume, parts)) < SMALLER * _volume(one) else [one]


def _volume(capsule: LinkCapsule) -> float:
    """Its volume [m³]."""
    length = math.dist(capsule.begin, capsule.end)
    return math.pi * capsule.radius**2 * (length + 4 / 3 * capsule.radius)


def _cost(x: Array, points: Array, penalty: float) -> tuple[float, Array]:
    """Volume [L] of the capsule x (begin, end, radius), with a penalty for points outside."""
    distance, difference, share = _distances(points, x)
    d, r = x[3:6] - x[:3], float(x[6])
    length = math.hypot(*d, 1e-6)
    out = np.maximum(distance - r, 0.0)
    value = 1e3 * math.pi * (r**2 * length + 4 / 3 * abs(r) ** 3) + penalty * (out**2).sum()
    pull = 2 * penalty * out
    towards = (pull / np.maximum(distance, 1e-12))[:, None] * difference
    stretch = 1e3 * math.pi * r**2 / length * d
    begin, end = -stretch - (1 - share) @ towards, stretch - share @ towards
    swell = 1e3 * math.pi * (2 * r * length + 4 * r * abs(r)) - pull.sum()
    return float(value), np.concatenate([begin, end, [swell]])


def _distances(points: Array, x: Array) -> tuple[Array, Array, Array]:
    """Distances (N,), differences (N, 3) and shares (N,) of points (N, 3) from the segment x."""
    d = x[3:6] - x[:3]
    share = np.clip((points - x[:3]) @ d / max(float(d @ d), 1e-12), 0.0, 1.0)
    differences = points - x[:3] - share[:, None] * d
    return np.linalg.norm(differences, axis=1), differences, share


def _outside(points: Array, capsules: Sequence[LinkCapsule]) -> float:
    """Largest distance [m] of points (N, 3) outside the capsule that holds them best."""
    segments = [np.array([*c.begin, *c.end]) for c in capsules]
    excess = [
        float(_distances(points, x)[0].max()) - c.radius
        for x, c in zip(segments, capsules, strict=True)
    ]
    return max(min(excess, default=math.inf), 0.0)


def _surfaces(
    meshes: Mapping[int, Mapping[str, Sequence[Any]]], capsules: Sequence[LinkCapsule]
) -> tuple[Array, ...]:
    """Points on the meshes (N, 3), of each capsule those that it holds best of all of its link."""
    import trimesh

    found = [np.zeros((0, 3)) for _ in capsules]
    for number, own in meshes.items():
        of_link = [k for k, capsule in enumerate(capsules) if capsule.link == number]
        for mesh in itertools.chain(*own.values()):
            count = min(math.ceil(mesh.area / SPACING**2), POINTS)
            points = trimesh.sample.sample_surface(mesh, count, seed=0)[0]
            segments = [np.array([*capsules[k].begin, *capsules[k].end]) for k in of_link]
            outside = [
                _distances(points, x)[0] - capsules[k].radius
                for k, x in zip(of_link, segments, strict=True)
            ]
            best = np.argmin(outside, axis=0)
            for n, k in enumerate(of_link):
                found[k] = np.vstack([found[k], points[best == n]])
    return tuple(found)


def _join_base(chain: UrdfChain, capsules: Sequence[LinkCapsule]) -> list[LinkCapsule]:
    """The capsules, of which a body beside the arm that a link meets in most postures counts to the
    base: its own parts hold the arm."""
    states = np.random.default_rng(0).uniform(-math.pi, math.pi, (60, len(chain.names)))
    placed = np.array([_ends(chain, capsules, state) for state in states])

    def meets(i: int, j: int) -> bool:
        apart = segment_distance(*placed[:, i].swapaxes(0, 1), *placed[:, j].swapaxes(0, 1))
        return float(np.median(apart)) < capsules[i].radius + capsules[j].radius

    moving = [i for i, capsule in enumerate(capsules) if capsule.link > 0]
    return [
        replace(c, beside=c.beside and not any(meets(i, j) for j in moving))
        for i, c in enumerate(capsules)
    ]


def _ends(chain: UrdfChain, capsules: Sequence[LinkCapsule], state: Array) -> list[Array]:
    """Ends (2, 3) of each capsule in the base frame, at joint angles [rad]."""
    chain.posed(state.tolist())
    frames = [
        chain.robot.get_transform(link, chain.base) @ turn for link, turn in chain.body_frames
    ]
    return [
        np.array([c.begin, c.end]) @ frames[c.link][:3, :3].T + frames[c.link][:3, 3]
        for c in capsules
    ]
