"""Jerk as the control against acceleration steps that Ruckig smooths afterwards.

    .venv/bin/python examples/control.py

Prints, per Panda scene: status, error of what is sent, and how far smoothing moved the
landing (sent against exact), with iterations and solve time of the same run.
"""

import dataclasses
import math

import throwplan as tp


def main() -> None:
    """Print the table."""
    print("| scene | control | status | sent error | moved by smoothing | iterations | solve |")
    print("|---|---|---|---|---|---|---|")
    for name in ("pose", "cup", "box", "flip"):
        scene = tp.load_scene(name)
        for control in ("jerk", "acceleration"):
            robot = dataclasses.replace(scene.robot, control=control)
            planner = tp.Planner(scene.replace(robot=robot))
            result = planner.plan().to_dict()
            sent, exact = result["landing"]["sent"], result["landing"]["exact"]
            error = result["error"][result["decides"]]
            moved = (
                1e3 * abs(sent["x"] - exact["x"]),
                math.degrees(sent["theta"] - exact["theta"]),
            )
            cells = [
                name,
                control,
                result["status"],
                f"{1e3 * error['position']:.3f} mm, {math.degrees(error['angle']):.3f}°",
                f"{moved[0]:.3f} mm, {abs(moved[1]):.3f}°",
                str(result["solver"]["iterations"]),
                f"{1e3 * result['time']['solve']:.0f} ms",
            ]
            print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
