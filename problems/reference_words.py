"""What the keys of scene files and arm data files mean, for the reference in docs/.

By section, then by field; a number's unit is the one in the file. Nested tables of an arm's
file have sections of their own.
"""

from __future__ import annotations

#: What is said above a section's table beside the first lines of its docstring.
NOTES = {
    "": "These keys stand before the first section.",
    "object": "Required.",
    "grasp": "Left out: the bar is held at its end, in line with the hand.",
    "contact": "Required.",
    "gripper": "Required. Either `force` and `opening`, or `times` and `forces`, or `table`.",
    "hand": "Exactly one of [hand], [robot] and [motion] is given.",
    "robot": "Exactly one of [hand], [robot] and [motion] is given.",
    "motion": "Exactly one of [hand], [robot] and [motion] is given. One of `acceleration` (with "
    "`angular_acceleration`), `accelerations` (with `times`), `table` and `joints` (with `arm`); "
    "none of them is constant velocity.",
    "target": "Required with [hand] and [robot]; `--target` replaces it. With [motion] it only "
    "gives the height at which the landing is read off.",
    "cup": "Needs `theta_deg` in [target], which says which end goes in.",
    "torque": "Only with [robot], and an arm whose data hold link masses.",
    "uncertainty": "At least one of the keys. Each holds a table with exactly one of `uniform`, "
    "`normal` and `samples`, for example `{ uniform = 0.010, mean = 0.004 }`.",
    "spread": "The table behind a key of [uncertainty].",
    "mesh": "The defaults were chosen by measurement; few scenes need this section.",
    "arm": "The keys before the first section; `arm` in [robot] and [motion] names the file. "
    "Angles are in radians there. Joints count from 1.",
    "dh": "One table per joint in the list `dh`: modified (Craig) Denavit-Hartenberg. Either "
    "`dh` or `joints`.",
    "joints": "One table per joint in the list `joints`: its frame as URDF places it, turned so "
    "that the joint turns about its z axis. Either `dh` or `joints`.",
    "links": "One table per joint and one for the hand, in the list `links`; may be left out.",
    "tool": "From the last joint to the pads, and the hand's body.",
    "limits": "One value per joint in each list.",
    "limits.slowing": "Velocity limits that fall towards the ends of a joint's range, one value "
    "per joint in each list; left out for an arm whose limits are the same everywhere.",
}

WORDS: dict[str, dict[str, str]] = {
    "": {
        "name": "name of the scene; a file's own name where left out",
        "description": "one line for `throwplan scenes`",
        "gravity": "m/s², along −z",
    },
    "object": {
        "mass": "kg",
        "inertia": "kg m², about the CoM; at most mass·(com·(length − com) + width²/4)",
        "length": "m, along the axis",
        "com": "m, from the end nearer the grasp to the CoM; at most `length`",
        "width": "m, across the axis",
    },
    "grasp": {
        "offset": "m, from the end nearer the grasp to the pads; at most `com` of [object]",
        "angle": "degrees, of the bar's axis (grasp towards CoM) against the hand's approach axis",
    },
    "contact": {
        "friction": "μ, of one pad",
        "patch_radius": "m, radius r_p of the pads' patch",
        "torsion": "c: the torsional limit is c·r_p times the tangential one",
        "faces": "pads that rub; `force` is that of one",
        "pressure": "how the models `patch` and `lugre` spread the force over the pad",
    },
    "gripper": {
        "force": "N, of one pad at full grip",
        "dwell": "s, from the command until the force starts to fall",
        "opening": "s, from there to zero, linear",
        "times": "s, from the command: a measured force's times",
        "forces": "N, of one pad at `times`; the last is 0",
        "table": "a CSV file with the columns t and f_N instead of `times` and `forces`",
        "raw": "whether `table` is an unfiltered recording: the nearest falling curve is taken",
    },
    "hand": {
        "x": "m, lowest and highest position",
        "z": "m, lowest and highest position",
        "speed": "m/s, each axis",
        "acceleration": "m/s², each axis",
        "theta": "degrees, lowest and highest; a hand that does not turn keeps the first",
        "angular_speed": "rad/s; left out: the hand does not turn",
        "angular_acceleration": "rad/s²; with `angular_speed`",
        "start": "m, x and z at rest before the throw; left out: free",
        "start_theta": "degrees, at rest; with `start`, for a hand that turns",
    },
    "robot": {
        "arm": "name of a shipped arm, or an arm data file (.toml, seen from the scene's folder)",
        "start": "degrees, the throwing joints at rest before the throw; left out: free, and the "
        "least effort may be a mere drop",
        "throwing_joints": "joints that throw; the arm's own where left out",
        "control": "`jerk`: continuous acceleration; `acceleration`: steps, smoothed afterwards",
        "position_margin": "rad, kept back from both ends of a joint's range",
        "velocity_margin": "share of the limit kept back for smoothing and correction",
        "acceleration_margin": "the same",
        "jerk_margin": "the same",
    },
    "motion": {
        "position": "m, x and z of the hand when the force starts to fall",
        "angle": "degrees, the hand's angle then",
        "velocity": "m/s, x and z then",
        "rate": "rad/s, turning rate then",
        "acceleration": "m/s², x and z, constant",
        "angular_acceleration": "rad/s², constant",
        "times": "s, from when on each row of `accelerations` holds; the first is 0",
        "accelerations": "rows a_x, a_z [m/s²], alpha [rad/s²]",
        "table": "a CSV file with the columns t, x, z, theta (s, m, rad)",
        "joints": "a CSV file with the columns t, q1, q2, ... (s, rad) of `arm`",
        "arm": "as in [robot]; with `joints`",
        "opening_time": "s, time in `table` or `joints` at which the force starts to fall",
        "cutoff": "Hz, low-pass of the samples, without phase shift",
        "samples": "the rows of `table` or `joints`, in the file itself",
    },
    "target": {
        "x": "m, of the CoM; with [robot] in the base frame, else in the throw's plane",
        "z": "m, the CoM comes down through this height",
        "theta": "degrees, from the grasped end to the CoM, full turns count; left out: any",
        "y": "m, base frame; only with [robot]",
    },
    "tolerance": {
        "position": "m, largest error of an accepted landing",
        "angle": "degrees, the same of the angle",
        "model": "release model that the landing must be true for: the sliding pivot or the "
        "time-stepping limit surface",
    },
    "choice": {
        "by": "least of: the NLP's cost; time from rest to landing; what an opening early or "
        "late does to the landing",
        "among": "throws that differ, to look for",
    },
    "cup": {
        "x": "m, centre, in the throw's plane; goes along with another target",
        "rim": "m, height of the rim; goes along with another target",
        "radius": "m, inside; above half the bar's width, the clearance and 1 mm",
        "depth": "m, inside",
        "clearance": "m, from the bar's outline to wall and rim, from when the lower end is in "
        "the rim plane until it is `insertion` below",
        "insertion": "m; at most `depth`",
    },
    "landing": {
        "speed_min": "m/s, of the CoM at landing; below `speed_max`",
        "speed_max": "m/s; left out: no bound",
        "rate_max": "rad/s, turning rate at landing either way; left out: no bound",
    },
    "workspace": {
        "floor": "m, lowest height of hand, arm joints and held bar; left out: none",
        "column_radius": "m, the robot's base, for the bar; with `column_height`",
        "column_height": "m; with `column_radius`",
        "palm_clearance": "m, from the detached bar to the hand's body; only an arm's hand has one",
    },
    "torque": {
        "limits": "N m, one per throwing joint; the arm's own where left out",
        "margin": "share of the limits kept back for smoothing and correction",
    },
    "uncertainty": {
        "delay": "s, the gripper opens that much later than commanded; a known mean sends the "
        "command earlier",
        "opening": "s, duration of the force's fall",
        "friction": "μ",
        "patch_radius": "m",
        "mass": "kg",
        "com_offset": "m, from the pads to the CoM",
        "inertia": "kg m²",
        "grasp_offset": "m, of the pads from the bar's end",
        "grasp_angle": "degrees",
        "hand_x": "m, error of the hand when the force starts to fall",
        "hand_z": "m, the same",
        "hand_theta": "degrees, the same",
        "hand_vx": "m/s, the same",
        "hand_vz": "m/s, the same",
        "hand_omega": "degrees/s, the same",
        "correlation": "rows name, name, coefficient (between −1 and 1) of the normal scores",
    },
    "spread": {
        "uniform": "half width about `mean`",
        "normal": "standard deviation about `mean`; cut off where values become impossible",
        "samples": "measured values",
        "mean": "the scene's value (0 for an error) where left out; not with `samples`",
        "relative": "all numbers are multiples of the scene's value; only for opening, friction, "
        "patch_radius, mass, inertia",
    },
    "robust": {
        "method": "see [how it works](how-it-works.md#a-plan-that-forgives-timing); the last three "
        "are for comparison",
        "early": "s, window before the opening; from [uncertainty] where left out",
        "late": "s, window after detach; from [uncertainty] where left out",
    },
    "mesh": {
        "carry": "intervals from rest to the opening",
        "opening": "intervals of the opening",
        "grading": "above 1 the opening's intervals shrink towards its end",
        "integrator": "of the opening: two-point collocation, or Runge-Kutta with `substeps`",
        "substeps": "steps per interval of `rk4`",
        "epsilon": "relative rounding width of the friction laws",
        "sticking_margin": "share of the full grip's friction limit kept free while carrying",
        "carry_max": "s, longest carry; above the gripper's dwell by 0.05 s",
    },
    "arm": {
        "name": "name of the arm; ROS joint names begin with it",
        "description": "one line",
        "azimuth_joint": "turns the throw's vertical plane",
        "throwing_joints": "move in that plane",
        "posture": "rad, what the other joints keep",
        "tool": "section [tool]",
        "limits": "section [limits]",
    },
    "dh": {"a": "m, before the joint", "d": "m, along it", "alpha": "rad, before the joint"},
    "joints": {
        "xyz": "m, in the frame before it, at angle 0",
        "rpy": "rad, about the fixed x, y and z axes in turn",
    },
    "links": {
        "com": "m, in the joint's frame",
        "inertia": "kg m² about the CoM: xx, xy, xz, yy, yz, zz",
        "mass": "kg",
    },
    "tool": {
        "flange": "m, along the mount's z axis to the flange",
        "rotation": "rad, about it",
        "tcp": "m, from the flange to the pads' centre",
        "palm_back": "m, the hand's body behind the pads' centre: from here",
        "palm_front": "m, to here",
        "palm_half_width": "m, half its thickness in the throwing plane",
        "xyz": "m, the mount in the last joint's frame",
        "rpy": "rad, the same",
    },
    "limits": {
        "position_max": "rad, upper end of the range",
        "position_min": "rad, lower end",
        "velocity": "rad/s",
        "acceleration": "rad/s²",
        "jerk": "rad/s³",
        "torque": "N m",
        "slowing": "section [limits.slowing]",
    },
    "limits.slowing": {
        "offset": "rad/s: the velocity is at most √(2·deceleration·(upper − q)) − offset",
        "upper": "rad, near the upper end of the range",
        "lower": "rad, the same at the lower end",
        "deceleration": "rad/s²",
    },
}
