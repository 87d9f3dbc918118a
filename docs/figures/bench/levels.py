"""Levels of detail: pixel error against full resolution, and the two volumes of LaMar, Hamann & Joy (1999), Tables 1 and 2.

    python3 levels.py BRICKCAST DATA OUT [paper|moving]    (needs numpy and pillow; with matplotlib it plots OUT/levels.png)

BRICKCAST is a release build, DATA a folder with engine.nrrd, bonsai.nrrd and walnut_u16.nrrd, OUT one for stores and pictures.
Prints the tables of docs/figures/benchmarks.md. Times are medians of five frames of bricks that are there, in processes of
their own; differences of 8 bits, the largest channel of a pixel on black. With a fourth word, `paper`, of the paper's volumes
alone; and with `moving` of sequences.
"""

import json
import pathlib
import resource
import statistics
import subprocess
import sys
import time

import numpy as np
from PIL import Image

brickcast, data, out = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3]).resolve()
only = sys.argv[4] if len(sys.argv) > 4 else ""
out.mkdir(parents=True, exist_ok=True)
RUNS = 5
ERRORS = ["0.5", "1", "2", "4"]
VIEWS = {"fitted": [], "near": ["--azimuth", "30", "--elevation", "20", "--zoom", "2.5"]}


def run(*words):
    done = subprocess.run([brickcast, *words], cwd=out, capture_output=True, text=True)
    if done.returncode not in (0, 4):
        sys.exit(f"{' '.join(words)}: {done.returncode}\n{done.stderr}")


def store(name, source, brick):
    if not (out / name).is_dir():
        run("prepare", str(source), name, "--brick", brick)
    return name


def phantom(name, dims, brick):
    source = out / f"{name}.nrrd"
    if not source.is_file():
        run("phantom", source.name, "--dims", dims)
    return store(name, source.name, brick)


def drawn(name, size, flags):
    """Bricks by level, share of bytes, loading and frame in ms, processor time of all in ms, samples, and the picture."""
    frames, loads, used = [], [], []
    for _ in range(RUNS):
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        run("render", name, "-o", "a.png", "--size", size, "--background", "0,0,0", "--backend", "cpu", "--exact",
            "--stats", "s.json", *flags)
        used.append(1e3 * (resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before))
        stats = json.loads((out / "s.json").read_text())
        frames.append(stats["frame_ms"])
        loads.append(stats["load_ms"])
    lod = stats.get("lod") or {"bricks": [stats["shown_bricks"]], "share_of_bytes": 1.0}
    picture = np.asarray(Image.open(out / "a.png").convert("RGB")).astype(int)
    median = statistics.median
    return lod["bricks"], lod["share_of_bytes"], median(loads), median(frames), median(used), stats["samples"], picture


def difference(a, b):
    worst = np.abs(a - b).max(2) / 255
    return worst.mean(), np.percentile(worst, 99)


def row(first, of, full, with_processor=False):
    bricks, share, load, frame, used, samples, picture = of
    mean, p99 = difference(picture, full[-1])
    told = ", ".join(map(str, bricks))
    error = "" if of is full else "none" if mean == 0 else f"{mean:.4f}, {p99:.3f}"
    times = f"{load:.0f} | {frame:.1f}" + (f" | {used:.0f}" if with_processor else "")
    print(f"| {first} | {told} | {100 * share:.0f} % | {times} | {samples / 1e6:.2f} | {error} |", flush=True)
    return mean, p99, share, frame


def moving(name, size, flags):
    """Of a short orbit: the median frame in ms, and processor seconds and wall seconds of a frame, loading left out."""
    used = []
    for frames in ["2", "42"]:
        before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        run("render", name, "-o", "a.png", "--size", size, "--backend", "cpu", "--stats", "s.json", "--frames", frames,
            "--orbit", "20", *flags)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used.append((after.ru_utime - before.ru_utime, time.monotonic() - started))
    frames = json.loads((out / "s.json").read_text())["frames"]
    (cpu, wall) = ((b - a) / 40 for a, b in zip(*used))
    return statistics.median(frame["frame_ms"] for frame in frames), cpu, wall


if only == "moving":
    phantom("phantom", "256,256,256", "32")
    print("| flags | frame, ms | processor, ms a frame | wall, ms a frame |")
    print("| --- | --- | --- | --- |")
    for flags in ["--lod full", "--lod auto --pixel-error 2 --zoom 2", "--lod auto --pixel-error 4 --zoom 2", "--lod 1"]:
        ms, cpu, wall = moving("phantom", "256", flags.split())
        print(f"| `{flags}` | {ms:.1f} | {1e3 * cpu:.1f} | {1e3 * wall:.1f} |", flush=True)
    sys.exit()

volumes = {}
if only != "paper":
    volumes = {name: store(name, data / f"{name}.nrrd", "32") for name in ["engine", "bonsai", "walnut_u16"]}
    volumes["phantom"] = phantom("phantom", "256,256,256", "32")
curves = {}
for view, camera in VIEWS.items() if volumes else []:
    print(f"\nView: {view}.\n")
    print("| volume, `--pixel-error` | bricks by level | bytes | loading, ms | frame, ms | samples, M | difference: mean, 99 % |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name in volumes:
        full = drawn(name, "256", camera)
        row(f"{name}, full", full, full)
        for error in ERRORS:
            of = drawn(name, "256", [*camera, "--lod", "auto", "--pixel-error", error])
            curves.setdefault((name, view), []).append((float(error), *row(f"{name}, {error}", of, full), full[3]))

# A faint constant opacity over all values: no brick is left out, and no ray ends early. The default look shows material alone.
(out / "all.json").write_text(json.dumps([{
    "Name": "all", "ColorSpace": "RGB", "RGBPoints": [0, 0.1, 0.2, 0.9, 20000, 0.2, 0.9, 0.3, 45000, 0.95, 0.3, 0.1],
    "Points": [0, 0.001, 0.5, 0, 45000, 0.001, 0.5, 0],
}]))
LOOKS = {"all of it shows": ["--transfer-function", "all.json"], "material": []}
print("\nThe paper's volumes.\n")
print("| volume, tiles, look, criterion | bricks by level | bytes | loading, ms | frame, ms | processor, ms | samples, M |"
      " difference: mean, 99 % |")
print("| --- | --- | --- | --- | --- | --- | --- | --- |")
for dims, brick in [("108,108,126", "16"), ("500,500,768", "64")]:
    name = phantom(f"paper-{brick}", dims, brick)
    views = {"outside": [], "inside": ["--zoom", "6"]}
    for look, where in [(look, where) for look in LOOKS for where in views if look == "material" or where == "outside"]:
        camera = [*views[where], *LOOKS[look]]
        full = drawn(name, "500", [*camera, "--lod", "auto", "--lod-criterion", "cone"])
        row(f"{dims}, {brick}, {where}, {look}: cone", full, full, True)
        row("fov", drawn(name, "500", [*camera, "--lod", "auto", "--lod-criterion", "fov"]), full, True)
        for error in ["1", "2"]:
            row(f"error {error}", drawn(name, "500", [*camera, "--lod", "auto", "--pixel-error", error]), full, True)

try:
    import matplotlib
except ImportError:
    sys.exit()
if not volumes:
    sys.exit()
matplotlib.use("Agg")
import matplotlib.pyplot as plt

figure, axes = plt.subplots(2, 2, figsize=(10, 7), sharex=True)
for column, view in enumerate(VIEWS):
    for name in volumes:
        errors, mean, p99, share, frame, full = zip(*curves[name, view])
        line = axes[0][column].plot(errors, [255 * m for m in mean], "o-", label=name)
        axes[0][column].plot(errors, [255 * p for p in p99], "o:", color=line[0].get_color())
        axes[1][column].plot(errors, share, "o-", color=line[0].get_color())
        axes[1][column].plot(errors, [a / b for a, b in zip(frame, full)], "s:", color=line[0].get_color())
    axes[0][column].set_title(f"{view} view")
    axes[1][column].set_xlabel("--pixel-error")
    axes[1][column].set_xscale("log", base=2)
axes[0][0].set_ylabel("difference, of 255: mean (solid), 99 % (dotted)")
axes[1][0].set_ylabel("share of full: bytes (solid), time (dotted)")
axes[0][0].legend()
figure.tight_layout()
figure.savefig(out / "levels.png", dpi=80)
