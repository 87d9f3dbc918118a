
# HDF5: types and byte orders in old and new files; layouts, indices of chunks, filters; groups and links; conventions.
import h5py, hdf5plugin

OLD, MIDDLE, NEW = ("earliest", "v108"), ("v108", "v110"), ("latest", "latest")


def hdf5(name, array, libver=OLD, path="/volume", want=None, mode="w", **options):
    with h5py.File(name, mode, libver=libver) as file:
        file.create_dataset(path, data=array, **options)
    want = array if want is None else want
    row(name, want.astype("f4") if want.dtype == "f2" else want)


for libver in [OLD, NEW]:
    for dtype in TYPES:
        for order in "<>":
            hdf5(f"{dtype}_{'le' if order == '<' else 'be'}_{libver[0]}.h5", phantom(dtype).astype(order + dtype), libver)
    for order in "<>":
        half = (phantom("f4") / 64).astype("f2")
        hdf5(f"f2_{'le' if order == '<' else 'be'}_{libver[0]}.h5", half.astype(order + "f2"), libver, want=half)
    bits = phantom("u1") > 60
    hdf5(f"bool_{libver[0]}.h5", bits, libver, want=bits.astype("i1"))

big = (20, 33, 41)
chunk = (3, 8, 16)
layouts = {
    "in_a_row": {}, "chunks": {"chunks": chunk}, "one_chunk": {"chunks": big},
    "deflate": {"chunks": chunk, "compression": "gzip"}, "one_deflate": {"chunks": big, "compression": "gzip"},
    "shuffle": {"chunks": chunk, "compression": "gzip", "shuffle": True, "fletcher32": True},
    "fletcher": {"chunks": chunk, "fletcher32": True},
    "lzf": {"chunks": chunk, "compression": "lzf", "shuffle": True},
    "szip": {"chunks": chunk, "compression": "szip"},
    "fixed": {"chunks": chunk, "maxshape": (40, 40, 50)},
    "fixed_deflate": {"chunks": chunk, "maxshape": (40, 80, 50), "compression": "gzip"},
    "extensible": {"chunks": chunk, "maxshape": (None, 33, 41)},
    "extensible_y": {"chunks": chunk, "maxshape": (20, None, 50)},
    "extensible_deflate": {"chunks": (1, 8, 16), "maxshape": (None, 33, 41), "compression": "gzip"},
    "tree": {"chunks": chunk, "maxshape": (None, None, 41)},
    "tree_deflate": {"chunks": chunk, "maxshape": (None, None, None), "compression": "gzip"},
    "bitshuffle": {"chunks": chunk, **hdf5plugin.Bitshuffle(cname="none")},
    "bitshuffle_lz4": {"chunks": chunk, **hdf5plugin.Bitshuffle(cname="lz4")},
    "bitshuffle_zstd": {"chunks": chunk, **hdf5plugin.Bitshuffle(nelems=64, cname="zstd")},
    "lz4": {"chunks": chunk, **hdf5plugin.LZ4()}, "zstd": {"chunks": chunk, **hdf5plugin.Zstd()},
}
for libver in [OLD, MIDDLE, NEW]:
    for layout, options in layouts.items():
        for dtype in ["<u2", ">f4"]:
            name = f"{layout}_{dtype[1:]}_{libver[0]}.h5"
            hdf5(name, phantom(dtype[1:], big).astype(dtype), libver, **options)
    hdf5(f"scaleoffset_{libver[0]}.h5", phantom("u2", big), libver, chunks=chunk, scaleoffset=0)
    hdf5(f"many_{libver[0]}.h5", phantom("u2", (60, 64, 64)), libver, chunks=(1, 2, 4))
    hdf5(f"many_extensible_{libver[0]}.h5", phantom("u2", (60, 64, 64)), libver, chunks=(1, 2, 4), maxshape=(None, 64, 64))
    hdf5(f"many_tree_{libver[0]}.h5", phantom("u2", (60, 64, 64)), libver, chunks=(1, 2, 4), maxshape=(None, None, 64))

    # Layouts that only the library's own calls can make; numbers of 12 bits.
    for layout, kind, settings in [
        ("compact", h5py.h5t.STD_U16LE, lambda p: p.set_layout(h5py.h5d.COMPACT)),
        ("implicit", h5py.h5t.STD_U16BE, lambda p: (p.set_chunk((3, 2, 4)), p.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY))),
        ("bits12", None, lambda p: None),
    ]:
        values = phantom("u2") & 4095 if kind is None else phantom("u2")
        if kind is None:
            kind = h5py.h5t.STD_U16LE.copy()
            kind.set_precision(12)
        name = f"{layout}_{libver[0]}.h5"
        with h5py.File(name, "w", libver=libver) as file:
            properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
            settings(properties)
            space = h5py.h5s.create_simple(values.shape)
            h5py.h5d.create(file.id, b"volume", kind, space, properties).write(h5py.h5s.ALL, h5py.h5s.ALL, values)
        row(name, values)

    # Some of it, or nothing, was ever written.
    for layout, options in {"chunks": {"chunks": chunk, "compression": "gzip"}, "row": {}}.items():
        name = f"fill_{layout}_{libver[0]}.h5"
        with h5py.File(name, "w", libver=libver) as file:
            dataset = file.create_dataset("volume", shape=big, dtype=">i2", fillvalue=-7, **options)
            if layout == "chunks":
                dataset[5:9, 3:20, 7:30] = 11
            row(name, dataset[...].astype("i2"))

    # Many groups, nested, and links; a dataset that shrank.
    name = f"groups_{libver[0]}.h5"
    with h5py.File(name, "w", libver=libver, track_order=libver == NEW) as file:
        for i in range(300):
            file.create_group(f"group{i:03}").attrs["about"] = "x" * 100
        file["group200/a/b/volume"] = phantom("i2")
        file["group201/a/volume"] = phantom("u1")
        file["soft"] = h5py.SoftLink("/group200/a")
        file["group201/up"] = h5py.SoftLink("/soft/b/./volume")
        file["hard"] = file["group200/a"]
        file["far"] = h5py.ExternalLink("other.h5", "/volume")
        file.create_dataset("shrunk", data=phantom("u2", big), chunks=chunk, maxshape=(None, None, None))
        file["shrunk"].resize((10, 20, 41))
    for path in ["/group200/a/b/volume", "/soft/b/volume", "/hard/b/volume", "/group201/up"]:
        row(f"{name}:{path}", phantom("i2"))
    row(f"{name}:/group201/a/volume", phantom("u1"))
    row(f"{name}:/shrunk", phantom("u2", big)[:10, :20])

with h5py.File("userblock.h5", "w", userblock_size=1024) as file:
    file["volume"] = phantom("u2")
with open("userblock.h5", "r+b") as file:
    file.write(b"x" * 1000)
row("userblock.h5:/volume", phantom("u2"))

# Axes of time and channel, and some of length one; a single plane.
times = numpy.array([phantom("u2", seed=3 * t) for t in range(3)])
with h5py.File("axes.h5", "w") as file:
    file.create_dataset("times", data=times, chunks=(2, 3, 2, 4))
    file["times_row"] = times
    file.create_dataset("channels", data=numpy.moveaxis(times, 0, -1), chunks=(3, 2, 4, 2))
    file["channels_row"] = numpy.moveaxis(times, 0, -1)
    file["ones"] = phantom("i4")[None, None]
    file["plane"] = phantom("i4")[0]
    tags = '{"axes": [%s]}' % ", ".join('{"key": "%s", "resolution": 0}' % key for key in "txyzc")
    dataset = file.create_dataset("ilastik", data=hyper.transpose(0, 4, 3, 1, 2), chunks=(2, 3, 2, 2, 2))
    dataset.attrs["axistags"] = tags
    dataset.attrs["element_size_um"] = [3.0, 2.0, 1.0]
    file["sizes"] = phantom("f4")
    file["sizes"].attrs["element_size_um"] = numpy.array([3.0, 2.0, 1.0], "f4")
for layout in ["", "_row"]:
    row(f"axes.h5:/times{layout}", times[2], chosen=(0, 2))
    row(f"axes.h5:/channels{layout}", times[1], chosen=(1, 0))
row("axes.h5:/ones", phantom("i4"))
row("axes.h5:/plane", phantom("i4")[0])
row("axes.h5:/sizes", phantom("f4"), straight, unit="um")
# Its axis that goes fastest is z: x, y, z of the voxels lie along z, y, x.
row("axes.h5:/ilastik", phantom("u2", seed=3 * 2 + 1).transpose(2, 1, 0), [[0, 0, 3.0], [0, 2.0, 0], [1.0, 0, 0]],
    unit="um", chosen=(1, 2))

# NeXus: the way of defaults, positions and units; a spectrum beside it. An old one, with everything in one text.
for libver in [OLD, NEW]:
    name = f"nexus_{libver[0]}.nxs"
    with h5py.File(name, "w", libver=libver) as file:
        file.attrs["default"] = "entry"
        entry = file.create_group("entry")
        entry.attrs.update(NX_class="NXentry", default="data")
        data = entry.create_group("data")
        data.attrs.update(NX_class="NXdata", signal="counts", axes=["z", "y", "x"])
        data.create_dataset("counts", data=phantom("u2"), chunks=(2, 3, 4), compression="gzip")
        entry["raw"] = phantom("u1", (2, 3, 4))
        for axis, (count, step, first) in {"x": (NX, 1.0, -4.0), "y": (NY, -2.0, 5.0), "z": (NZ, 3.0, 0.5)}.items():
            data[axis] = first + step * numpy.arange(count, dtype="f8")
            data[axis].attrs["units"] = "mm"
    row(name, phantom("u2"), numpy.diag([1.0, -2.0, 3.0]), [-4.0, 5.0, 0.5], unit="mm")
with h5py.File("nexus_old.nxs", "w") as file:
    data = file.create_group("entry/data")
    data.attrs.update(signal=numpy.bytes_("counts"), axes="height:row:column")
    data["counts"] = phantom("f8")
    for axis, count, step, unit in [("height", NZ, 3000, "um"), ("row", NY, 2, "mm"), ("column", NX, 1, "mm")]:
        data[axis] = numpy.arange(count, dtype="i4") * step
        data[axis].attrs["units"] = unit
    file["entry/spectrum"] = numpy.arange(9.0)
row("nexus_old.nxs", phantom("f8"), straight, [0, 0, 0], unit="mm")
with h5py.File("dxchange.h5", "w") as file:
    file["exchange/data"] = phantom("u2")
    file["exchange/data_white"] = phantom("u2", (2, 5, 7))
    file["exchange/theta"] = numpy.linspace(0, 180, NZ)
row("dxchange.h5", phantom("u2"))
with h5py.File("netcdf.nc", "w") as file:
    file["volume"] = phantom("i2")
    file["volume"].attrs.update(scale_factor=0.5, add_offset=-10.0, _FillValue=numpy.int16(-1))
row("netcdf.nc", phantom("i2"), rescale=(0.5, -10.0))
for packing in ["gz", "zst"]:
    packed = open("nexus_latest.nxs", "rb").read()
    packed = gzip.compress(packed) if packing == "gz" else imagecodecs.zstd_encode(packed)
    open(f"nexus.nxs.{packing}", "wb").write(packed)
    row(f"nexus.nxs.{packing}", phantom("u2"), numpy.diag([1.0, -2.0, 3.0]), [-4.0, 5.0, 0.5], unit="mm")
    row(f"nexus.nxs.{packing}:/entry/raw", phantom("u1", (2, 3, 4)))

# Amira Mesh and VGI, from their descriptions: there is no other program at hand that writes them.
AMIRA = {"u1": "byte", "i2": "short", "u2": "ushort", "i4": "int", "f4": "float", "f8": "double"}


def runs(data):
    """A byte over and over, or some as they are."""
    out = bytearray()
    for i in range(0, len(data), 50):
        part = data[i:i + 50]
        out += bytes([len(part), part[0]]) if len(set(part)) == 1 else bytes([128 + len(part)]) + part
    return bytes(out)


def amira(name, coding, arrays, packing=None):
    head = f"# AmiraMesh {coding} 2.1\n\n\ndefine Lattice {NX} {NY} {NZ}\n\nParameters {{\n    Units {{\n        Coordinates \"mm\"\n    }}\n"
    head += f"    Content \"{NX}x{NY}x{NZ} ushort, uniform coordinates\",\n    BoundingBox -4 {NX - 5} 5 {2 * NY + 3} 0.5 {3 * NZ - 2.5},\n    CoordType \"uniform\"\n}}\n\n"
    body = b""
    for mark, (title, values) in enumerate(arrays.items(), 1):
        order = "<" if "LITTLE" in coding else ">"
        data = numpy.ascontiguousarray(values).astype(values.dtype.newbyteorder(order)).tobytes()
        if coding == "ASCII":
            data = "\n".join(repr(v.item()) for v in numpy.ravel(values)).encode() + b"\n"
        data = {None: lambda d: d, "HxZip": zlib.compress, "HxByteRLE": runs}[packing](data)
        kind = AMIRA[values.dtype.str[1:]] + ("[3]" if values.ndim == 4 else "")
        head += f"Lattice {{ {kind} {title} }} @{mark}" + (f"({packing},{len(data)})" if packing else "") + "\n"
        body += f"\n@{mark}\n".encode() + data + b"\n"
    open(name, "wb").write(head.encode() + b"\n# Data section follows" + body)


import zlib

origin = (-4, 5, 0.5)
for coding in ["BINARY-LITTLE-ENDIAN", "BINARY", "ASCII", "3D ASCII"]:
    for dtype in AMIRA:
        name = f"amira_{coding.replace(' ', '_')}_{dtype}.am"
        amira(name, coding.split()[-1], {"Data": phantom(dtype)})
        row(name, phantom(dtype), straight, origin, unit="mm")
for packing, dtype in [("HxZip", "u1"), ("HxZip", "i2"), ("HxByteRLE", "u1")]:
    for coding in ["BINARY-LITTLE-ENDIAN", "BINARY"]:
        name = f"amira_{packing}_{dtype}_{coding}.am"
        flat = numpy.where(phantom(dtype) > 60, 3, 0).astype(dtype)
        amira(name, coding, {"Labels": flat}, packing)
        row(name, flat, straight, origin, unit="mm")
        open(f"{name}.gz", "wb").write(gzip.compress(open(name, "rb").read()))
        row(f"{name}.gz", flat, straight, origin, unit="mm")
vectors = numpy.repeat(phantom("f4")[..., None], 3, -1)
for coding, packing in [("BINARY-LITTLE-ENDIAN", None), ("ASCII", None), ("BINARY", "HxZip")]:
    name = f"amira_several_{coding}.am"
    amira(name, coding, {"Vectors": vectors, "Data": phantom("u2"), "Labels": phantom("u1")}, packing)
    row(name, phantom("u2"), straight, origin, unit="mm")
    row(f"{name}:/Labels", phantom("u1"), straight, origin, unit="mm")
for dtype in ["u1", "i2", "u2", "f4"]:
    for order in ["little", "big"]:
        kind = {"u": "unsigned integer", "i": "signed integer", "f": "float"}[dtype[0]]
        name = f"vgi_{dtype}_{order}"
        data = phantom(dtype).astype(("<" if order == "little" else ">") + dtype).tobytes()
        open(f"{name}.vol", "wb").write(b"x" * 16 + data)
        head = f"""{{volume1}}
[representation]
size = {NX} {NY} {NZ}
datatype = {kind}
bitsperelement = {8 * int(dtype[1])}
mirror = 0 0 0
[file1]
SkipHeader = 16
FileFormat = raw
Size = {NX} {NY} {NZ}
Name = C:\\scans\\{name}.vol
Datatype = {kind}
BitsPerElement = {8 * int(dtype[1])}
Endian = {order}
{{volumeprimitive1}}
[geometry]
resolution = 1 2 3
unit = mm
"""
        open(f"{name}.vgi", "w").write(head)
        row(f"{name}.vgi", phantom(dtype), straight, unit="mm")

# What is refused, and words of why.
refusals = []
with h5py.File("refused.h5", "w", libver=NEW) as file:
    file["a/one"] = phantom("u2")
    file["a/two"] = phantom("f4", (3, 4, 5))
    file["a/line"] = numpy.arange(9)
    file["far"] = h5py.ExternalLink("other.h5", "/entry/volume")
    file["loop"] = h5py.SoftLink("/loop")
    file["nowhere"] = h5py.SoftLink("/a/three")
    layout = h5py.VirtualLayout((2, 5, 7), "u2")
    layout[0] = h5py.VirtualSource("other.h5", "volume", (5, 7))
    file.create_virtual_dataset("virtual", layout)
    file["complex"] = numpy.zeros((2, 3, 4), "c8")
    file["text"] = "text"
    file.create_dataset("raw", (2, 3, 4), "u2", external=[("raw.bin", 0, 48)])
    file.create_dataset("blosc", data=phantom("u2"), chunks=(2, 3, 4), **hdf5plugin.Blosc())
    file["five"] = numpy.zeros((2, 3, 4, 5, 6))
    huge = file.create_dataset("chunk", (512, 512, 512), "f8", chunks=(256, 512, 512), compression="gzip")
    huge.id.write_direct_chunk((0, 0, 0), b"never decoded")
for path, *words in [
    ("", "6 datasets that could be the volume", "/a/one (4 x 5 x 7 of uint16)", "Say which, e.g. `refused.h5:/"),
    (":/a/three", "no dataset `/a/three`", "/a/one"), (":/nowhere", "no dataset `/nowhere`"), (":/a", "no dataset `/a`"),
    (":/far", "external link", "`/entry/volume` in the file `other.h5`"), (":/loop", "16 soft links"),
    (":/virtual", "virtual"), (":/complex", "no numbers"), (":/text", "no numbers"), (":/raw", "external files"),
    (":/blosc", "Blosc are not read", "h5repack"), (":/five", "5 axes"), (":/chunk", "at most 256 MiB", "h5repack"),
    (":/a/line", "1 axes"),
]:
    refusals.append("\t".join([f"refused.h5{path}", *words]))
# What h5py brings along for its own tests: other machines' files, and none of them a volume.
own = os.path.join(os.path.dirname(h5py.__file__), "tests", "data_files")
for name in sorted(os.listdir(own) if os.path.isdir(own) else []):
    if name.endswith(".h5"):
        shutil.copy(os.path.join(own, name), name)
        refusals.append(f"{name}\tno dataset of numbers with three axes\tthere are: /")
whole = open("chunks_u2_latest.h5", "rb").read()
open("cut.h5", "wb").write(whole[:len(whole) // 2])
refusals.append("cut.h5\tHDF5")
open("empty.h5", "wb").write(whole[:8])
refusals.append("empty.h5\theader")
refusals.append("mha_u1.mha:/volume\tholds one volume") if os.path.exists("mha_u1.mha") else None
refusals.append("amira_several_ASCII.am:/Vectors\t3 values a voxel")
refusals.append("amira_several_BINARY.am:/other\tnone called `other`\tVectors, Data, Labels")
for name, old, new, words in [
    ("amira_BINARY_u2.am", b'"uniform"', b'"stacked"', "CoordType"), ("amira_BINARY_u2.am", b"ushort Data", b"HxComplex Data", "HxComplex"),
    ("amira_HxZip_u1_BINARY.am", b"HxZip", b"HxOther", "HxOther"), ("vgi_u2_big.vgi", b"FileFormat = raw", b"FileFormat = proj", "FileFormat"),
    ("vgi_u2_big.vgi", b"SkipHeader", b"[file2]\nSkipHeader", "several files"), ("vgi_u2_big.vgi", b"vgi_u2_big.vol", b"gone.vol", "gone.vol"),
]:
    bad = f"bad{len(refusals)}.bin"
    assert old in open(name, "rb").read()
    open(bad, "wb").write(open(name, "rb").read().replace(old, new))
    refusals.append(f"{bad}\t{words}" if words != "gone.vol" else f"{bad}\t{words}\tcannot")
refusals.append("by_pynrrd.nrrd:/volume\tholds one volume")
for name in named:
    refusals.append(f"{name}:/fourth\tnone called `fourth`\tother\tvectors")
    refusals.append(f"{name}:/vectors\t3 values a voxel")
table.extend(line for line in refusals if line)
