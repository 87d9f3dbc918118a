#!/usr/bin/env python3
"""What a view of somebody else's OME-Zarr costs beside a copy: bytes, preparing, and whole renders, medians.

    python3 docs/figures/bench/views.py BRICKCAST OUT [EDGE]

BRICKCAST and OUT are absolute; OUT is made anew. Wants numpy and zarr >= 3.
"""

import os
import pathlib
import shutil
import statistics
import subprocess
import sys
import time

import numpy as np
import zarr
from numcodecs import Blosc

brickcast, out = sys.argv[1], pathlib.Path(sys.argv[2])
edge = int(sys.argv[3]) if len(sys.argv) > 3 else 256
ROUNDS = 5

shutil.rmtree(out, ignore_errors=True)
out.mkdir(parents=True)
os.chdir(out)


def run(*words):
    started = time.perf_counter()
    subprocess.run([brickcast, *words, "--quiet"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.perf_counter() - started


def size(folder):
    return sum(f.stat().st_size for f in pathlib.Path(folder).rglob("*") if f.is_file())


run("phantom", "v.nrrd", "--dims", f"{edge},{edge},{edge}")
data = (out / "v.nrrd").read_bytes()
start = data.index(b"\n\n") + 2
voxels = np.frombuffer(data[start:], dtype="<u2").reshape(edge, edge, edge)
made = []
for chunk in (32, 64, 128):
    name = f"chunks-{chunk}.zarr"
    group = zarr.open_group(name, mode="w", zarr_format=2)
    codec = Blosc(cname="zstd", clevel=3, shuffle=Blosc.SHUFFLE)
    array = group.create_array("0", shape=voxels.shape, chunks=(chunk,) * 3, dtype="<u2", compressors=codec)
    array[:] = voxels
    scale = [{"type": "scale", "scale": [1.0, 1.0, 1.0]}]
    axes = [{"name": n, "type": "space"} for n in "zyx"]
    datasets = [{"path": "0", "coordinateTransformations": scale}]
    group.attrs["multiscales"] = [{"version": "0.4", "axes": axes, "datasets": datasets}]
    made.append((f"view, chunks of {chunk}", name, f"view-{chunk}", ["--in-place"]))
made.insert(0, ("store", "chunks-64.zarr", "store", []))

print("| | prepared in | on disk | of the array | whole render, 512 x 512 | beside the store |")
print("| --- | --- | --- | --- | --- | --- |")
seconds = {name: run("prepare", scan, name, *how) for _, scan, name, how in made}
times = {name: [] for _, _, name, _ in made}
for _ in range(ROUNDS):
    for name, of in times.items():
        of.append(run("render", name, "-o", "o.png", "--size", "512x512", "--backend", "cpu", "--no-manifest"))
base = statistics.median(times["store"])
for label, scan, name, _ in made:
    median, share = statistics.median(times[name]), size(name) / size(scan)
    print(f"| {label} | {seconds[name]:.1f} s | {size(name) / 2**20:.0f} MiB | {share:.2f} | {median:.2f} s | {median / base:.2f} |")
