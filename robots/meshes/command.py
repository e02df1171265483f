"""`throwplan import-object`: a mesh as a scene's [object]."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from ...problems import InputError, filling, stl_bytes
from ...terminal import DONE, Add, Progress, new_toml_out, number, print_result
from .body import MeshChoices, MeshObject, object_from, object_text
from .solid import read_mesh

#: Units of a mesh's lengths in m.
UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}


def arguments(add: Add) -> None:
    """The command's options."""
    add("mesh", metavar="MESH", help="STL or OBJ file, watertight")
    words = "the sections [object] and [grasp]; the mesh in the object's frame goes beside it"
    add("--out", required=True, metavar="FILE.toml", help=words)
    add("--force", action="store_true", help="overwrite existing files")
    form, point = ("X", "Y", "Z"), {"nargs": 3, "type": number(-1e6, 1e6)}
    words = "the pads' centre, in the mesh's frame and unit"
    add("--grasp", required=True, metavar=form, help=words, **point)
    add("--mass", type=number(1e-9), metavar="KG", help="mass; this or --density")
    add("--density", type=number(1e-9), metavar="KG/M3", help="of the material all through")
    words = "direction in which the hand points at the grasp (default: towards the CoM)"
    add("--axis", metavar=form, help=words, **point)
    words = "normal of the throw's plane: the pads press along it (default: the thinnest way)"
    add("--across", metavar=form, help=words, **point)
    add("--unit", choices=list(UNITS), default="m", help="of the mesh (default: m)")
    words = "capsules of the outline at most (default: 6)"
    add("--parts", type=int, choices=range(1, 13), metavar="N", default=6, help=words)


def run(options: argparse.Namespace) -> int:
    """Turn a mesh into an object: mass, CoM, inertia in the throw's plane, outline as capsules.

    example: throwplan import-object part.stl --unit mm --mass 0.4 --grasp 0 0 60 --out part.toml
    """
    file, out = Path(options.mesh), new_toml_out(options)
    if (options.mass is None) == (options.density is None):
        raise InputError("give --mass or --density")
    beside = out.with_name(f"{out.stem}-mesh.stl")
    if beside.exists() and file.exists() and beside.samefile(file):
        raise InputError(f"--out {out}: its mesh would take the place of {file}: name another")
    if beside.exists() and not options.force:
        raise InputError(f"{beside}: exists already, not overwritten; --force does it")
    axis, across = (v if v is None else tuple(v) for v in (options.axis, options.across))
    choices = MeshChoices(
        tuple(options.grasp),
        options.mass,
        options.density,
        axis,
        across,
        UNITS[options.unit],
        options.parts,
    )
    with Progress(f"{file}: reading"):
        mesh, overlap = read_mesh(file)
        try:
            found = object_from(mesh, choices)
        except InputError as error:
            raise error.within(str(file)) from None
    with filling(out.absolute().parent, (out.name, beside.name)) as folder:
        (folder / beside.name).write_bytes(stl_bytes(found.corners))
        text = object_text(found, file.name, beside.name)
        (folder / out.name).write_text(text, encoding="utf-8")
    facts = _facts(found) | {"overlap": overlap, "mesh": str(beside), "file": str(out)}
    print_result(options, facts, _text(found, overlap, out))
    return DONE


def _facts(found: MeshObject) -> dict[str, object]:
    """The result for --json: lengths in m, the angle in radians."""
    thrown = found.object
    names = ("mass", "com", "inertia", "length", "width", "half_length")
    return {name: getattr(thrown, name) for name in names} | {
        "outline": thrown.capsules.tolist(),
        "beyond": found.beyond,
        "grasp": {"offset": found.grasp.offset, "angle": found.grasp.angle},
        "turns_about_middle_axis": found.middle,
    }


def _text(found: MeshObject, overlap: float, out: Path) -> str:
    thrown, grasp = found.object, found.grasp
    lines = [
        f"mass {thrown.mass:.4g} kg, inertia {thrown.inertia:.4g} kg m^2 in the throw's plane",
        f"CoM {thrown.com - grasp.offset:.4f} m from the grasp; {thrown.length:.3f} m long, "
        f"{grasp.offset:.3f} m of it behind the grasp",
        f"outline of {len(thrown.outline)} capsules, at most {1e3 * found.beyond:.1f} mm beyond "
        "the mesh",
    ]
    if grasp.angle:
        lines.append(
            f"the way from grasp to CoM is {math.degrees(grasp.angle):.1f} deg off the hand's "
            "direction: theta is that of this way"
        )
    if found.middle:
        lines.append(
            "note: it turns about its middle axis of inertia, which is unstable: errors out of the "
            "plane grow in flight"
        )
    if overlap > 1e-6:
        share = f"{100 * overlap:.2g} % of its volume"
        lines.append(f"note: bodies of the mesh overlap by {share}, which counts twice")
    return "\n".join([*lines, f"written to {out}: paste it into a scene"])


#: The functions of the command.
COMMANDS = {"import-object": (arguments, run)}
