"""Plots what integral.sh wrote: python3 plot_integral.py OUT convergence.png (needs matplotlib)."""

import json
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

out, picture = pathlib.Path(sys.argv[1]), sys.argv[2]
volumes = ["engine", "bonsai", "marschner_lobb", "shells"]
functions = ["smooth", "window", "spiky", "peak", "slab"]
figure, axes = plt.subplots(len(functions), len(volumes), figsize=(13, 13), sharex=True)
for row, function in zip(axes, functions):
    for axis, volume in zip(row, volumes):
        rows = json.loads((out / f"{volume}-{function}.json").read_text())["rows"]
        for kind, style in [("sampled", "o--"), ("preintegrated", "s-")]:
            points = [(r["step"], 255 * r["rms_error"]) for r in rows if r["kind"] == kind]
            axis.loglog(*zip(*points), style, label=kind, base=2)
        axis.set_yscale("log", base=10)
        axis.set_title(f"{volume}, {function}", fontsize=9)
        axis.grid(True, which="both", alpha=0.25)
axes[0][0].legend(fontsize=8)
for axis in axes[-1]:
    axis.set_xlabel("step, voxels")
for row in axes:
    row[0].set_ylabel("RMS error, /255")
figure.tight_layout()
figure.savefig(picture, dpi=80)
