"""Dose against the definitions, and against other programs."""

import csv

import numpy as np
import pytest
import stylet
from conftest import ROOT

WATER_MM = np.array([[0.0, 0.0, 0.0]])


def test_the_dose_is_that_of_the_definitions():
    """tests/dose/data/tg43_reference.py: numerical integrals, no code of ours."""
    sources = {"i125_6711": stylet.Source("6711"), "pd103_200": None}
    with open(ROOT / "tests/dose/data/tg43_reference.csv") as file:
        rows = list(csv.DictReader(file))
    sources["pd103_200"] = stylet.Source.parse((ROOT / "sources/pd103_200.toml").read_text())
    worst = 0.0
    for row in rows:
        r_mm, theta = 10 * float(row["r_cm"]), np.radians(float(row["theta_deg"]))
        point = [[r_mm * np.sin(theta), 0.0, r_mm * np.cos(theta)]]
        source = sources[row["source"]]
        one = source.dose(point, WATER_MM, 1.0)[0] / float(row["dose_1d_gy_per_u"])
        two = source.dose(point, WATER_MM, 1.0, [[0.0, 0.0, 1.0]])[0] / float(row["dose_2d_gy_per_u"])
        worst = max(worst, abs(one - 1), abs(two - 1))
    assert len(rows) > 800
    assert worst < 2e-3, worst


def test_points_grid_and_rate_agree():
    source = stylet.Source("6711")
    seeds, axes = [[0.0, 0.0, 0.0], [7.0, 1.0, -3.0]], [[0.0, 0.0, 1.0], [0.0, 1.0, 1.0]]
    grid = source.dose_grid((-20.0, -15.0, -10.0), (2.0, 3.0, 5.0), (21, 11, 5), seeds, [0.5, 0.7], axes)
    assert grid.shape == (21, 11, 5) and grid.flags.f_contiguous
    i, j, k = np.indices(grid.shape)
    points = np.stack([-20.0 + 2.0 * i, -15.0 + 3.0 * j, -10.0 + 5.0 * k], axis=-1).reshape(-1, 3)
    dose = source.dose(points, seeds, [0.5, 0.7], axes).reshape(grid.shape)
    assert np.abs(dose / grid - 1).max() < 1e-4
    # The mean life times the rate.
    hours = source.half_life_days * 24 / np.log(2)
    at_1_cm = source.dose([[10.0, 0.0, 0.0]], WATER_MM, 1.0, [[0.0, 0.0, 1.0]])[0]
    rate = source.dose_rate(10.0, 0.0)[0]
    assert rate == pytest.approx(source.dose_rate_constant, rel=1e-9)
    assert at_1_cm == pytest.approx(rate / 100 * hours, rel=2e-4)
    halves = [source.dose([[10.0, 0.0, 0.0]], WATER_MM, 1.0, days=days)[0] for days in ((0, 59.4), (59.4, 118.8))]
    assert halves[0] == pytest.approx(2 * halves[1], rel=1e-6)


def test_shapes_that_do_not_fit_are_refused():
    source = stylet.Source("6711")
    with pytest.raises(ValueError, match=r"points_mm.*\(N, 3\)"):
        source.dose([[1.0, 2.0]], WATER_MM, 1.0)
    with pytest.raises(ValueError, match="strength_u"):
        source.dose(WATER_MM, WATER_MM, [1.0, 2.0])
    with pytest.raises(ValueError, match="2 axes for 1 seeds"):
        source.dose(WATER_MM, WATER_MM, 1.0, [[0, 0, 1], [0, 0, 1]])
    with pytest.raises(ValueError, match="6711"):
        stylet.Source("nothing")
    with pytest.raises(ValueError, match="not a metric"):
        stylet.Dvh([1.0, 2.0], 1.0).metric("X90", 145.0)
    with pytest.raises(ValueError, match="no volume"):
        stylet.Dvh([], 1.0)


def test_a_histogram_of_a_ramp_is_a_line():
    dose = np.linspace(0.0, 100.0, 10_001)
    dvh = stylet.Dvh(dose, 1e-3)
    assert dvh.metric("D90", 100.0) == pytest.approx(10.0, abs=0.02)
    assert dvh.metric("V50", 100.0) == pytest.approx(50.0, abs=0.02)
    assert dvh.mean_gy == pytest.approx(50.0)
    cc = dvh.at_least_cc(dose)
    assert np.allclose(cc, dvh.volume_cc * (1 - dose / 100.0), atol=1e-3)


def test_gamma_is_that_of_pymedphys():
    import pymedphys

    # Where a line is exact: the search is compared, not the interpolation, which is cubic here and linear there.
    grid = dict(origin_mm=(-15.0, -15.0, -10.0), spacing_mm=(1.5, 1.5, 2.5), shape=(21, 21, 9))
    edges = tuple(o + s * np.arange(n) for o, s, n in zip(*grid.values()))
    x, y, z = np.meshgrid(*edges, indexing="ij")
    first = 100.0 + 2.0 * x + 1.5 * y - 1.0 * z
    other = 103.0 + 2.3 * x + 1.4 * y - 1.3 * z
    ours = stylet.gamma(first, other, grid["spacing_mm"], origin_mm=grid["origin_mm"], of_gy=145.0, least_gy=29.0)
    theirs = pymedphys.gamma(
        edges, first, edges, other, 3, 3, lower_percent_dose_cutoff=20, global_normalisation=145.0, max_gamma=2,
        interp_fraction=20,
    )
    both = ~np.isnan(ours) & ~np.isnan(theirs)
    assert both.sum() > 300
    off = np.abs(ours - theirs)[both]
    print(f"\ngamma in {both.sum()} voxels: differences mean {off.mean():.4f}, largest {off.max():.3f}")
    assert off.mean() < 0.01 and off.max() < 0.05
    same = stylet.gamma(first, first, grid["spacing_mm"])
    assert np.nanmax(same) < 1e-9
