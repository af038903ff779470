"""Stylet: a needle in soft tissue, and the dose of the seeds that it leaves there, without a device and without a
clock.

The programs of Stylet and this package run the same code: the same input gives the same bits. Lengths in mm, forces in
N, times in s, doses in Gy, strengths in U; places in the frame of the scene. Not a medical device.

A needle, step by step::

    import stylet
    scene = stylet.Scene("paper")                              # or of_labels(array, ...), or read("gland.nii.gz")
    needle = stylet.Insertion(scene, (72.979, 44.715, 86.401), parameters={"force.scale": 1.0})
    trace = needle.move(45.0, speed_mm_per_s=20.0)             # arrays: depth_mm, resistance_n, force_n, ...
    needle.drop_seed()
    needle.move(0.0)
    positions_mm, axes = needle.seeds()                        # where the seed rests

A whole needle, by the script of the programs, with their simulated hand::

    done = stylet.Stage(scene).rehearse((72.979, 44.715, 86.401), (0, 0, 1), seeds_mm=[45.0, 35.0, 25.0])
    done.seeds_mm - done.planned_mm                            # errors of the seeds

Its dose::

    points_mm, volumes_cc = scene.points()                     # the target
    dose_gy = stylet.Source("6711").dose(points_mm, done.seeds_mm, strength_u=0.6, axes=done.axes)
    stylet.Dvh(dose_gy, volumes_cc).metric("D90", prescription_gy=145.0)

`parameters()` lists what can be set, `scenes()`, `tissues()` and `sources()` the names. `study()` runs a population
study. `stylet.env` has an environment for reinforcement learning (Gymnasium). ``help(stylet.Insertion)`` explains each
step.
"""

from . import _stylet
from ._stylet import *  # noqa: F403
from ._stylet import __version__ as __version__

__all__ = _stylet.__all__
