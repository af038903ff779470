"""Rehearses a plan in the paper's gland, and draws the histogram of its dose beside that of dicompyler-core.

    python dvh_beside_dicompyler.py dvh.png
"""

import pathlib
import sys
import tomllib

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import numpy as np
import stylet
from dicompylercore import dvh as dicompyler

PLAN = tomllib.loads((pathlib.Path(__file__).parents[3] / "docs/study/paper-plan.toml").read_text())
PRESCRIPTION_GY = PLAN["prescription_gy"]
SEED_MM = 4.5
BIN_GY = 0.5


def implant(scene: stylet.Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rehearses each needle of the plan; returns its seeds at rest, their axes, strengths and planned places."""
    stage = stylet.Stage(scene, linear=True)
    seeds_mm, axes, strengths_u, planned_mm = [], [], [], []
    for needle in PLAN["needle"]:
        pitch_mm = SEED_MM + needle["spacer_mm"] if "spacer_mm" in needle else None
        done = stage.rehearse(
            needle["entry_mm"], needle["direction"], needle["seed_along_mm"], strand_pitch_mm=pitch_mm
        )
        seeds_mm.append(done.seeds_mm)
        axes.append(done.axes)
        planned_mm.append(done.planned_mm)
        strengths_u.append(needle["strength_u"])
    return tuple(np.concatenate(rows) for rows in (seeds_mm, axes, strengths_u, planned_mm))


def histograms(
    scene: stylet.Scene, seeds_mm: np.ndarray, axes: np.ndarray, strengths_u: np.ndarray
) -> tuple[stylet.Dvh, dicompyler.DVH]:
    """Returns the histogram of the target by both, of the same points."""
    points_mm, volumes_cc = scene.points(pitch_mm=1.0)
    dose_gy = stylet.Source("6711").dose(points_mm, seeds_mm, strengths_u, axes)
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
    seeds_mm, axes, strengths_u, planned_mm = implant(scene)
    errors_mm = np.linalg.norm(seeds_mm - planned_mm, axis=1)
    print(f"{len(seeds_mm)} seeds, on average {errors_mm.mean():.1f} mm from the plan")
    ours, theirs = histograms(scene, seeds_mm, axes, strengths_u)
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
