#!/usr/bin/env python3
"""What a view of somebody's OME-Zarr costs beside a copy of it, in one run:

    python3 docs/figures/bench/views.py BRICKCAST FOLDER [EDGE [RUNS]]

A phantom of EDGE^3 voxels of u16 (256) is written as Zarr v2 by zarr-python, chunks of 32, 64 and 128 of blosc's zstd,
and prepared twice: as a store of its own and in place. Then each is rendered whole, by turns, RUNS times (5). Prints a
table; medians, bytes of the store and of what a render reads of both. FOLDER is made, and removed again.
"""

import json
import pathlib
import shutil
import statistics
import subprocess
import sys
import time

import numpy as np
import zarr
import numcodecs


def run(*args, cwd):
    started = time.monotonic()
    subprocess.run([str(a) for a in args], cwd=cwd, check=True, capture_output=True)
    return time.monotonic() - started


def size(path):
    return sum(f.stat().st_size for f in path.rglob("*") if f.is_file())


def write(path, voxels, chunk):
    group = zarr.create_group(store=str(path), zarr_format=2, overwrite=True)
    array = group.create_array(
        "0",
        shape=voxels.shape,
        chunks=(chunk,) * 3,
        dtype=voxels.dtype,
        compressors=numcodecs.Blosc(cname="zstd", clevel=3, shuffle=numcodecs.Blosc.BITSHUFFLE),
    )
    array[:] = voxels
    axes = [{"name": n, "type": "space"} for n in "zyx"]
    scale = [{"type": "scale", "scale": [1.0, 1.0, 1.0]}]
    group.attrs["multiscales"] = [
        {"version": "0.4", "axes": axes, "datasets": [{"path": "0", "coordinateTransformations": scale}]}
    ]


def main():
    brickcast, folder = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
    edge, runs = (int(n) for n in (sys.argv[3:] + ["256", "5"][len(sys.argv) - 3 :])[:2])
    folder.mkdir()
    try:
        dims = f"{edge},{edge},{edge}"
        run(brickcast, "phantom", "v.nrrd", "--dims", dims, "--pores", "100", cwd=folder)
        data = (folder / "v.nrrd").read_bytes()
        voxels = np.frombuffer(data[data.index(b"\n\n") + 2 :], "<u2").reshape((edge,) * 3)
        print("| chunks | | made in, s | bytes of the volume's | render, s | median of its frame, ms |")
        print("| --- | --- | --- | --- | --- | --- |")
        for chunk in (32, 64, 128):
            write(folder / "in.zarr", voxels, chunk)
            stores = {"copy": [], "view": ["--in-place"]}
            made = {}
            for name, flags in stores.items():
                made[name] = run(brickcast, "prepare", "in.zarr", name, *flags, cwd=folder)
            whole, frame = {n: [] for n in stores}, {n: [] for n in stores}
            for _ in range(runs):
                for name in stores:
                    args = ["render", name, "-o", "o.png", "--size", "512x512", "--stats", "s.json", "--backend", "cpu"]
                    whole[name].append(run(brickcast, *args, cwd=folder))
                    frame[name].append(json.loads((folder / "s.json").read_text())["frame_ms"])
            for name in stores:
                share = size(folder / name) / voxels.nbytes
                took, ms = statistics.median(whole[name]), statistics.median(frame[name])
                print(f"| {chunk} | {name} | {made[name]:.2f} | {100 * share:.1f} % | {took:.2f} | {ms:.0f} |")
            for name in ("in.zarr", *stores):
                shutil.rmtree(folder / name)
    finally:
        shutil.rmtree(folder)


main()
