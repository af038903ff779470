"""Computes the dose of a rehearsed needle in the paper's gland, and its histogram beside that of dicompyler-core.

    python dvh_beside_dicompyler.py dvh.png
"""

import sys

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import numpy as np
import stylet
from dicompylercore import dvh as dicompyler

PRESCRIPTION_GY = 145.0
STRENGTH_U = 0.6
# Two rows of holes on either side of the urethra, 86.4 mm deep; seeds from the entry.
HOLES_MM = [(x, y, 86.401) for x in (57.979, 67.979, 77.979, 87.979) for y in (34.715, 44.715, 54.715)]
SEEDS_MM = [45.0, 35.0, 25.0, 15.0]
BIN_GY = 0.5


def implant(scene: stylet.Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns the seeds at rest, their axes, and where they were planned."""
    stage = stylet.Stage(scene, linear=True)
    done = [stage.rehearse(hole, (0, 0, 1), SEEDS_MM) for hole in HOLES_MM]
    return tuple(np.concatenate([getattr(one, name) for one in done]) for name in ("seeds_mm", "axes", "planned_mm"))


def histograms(scene: stylet.Scene, seeds_mm: np.ndarray, axes: np.ndarray) -> tuple[stylet.Dvh, dicompyler.DVH]:
    """Returns the histogram of the target by both, of the same points."""
    points_mm, volumes_cc = scene.points(pitch_mm=1.0)
    dose_gy = stylet.Source("6711").dose(points_mm, seeds_mm, STRENGTH_U, axes)
    # dicompyler counts points; those on the edge stand for a part of a cube.
    edges = np.arange(0.0, dose_gy.max() + BIN_GY, BIN_GY)
    counts, _ = np.histogram(dose_gy, edges, weights=volumes_cc)
    theirs = dicompyler.DVH(counts, edges, dvh_type="differential", dose_units="Gy", volume_units="cm3")
    theirs.rx_dose = PRESCRIPTION_GY
    return stylet.Dvh(dose_gy, volumes_cc), theirs.cumulative


def figures(ours: stylet.Dvh, theirs: dicompyler.DVH) -> dict[str, tuple[float, float]]:
    """Returns the metrics by both: Gy and % of the volume."""
    both = {"D90": theirs.D90.value, "Dmean": theirs.mean}
    for share in (100, 150, 200):
        cc = theirs.volume_constraint(PRESCRIPTION_GY * share / 100, "Gy").value
        both[f"V{share}"] = 100 * cc / theirs.volume
    return {name: (ours.metric(name, PRESCRIPTION_GY), value) for name, value in both.items()}


def main(path: str) -> None:
    scene = stylet.Scene("paper")
    seeds_mm, axes, planned_mm = implant(scene)
    errors_mm = np.linalg.norm(seeds_mm - planned_mm, axis=1)
    print(f"{len(seeds_mm)} seeds, on average {errors_mm.mean():.1f} mm from the plan")
    ours, theirs = histograms(scene, seeds_mm, axes)
    for name, (mine, other) in figures(ours, theirs).items():
        print(f"{name:6} {mine:8.2f} {other:8.2f}")
    doses = np.linspace(0.0, 3.0 * PRESCRIPTION_GY, 400)
    figure, plot = plt.subplots(figsize=(7, 4), layout="constrained")
    plot.plot(doses, 100 * ours.at_least_cc(doses) / ours.volume_cc, label="stylet")
    plot.plot(theirs.bincenters, 100 * theirs.counts / theirs.volume, "--", label="dicompyler-core")
    plot.axvline(PRESCRIPTION_GY, color="0.7", linewidth=0.8)
    plot.set(xlim=(0, doses[-1]), ylim=(0, 101), xlabel="dose, Gy", ylabel="volume of the gland, %")
    plot.legend(frameon=False)
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main(sys.argv[1])
