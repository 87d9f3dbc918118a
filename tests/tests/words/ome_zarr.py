"""Writes one volume as OME-Zarr in every way that is read, each with the same voxels as NRRD beside it.

Argument: a folder. Prints a line of JSON: for each image its folder, its NRRD, and which channel and time of it that is.
"""

import json
import pathlib
import sys

import numcodecs
import numpy
import zarr
from zarr.codecs import BloscCodec, BytesCodec, Crc32cCodec, GzipCodec, ShardingCodec, TransposeCodec, ZstdCodec

folder = pathlib.Path(sys.argv[1])
# Odd on every axis, and over the faces of chunks.
SHAPE = (37, 45, 70)
CHUNKS = (16, 20, 32)
SPACING = {"z": 2.0, "y": 0.25, "x": 0.5}
ORIGIN = {"z": -3.0, "y": 1.5, "x": 10.0}
NRRD_TYPES = {"u1": "uint8", "i1": "int8", "u2": "uint16", "i2": "int16", "u4": "uint32", "i4": "int32", "f4": "float"}
told = []


def voxels(kind):
    """Something smooth with noise, that fills the type, as z, y, x."""
    z, y, x = numpy.meshgrid(*[numpy.arange(n, dtype="f8") for n in SHAPE], indexing="ij")
    wave = numpy.sin(x / 9) * numpy.cos(y / 7 + z / 5) + numpy.random.default_rng(7).normal(0, 0.02, SHAPE)
    wave = (wave - wave.min()) / (wave.max() - wave.min())
    if kind == "f4":
        return (wave * 3 - 1).astype("<f4")
    info = numpy.iinfo(numpy.dtype("<" + kind))
    return (info.min + wave * (float(info.max) - float(info.min))).astype("f8").clip(info.min, info.max).astype("<" + kind)


def nrrd(name, data, origin=ORIGIN, unit="micrometer"):
    """`data` as z, y, x."""
    kind = data.dtype.str[1:]
    depth, height, width = data.shape
    header = (
        f"NRRD0005\ntype: {NRRD_TYPES[kind]}\ndimension: 3\nspace dimension: 3\nsizes: {width} {height} {depth}\n"
        f"space directions: ({SPACING['x']},0,0) (0,{SPACING['y']},0) (0,0,{SPACING['z']})\n"
        f"space origin: ({origin['x']},{origin['y']},{origin['z']})\n"
        f'space units: "{unit}" "{unit}" "{unit}"\nendian: little\nencoding: raw\n\n'
    )
    data = numpy.ascontiguousarray(data.astype("<" + kind))
    (folder / f"{name}.nrrd").write_bytes(header.encode() + data.tobytes())


def image(group, axes, version):
    """The metadata of an image whose one level is the array `0`."""
    kinds = {"t": "time", "c": "channel"}
    described = [{"name": a, "type": kinds.get(a, "space")} for a in axes]
    for axis in described:
        if axis["type"] == "space":
            axis["unit"] = "micrometer"
    # What all levels share is a scale of its own, as some write it.
    half = [SPACING.get(a, 1.0) / 2 for a in axes]
    datasets = [
        {
            "path": "0",
            "coordinateTransformations": [
                {"type": "scale", "scale": half},
                {"type": "translation", "translation": [ORIGIN.get(a, 0.0) / 2 for a in axes]},
            ],
        }
    ]
    all_levels = [{"type": "scale", "scale": [2.0 for _ in axes]}]
    multiscale = {"axes": described, "datasets": datasets, "coordinateTransformations": all_levels, "name": "image"}
    if version == 2:
        group.attrs["multiscales"] = [{"version": "0.4", **multiscale}]
    else:
        group.attrs["ome"] = {"version": "0.5", "multiscales": [multiscale]}


def write(name, data, version, axes="zyx", chunks=CHUNKS, below="", tell=None, expected=None, **how):
    """An image of `data` in the order of `axes`."""
    path = folder / f"{name}.zarr"
    root = zarr.open_group(path, mode="a", zarr_format=version)
    group = root.require_group(below) if below else root
    image(group, axes, version)
    array = group.create_array("0", shape=data.shape, chunks=chunks, dtype=data.dtype, **how)
    array[...] = data
    nrrd(name, data if expected is None else expected)
    told.append({"zarr": f"{name}.zarr", "nrrd": f"{name}.nrrd", **(tell or {})})
    return path, array


words = voxels("u2")
v2 = {
    "plain": {"compressors": None},
    "dots": {"compressors": numcodecs.GZip(3), "chunk_key_encoding": {"name": "v2", "separator": "."}},
    "slashes": {"compressors": numcodecs.Zlib(3), "chunk_key_encoding": {"name": "v2", "separator": "/"}},
    "zstd": {"compressors": numcodecs.Zstd(3)},
    "lz4": {"compressors": numcodecs.LZ4()},
    "bz2": {"compressors": numcodecs.BZ2(1)},
    "fortran": {"compressors": numcodecs.Zstd(1), "order": "F"},
}
for compressor in ["lz4", "lz4hc", "blosclz", "zlib", "zstd"]:
    for shuffle in [0, 1, 2]:
        blosc = numcodecs.Blosc(cname=compressor, clevel=5, shuffle=shuffle)
        v2[f"blosc-{compressor}-{shuffle}"] = {"compressors": blosc}
# Several blocks, and such as are not split.
v2["blosc-blocks"] = {"compressors": numcodecs.Blosc(cname="lz4", clevel=9, shuffle=1, blocksize=3000)}
for name, how in v2.items():
    write(f"v2-{name}", words, 2, **how)
for kind in ["u1", "i1", "i2", "u4", "i4", "f4"]:
    write(f"v2-{kind}", voxels(kind), 2, compressors=numcodecs.Blosc(cname="lz4", shuffle=1))
    if kind not in ["u1", "i1"]:
        write(f"v2-big-{kind}", voxels(kind).astype(">" + kind), 2, compressors=numcodecs.Zstd(1))

big = BytesCodec(endian="big")
v3 = {
    "plain": {"compressors": None},
    "gzip": {"compressors": GzipCodec(level=3)},
    "zstd": {"compressors": ZstdCodec(level=3, checksum=True)},
    "checked": {"compressors": [GzipCodec(level=1), Crc32cCodec()]},
    "big": {"serializer": big, "compressors": ZstdCodec(level=1)},
    "transposed": {"filters": TransposeCodec(order=(1, 2, 0)), "compressors": ZstdCodec(level=1)},
    "twice-transposed": {
        "filters": [TransposeCodec(order=(1, 2, 0)), TransposeCodec(order=(0, 2, 1))],
        "compressors": None,
    },
    "keys": {"compressors": None, "chunk_key_encoding": {"name": "v2", "separator": "."}},
    "sharded": {"shards": (32, 40, 64), "compressors": ZstdCodec(level=1)},
    "sharded-checked": {"shards": (48, 20, 96), "compressors": [GzipCodec(level=1), Crc32cCodec()]},
}
for compressor in ["lz4", "zstd", "blosclz", "zlib"]:
    for shuffle in ["noshuffle", "shuffle", "bitshuffle"]:
        blosc = BloscCodec(cname=compressor, clevel=5, shuffle=shuffle, typesize=2)
        v3[f"blosc-{compressor}-{shuffle}"] = {"compressors": blosc}
inner = {"codecs": [TransposeCodec(order=(2, 0, 1)), big, BloscCodec(cname="lz4", shuffle="shuffle", typesize=2)]}
for name, how in v3.items():
    write(f"v3-{name}", words, 3, **how)
shards = ShardingCodec(chunk_shape=CHUNKS, index_location="start", **inner)
write("v3-sharded-start", words, 3, chunks=(32, 40, 64), serializer=shards, compressors=None, filters=None)
for kind in ["u1", "i1", "i2", "u4", "i4", "f4"]:
    write(f"v3-{kind}", voxels(kind), 3)

# Five axes: one channel at one time of several is a volume. Written as bioformats2raw writes: an image in a root.
five = numpy.zeros((3, 2) + SHAPE, "<u2")
for time in range(3):
    for channel in range(2):
        five[time, channel] = words // (1 + time + 3 * channel)
blosc = numcodecs.Blosc(cname="lz4", clevel=5, shuffle=1)
for time, channel in [(None, None), (2, 1), (0, 1)]:
    tell = {key: value for key, value in [("time", time), ("channel", channel)] if value is not None}
    name, expected = f"five-{time}-{channel}", five[time or 0, channel or 0]
    keys = {"name": "v2", "separator": "/"}
    how = {"compressors": blosc, "chunk_key_encoding": keys, "chunks": (1, 1, 16, 20, 32), "below": "0"}
    path, _ = write(name, five, 2, axes="tczyx", tell=tell, expected=expected, **how)
    zarr.open_group(path, mode="a").attrs["bioformats2raw.layout"] = 3
# Several channels in one chunk, several times in one shard.
how = {"chunks": (1, 2, 16, 20, 32), "shards": (3, 2, 16, 40, 32)}
write("five-sharded", five, 3, axes="tczyx", tell={"time": 1, "channel": 1}, expected=five[1, 1], **how)
# Axes in other orders.
write("xyz", words.transpose(2, 1, 0), 2, axes="xyz", chunks=(32, 20, 16), expected=words)
write("yzcx", words.transpose(1, 0, 2)[:, :, None, :], 3, axes="yzcx", chunks=(20, 16, 1, 32), expected=words)
# What was never written has the fill value; so has what is gone.
for version in [2, 3]:
    holes = words.copy()
    holes[16:32, 0:20, 32:64] = 777
    holes[32:, 40:, :] = 777
    path, array = write(f"holes-{version}", holes, version, fill_value=777, expected=holes)
    gone = 0
    for key in ["1.0.1", "1/0/1", "c/1/0/1"]:
        chunk = path / "0" / key
        if chunk.exists():
            chunk.unlink()
            gone += 1
    # Python writes no chunk that is all fill value.
    assert gone <= 1
print(json.dumps(told))
