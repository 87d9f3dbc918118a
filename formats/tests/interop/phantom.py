"""One phantom that scripts behind this one write into argv[1], with a table of what must be read.

A line of the table, by tabs: name, voxels' file, type, dims, vectors of the axes (world, 9 numbers, or -), origin (or -),
unit (or -), slope and intercept, channel and time (or -).
"""

import atexit, os, sys
import numpy

out = sys.argv[1]
os.chdir(out)
table = []
TYPES = ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"]
NAMES = {"u1": "uint8", "i1": "int8", "u2": "uint16", "i2": "int16", "u4": "uint32", "i4": "int32", "u8": "uint64",
         "i8": "int64", "f4": "float32", "f8": "float64"}
NZ, NY, NX = 4, 5, 7
SPACING = (1.0, 2.0, 3.0)


def phantom(dtype, shape=(NZ, NY, NX), seed=0):
    """An L in a ramp that no mirror and no turn maps to itself, over the whole range of the type."""
    z, y, x = numpy.indices(shape)
    ramp = (x + 7 * y + 35 * z + 11 * seed) % 127
    l_shape = ((x <= 1) & (z == 0)) | ((y == 0) & (x <= 4) & (z == 0)) | ((x == 0) & (y == 0))
    if dtype[0] == "f":
        return ((ramp - 50) * 0.37 + l_shape * 1e3).astype(dtype)
    info = numpy.iinfo(dtype)
    scale = max(1, int(info.max) // 128)
    values = ramp.astype(object) * scale + l_shape * (int(info.max) // 129)
    if info.min < 0:
        values = values - 60 * scale
    return numpy.array(values.tolist(), dtype=dtype)


def row(name, array, vectors=None, origin=None, unit=None, rescale=(1, 0), chosen=None, near=0):
    """`array` has the axis that goes fastest last; `near` is how far numbers of 16 bits may be away, decoded with loss."""
    dtype = array.dtype.str[1:]
    raw = f"{'near' if near else 'raw'}{len(table)}.bin"
    array.astype("<" + dtype).tofile(raw)
    dims = ([1] * (3 - array.ndim) + list(array.shape))[::-1]
    text = lambda numbers: "-" if numbers is None else " ".join(repr(float(n)) for n in numpy.ravel(numbers))
    table.append("\t".join([name, raw, NAMES[dtype], " ".join(map(str, dims)), text(vectors), text(origin), unit or "-",
                            text(rescale), "-" if chosen is None else "%d %d" % chosen]))


straight = numpy.diag(SPACING)
atexit.register(lambda: open(os.path.join(out, "table.tsv"), "w").write("\n".join(table) + "\n"))
