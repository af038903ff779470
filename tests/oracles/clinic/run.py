"""Compares what Stylet reads with what other programs read, on 265 generated objects and 4 studies that it writes; fails above the bars.

    python run.py HOST-UI FOLDER [KIND ...]     KIND: images, structures, doses, plans, labels, histograms, segmentations, compressed
"""
import importlib
import pathlib
import shutil
import sys

import numpy as np

from common import Stylet

SEED = 45
KINDS = ["images", "structures", "doses", "plans", "labels", "histograms", "segmentations", "compressed"]


def main():
    stylet, root = Stylet(str(pathlib.Path(sys.argv[1]).resolve())), pathlib.Path(sys.argv[2]).resolve()
    objects = []
    for kind in sys.argv[3:] or KINDS:
        folder = root / kind
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        # Each kind has its own numbers, so that one can be run alone.
        rng = np.random.default_rng([SEED, KINDS.index(kind)])
        for found in importlib.import_module(kind).run(stylet, rng, folder):
            objects.append(found)
            for why in found.failures:
                print(f"DIFFERS {found.name} ({found.variant}): {why}", flush=True)
    table(objects)
    refusals(objects)
    sys.exit(any(found.failures for found in objects))


def table(objects):
    print("\n| kind | objects | agree | refused with a reason | differ | largest deviation of those that agree, and its bar |")
    print("|---|---|---|---|---|---|")
    for kind in dict.fromkeys(found.kind for found in objects):
        of_kind = [found for found in objects if found.kind == kind]
        refused = sum(bool(found.refused) and not found.failures for found in of_kind)
        differ = sum(bool(found.failures) for found in of_kind)
        largest = {}
        for found in of_kind:
            if found.failures:
                continue
            for measure, (deviation, bar) in found.largest.items():
                largest[measure] = (max(deviation, largest.get(measure, (0,))[0]), bar)
        shown = "; ".join(f"{measure} {deviation:.2g} ({bar:g})" for measure, (deviation, bar) in largest.items())
        print(f"| {kind} | {len(of_kind)} | {len(of_kind) - refused - differ} | {refused} | {differ} | {shown} |")
    print(f"\n{len(objects)} objects")


def refusals(objects):
    print("\n| kind | refused | with |\n|---|---|---|")
    for found in objects:
        if found.refused:
            shown = " ".join(found.refused.replace("|", "/").split())
            print(f"| {found.kind} | {found.variant} | {shown} |")


main()
