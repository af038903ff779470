"""Draws force against depth for the three tissue models: a needle into the paper's gland and out again.

    python force_by_tissue.py force.png
"""

import sys

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import stylet

ENTRY_MM = (72.979, 44.715, 86.401)
DEPTH_MM, SPEED_MM_PER_S = 45.0, 20.0
NAMES = {"chainmail": "ChainMail", "fem": "finite elements", "paper": "as the paper prints it"}


def traces(scene: stylet.Scene):
    """Yields each tissue's name with its traces in and out."""
    for tissue in stylet.tissues():
        # Newtons of the tissue, not of the device, which gives 0.9 of them. Forces are the same in linear tissue.
        needle = stylet.Insertion(scene, ENTRY_MM, tissue=tissue, parameters={"force.scale": 1.0}, linear=True)
        yield tissue, needle.move(DEPTH_MM, SPEED_MM_PER_S), needle.move(0.0, SPEED_MM_PER_S)


def main(path: str) -> None:
    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    for number, (tissue, inwards, outwards) in enumerate(traces(stylet.Scene("paper"))):
        # The first lies under the second: both slip by force.
        style = {"color": f"C{number}", "linewidth": 4 if number == 0 else 1.5}
        axes.plot(inwards["depth_mm"], inwards["resistance_n"], label=NAMES[tissue], **style)
        axes.plot(outwards["depth_mm"], outwards["resistance_n"], linestyle=":", **style)
        print(f"{tissue:10} at most {inwards['resistance_n'].max():.2f} N inwards")
    axes.axhline(0.0, color="0.7", linewidth=0.8, zorder=0)
    axes.set(xlabel="depth from the entry, mm", ylabel="force against the needle, N")
    axes.set_title("Into the gland (full) and out (dotted) at 20 mm/s")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main(sys.argv[1])
