# The phantom of phantom.py by independent programs.
import gzip, io, shutil
import imagecodecs, nibabel, nrrd, SimpleITK, tifffile
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkIOLegacy import vtkStructuredPointsReader, vtkStructuredPointsWriter
from vtkmodules.vtkIOXML import vtkXMLImageDataWriter

# TIFF: types and byte orders; strips and tiles, codecs and predictors.
for dtype in TYPES:
    for order in "<>":
        name = f"pages_{dtype}_{'le' if order == '<' else 'be'}.tif"
        tifffile.imwrite(name, phantom(dtype), byteorder=order, metadata=None, photometric="minisblack", bigtiff=order == ">")
        row(name, phantom(dtype))
for codec in ["none", "lzw", "adobe_deflate", "packbits", "zstd"]:
    for dtype in ["u1", "u2", "i4", "f4", "f8"]:
        for predictor in [1, 2, 3]:
            if (predictor == 3) != (dtype[0] == "f") and predictor != 1 or codec in ("none", "packbits") and predictor > 1:
                continue
            for order in "<>":
                for layout in ["strips", "tiles", "one"]:
                    volume = phantom(dtype, (2, 37, 45))
                    name = f"{codec}_{dtype}_{predictor}_{'le' if order == '<' else 'be'}_{layout}.tif"
                    options = {"strips": {"rowsperstrip": 5}, "tiles": {"tile": (16, 32)}, "one": {"rowsperstrip": 64}}[layout]
                    tifffile.imwrite(name, volume, byteorder=order, metadata=None, photometric="minisblack",
                                     compression=None if codec == "none" else codec,
                                     predictor=predictor if predictor > 1 else None, **options)
                    row(name, volume)

# ImageJ: hyperstacks, with a directory a page, and with one alone.
hyper = numpy.array([[[phantom("u2", seed=3 * t + c)[z] for c in range(2)] for z in range(NZ)] for t in range(3)])
for truncate in [False, True]:
    for chosen in [(0, 0), (1, 2)]:
        name = f"imagej_{truncate}_{chosen[0]}{chosen[1]}.tif"
        tifffile.imwrite(name, hyper, imagej=True, truncate=truncate, resolution=(1 / 1.0, 1 / 2.0),
                         metadata={"spacing": 3.0, "unit": "um", "axes": "TZCYX"})
        c, t = chosen
        row(name, phantom("u2", seed=3 * t + c), straight, unit="um", chosen=chosen)
for dtype in ["u1", "f4"]:
    tifffile.imwrite(f"imagej_{dtype}.tif", phantom(dtype), imagej=True, resolution=(1.0, 0.5),
                     metadata={"spacing": 3.0, "unit": "\\u00B5m", "axes": "ZYX"})
    row(f"imagej_{dtype}.tif", phantom(dtype), straight, unit="um")

# OME.
size = {"PhysicalSizeX": 1.0, "PhysicalSizeY": 2.0, "PhysicalSizeZ": 3.0}
mm = {f"PhysicalSize{a}Unit": "mm" for a in "XYZ"}
tifffile.imwrite("a.ome.tif", phantom("i2"), ome=True, metadata={"axes": "ZYX", **size, **mm})
row("a.ome.tif", phantom("i2"), straight, unit="mm")
for axes in ["TCZYX", "ZCTYX", "CTZYX"]:
    data = numpy.moveaxis(hyper, [0, 1, 2], [axes.index(a) for a in "TZC"])
    tifffile.imwrite(f"{axes}.ome.tif", data, ome=True, metadata={"axes": axes, **size})
    row(f"{axes}.ome.tif", phantom("u2", seed=3 * 2 + 1), straight, unit="um", chosen=(1, 2))
mixed = {**size, "PhysicalSizeX": 1000.0, "PhysicalSizeXUnit": "nm"}
tifffile.imwrite("mixed.ome.tif", phantom("u1"), ome=True, metadata={"axes": "ZYX", **mixed})
row("mixed.ome.tif", phantom("u1"), straight, unit="um")

# OME in several files, each with the whole description, as tifffile reads them, too.
def ome_set(folder, names):
    os.mkdir(folder)
    planes, runs = {name: [] for name in names}, []
    for t in range(3):
        for c in range(2):
            for z in range(NZ):
                name = names[(z + 2 * t) % len(names)]
                runs.append(f'<TiffData FirstZ="{z}" FirstC="{c}" FirstT="{t}" IFD="{len(planes[name])}" PlaneCount="1">'
                            f'<UUID FileName="{name}">urn:uuid:{name}</UUID></TiffData>')
                planes[name].append(hyper[t, z, c])
    sizes = " ".join(f'PhysicalSize{a}="{s}" PhysicalSize{a}Unit="mm"' for a, s in zip("XYZ", SPACING))
    for name in names:
        xml = (f'<OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06" UUID="urn:uuid:{name}"><Image ID="Image:0">'
               f'<Pixels ID="Pixels:0" DimensionOrder="XYZCT" Type="uint16" SizeX="{NX}" SizeY="{NY}" SizeZ="{NZ}" SizeC="2" '
               f'SizeT="3" {sizes}><Channel ID="Channel:0:0"/><Channel ID="Channel:0:1"/>' + "".join(runs) + '</Pixels></Image></OME>')
        tifffile.imwrite(f"{folder}/{name}", numpy.array(planes[name]), description=xml, metadata=None,
                         photometric="minisblack")


ome_set("ome_set", ["b.ome.tif", "a.ome.tif", "c.ome.tif"])
for name in ["ome_set", "ome_set/a.ome.tif", "ome_set/c.ome.tif", "ome_set/*.tif"]:
    for c, t in [(0, 0), (1, 2)]:
        back = tifffile.TiffFile("ome_set/a.ome.tif").series[0].asarray()
        assert (back[t, c] == phantom("u2", seed=3 * t + c)).all()
        row(name, back[t, c], straight, unit="mm", chosen=(c, t))
ome_set("ome_renamed", ["own.ome.tif"])
os.rename("ome_renamed/own.ome.tif", "ome_renamed/other.ome.tif")
row("ome_renamed/other.ome.tif", phantom("u2", seed=7), straight, unit="mm", chosen=(1, 2))
ome_set("ome_cut", ["a.ome.tif", "b.ome.tif"])
os.remove("ome_cut/b.ome.tif")
table.append("ome_cut/a.ome.tif\tslices lie in `b.ome.tif`, which is not beside it")
os.mkdir("ome_more")
for name in ["a", "b", "c"]:
    shutil.copy(f"ome_set/{name}.ome.tif", "ome_more")
tifffile.imwrite("ome_more/d.tif", hyper[0, 0], metadata=None)
table.append("ome_more\td.tif is none of the files that")

# Stacks.
volume = phantom("u2", (12, NY, NX))
for folder, write in {
    "tif": lambda path, s: tifffile.imwrite(path, s, metadata=None),
    "png": lambda path, s: open(path, "wb").write(imagecodecs.png_encode(s)),
}.items():
    os.mkdir(f"stack_{folder}")
    for z in range(12):
        write(f"stack_{folder}/slice{z}.{folder}", volume[z])
    open(f"stack_{folder}/scan.log", "w").write("a log\n")
    row(f"stack_{folder}", volume)
row("stack_tif/slice*.tif", volume)
row("stack_tif/slice[0-3].tif", volume[:4])
open("list.txt", "w").write("# upside down\n" + "".join(f"stack_tif/slice{z}.tif\n" for z in reversed(range(12))))
row("list.txt", volume[::-1])
small = phantom("u1", (3, 16, 24))
os.mkdir("stack_rgb"), os.mkdir("stack_bmp"), os.mkdir("stack_bmp24"), os.mkdir("stack_jpg"), os.mkdir("stack_rgba")
flat = numpy.kron(phantom("u1", (3, 2, 3)), numpy.ones((1, 8, 8), "u1"))
for z in range(3):
    rgb = numpy.repeat(small[z][..., None], 3, -1)
    tifffile.imwrite(f"stack_rgb/{z}.tif", rgb, photometric="rgb", compression="lzw", predictor=2, metadata=None)
    rgba = numpy.concatenate([rgb, numpy.full_like(rgb[..., :1], 255)], -1)
    open(f"stack_rgba/{z}.png", "wb").write(imagecodecs.png_encode(rgba))
    open(f"stack_bmp/{z}.bmp", "wb").write(imagecodecs.bmp_encode(small[z][:, :23]))
    open(f"stack_bmp24/{z}.bmp", "wb").write(imagecodecs.bmp_encode(rgb[:, :23]))
    open(f"stack_jpg/{z}.jpg", "wb").write(imagecodecs.jpeg8_encode(flat[z], level=100))
row("stack_rgb", small), row("stack_rgba", small)
row("stack_bmp", small[:, :, :23]), row("stack_bmp24", small[:, :, :23])
row("stack_jpg", numpy.stack([imagecodecs.jpeg8_decode(open(f"stack_jpg/{z}.jpg", "rb").read()) for z in range(3)]))
open("bits.png", "wb").write(open("stack_png/slice3.png", "rb").read())
row("bits.png", volume[3])

# MetaImage by ITK: types, compression, every mirror and permutation, a rotation.
def itk(dtype, direction=numpy.eye(3)):
    image = SimpleITK.GetImageFromArray(phantom(dtype))
    image.SetSpacing(SPACING), image.SetOrigin((-4.5, 5.25, 6.0)), image.SetDirection(numpy.ravel(direction).tolist())
    return image


def itk_row(name, image):
    point = lambda *index: numpy.array(image.TransformContinuousIndexToPhysicalPoint([float(i) for i in index]))
    origin = point(0, 0, 0)
    vectors = [point(1, 0, 0) - origin, point(0, 1, 0) - origin, point(0, 0, 1) - origin]
    return dict(name=name, array=SimpleITK.GetArrayFromImage(image), vectors=vectors, origin=origin)


for dtype in TYPES:
    for packed in [False, True]:
        for extension in ["mha", "mhd"]:
            name = f"itk_{dtype}_{packed}.{extension}"
            SimpleITK.WriteImage(itk(dtype), name, packed)
            row(**itk_row(name, itk(dtype)))
turn = numpy.array(SimpleITK.Euler3DTransform((0, 0, 0), 0.3, -0.7, 1.1).GetMatrix()).reshape(3, 3)
directions = {"turned": turn}
for p in [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)]:
    for signs in range(8):
        m = numpy.zeros((3, 3))
        for axis in range(3):
            m[p[axis], axis] = -1 if signs >> axis & 1 else 1
        directions["".join(map(str, p)) + f"_{signs}"] = m
for key, direction in directions.items():
    image = itk("i2", direction)
    SimpleITK.WriteImage(image, f"itk_{key}.mha")
    row(**itk_row(f"itk_{key}.mha", image))
    if numpy.linalg.det(direction) > 0:
        SimpleITK.WriteImage(image, f"itk_{key}.nii.gz")
        row(**itk_row(f"itk_{key}.nii.gz", image), unit="mm")
    nrrd_name = f"itk_{key}.nrrd"
    SimpleITK.WriteImage(image, nrrd_name)
    row(**itk_row(nrrd_name, image))

# MetaImage by hand, as its description has it.
header = "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = {msb}\nOffset = 1 2 3\n" \
         "ElementSpacing = 1 2 3\nDimSize = 7 5 4\nElementType = MET_SHORT\n{more}ElementDataFile = {file}\n"
big = phantom("i2").astype(">i2").tobytes()
place = dict(vectors=straight, origin=(1, 2, 3))
open("big.mha", "wb").write(header.format(msb="True", more="", file="LOCAL").encode() + big)
row("big.mha", phantom("i2"), **place)
open("end.raw", "wb").write(b"something of 33 bytes before them" + big)
open("end.mhd", "w").write(header.format(msb="True", more="HeaderSize = -1\n", file="end.raw"))
row("end.mhd", phantom("i2"), **place)
open("skip.mhd", "w").write(header.format(msb="True", more="HeaderSize = 33\n", file="end.raw"))
row("skip.mhd", phantom("i2"), **place)
for z in range(NZ):
    open(f"part{z + 8:03}.raw", "wb").write(b"four" + phantom("i2")[z].tobytes())
files = "LIST\n" + "".join(f"part{z + 8:03}.raw\n" for z in range(NZ))
open("list.mhd", "w").write(header.format(msb="False", more="HeaderSize = 4\n", file=files))
row("list.mhd", phantom("i2"), **place)
open("pattern.mhd", "w").write(header.format(msb="False", more="HeaderSize = 4\n", file="part%03d.raw 8 11 1"))
row("pattern.mhd", phantom("i2"), **place)

# NIfTI by nibabel: its world is RAS.
def lps(affine):
    affine = numpy.diag([-1.0, -1.0, 1.0, 1.0]) @ affine
    return dict(vectors=affine[:3, :3].T, origin=affine[:3, 3])


affine = numpy.diag([*SPACING, 1.0])
affine[:3, 3] = (10, -20, 30)
turned = affine.copy()
turned[:3, :3] = turn @ numpy.diag(SPACING)
mirrored = affine.copy()
mirrored[:3, :3] = numpy.diag([-1.0, 2.0, 3.0])
for number, kind in [(1, nibabel.Nifti1Image), (2, nibabel.Nifti2Image)]:
    for dtype in TYPES:
        for order in "<>":
            name = f"nifti{number}_{dtype}_{'le' if order == '<' else 'be'}.nii"
            head = kind.header_class(endianness=order)
            head.set_data_dtype(numpy.dtype(dtype).newbyteorder(order))
            head.set_xyzt_units("mm")
            image = kind(phantom(dtype).T, affine, head, dtype=dtype)
            nibabel.save(image, name)
            row(name, phantom(dtype), **lps(affine), unit="mm")
    for key, matrix in [("turned", turned), ("mirrored", mirrored)]:
        for code in ["sform", "qform"]:
            image = kind(phantom("i2").T, matrix)
            image.set_sform(matrix, 1 if code == "sform" else 0)
            image.set_qform(matrix, 1 if code == "qform" else 0)
            image.header.set_xyzt_units("micron")
            name = f"nifti{number}_{key}_{code}.nii.gz"
            nibabel.save(image, name)
            row(name, phantom("i2"), **lps(matrix), unit="um")
    image = kind(phantom("i2").T, affine)
    image.header.set_slope_inter(0.5, -1024)
    image.header.set_xyzt_units("mm")
    raw = nibabel.fileholders.FileHolder
    nibabel.save(image, f"nifti{number}_slope.nii")
    # What lies in the file, by nibabel's own eyes.
    stored = nibabel.load(f"nifti{number}_slope.nii").dataobj
    row(f"nifti{number}_slope.nii", numpy.asarray(stored.get_unscaled()).T, **lps(affine), unit="mm",
        rescale=(stored.slope, stored.inter))
    # Values that fall with the numbers cannot go along with a volume: its voxels are the values.
    image = kind(phantom("i2").T, affine)
    image.header.set_slope_inter(-0.25, 3)
    nibabel.save(image, f"nifti{number}_falling.nii")
    row(f"nifti{number}_falling.nii", numpy.asarray(nibabel.load(f"nifti{number}_falling.nii").dataobj, "f8").T,
        **lps(affine))
for number, kind in [(1, nibabel.Nifti1Pair), (2, nibabel.Nifti2Pair)]:
    for packed in ["", ".gz"]:
        image = kind(phantom("f4").T, affine)
        image.header.set_xyzt_units("mm")
        nibabel.save(image, f"pair{number}{packed.strip('.')}.img{packed}")
        for end in ["img", "hdr"]:
            row(f"pair{number}{packed.strip('.')}.{end}{packed}", phantom("f4"), **lps(affine), unit="mm")
times = numpy.stack([phantom("u1", seed=t) for t in range(3)])
nibabel.save(nibabel.Nifti1Image(times.T, affine), "times.nii.gz")
row("times.nii.gz", phantom("u1", seed=2), **lps(affine), chosen=(0, 2))
for order in "<>":
    head = nibabel.AnalyzeHeader(endianness=order)
    head.set_data_dtype(numpy.dtype("i2").newbyteorder(order))
    head.set_zooms(SPACING) if head.set_data_shape((NX, NY, NZ)) is None else None
    name = f"analyze_{'le' if order == '<' else 'be'}"
    nibabel.save(nibabel.AnalyzeImage(phantom("i2").T, None, head), name + ".img")
    # nibabel takes the first axis of Analyze for one to the left; we take them as they lie.
    row(name + ".hdr", phantom("i2"), numpy.diag(nibabel.load(name + ".img").header.get_zooms()), unit="mm")

# NumPy.
for dtype in TYPES + ["f2", "b1"]:
    for order in "<>":
        volume = (phantom("u1") > 60) if dtype == "b1" else phantom("f4").astype("f2") if dtype == "f2" else phantom(dtype)
        read = volume.astype("u1") if dtype == "b1" else volume.astype("f4") if dtype == "f2" else volume
        name = f"numpy_{dtype}_{'le' if order == '<' else 'be'}.npy"
        numpy.save(name, volume.astype(volume.dtype.newbyteorder(order)))
        row(name, read)
numpy.save("fortran.npy", numpy.asfortranarray(phantom("i2")))
row("fortran.npy", phantom("i2").T, numpy.eye(3)[::-1])
numpy.save("flat.npy", phantom("i2")[0])
row("flat.npy", phantom("i2")[0])
numpy.save("squeezed.npy", phantom("i2")[None])
row("squeezed.npy", phantom("i2"))

numpy.savez("arrays.npz", a=phantom("i2"))
table.append("arrays.npz\tnumpy.save('volume.npy', numpy.load(")

# VTK, by VTK: the legacy format and XML, every way to write data down; arrays on points and in cells.
def vtk_image(dtype, direction=None, cells=False, first=(0, 0, 0), name="density"):
    image = vtkImageData()
    n = numpy.array([NX, NY, NZ]) + (1 if cells else 0)
    image.SetExtent(*[e for i in range(3) for e in (first[i], first[i] + int(n[i]) - 1)])
    image.SetSpacing(SPACING), image.SetOrigin(-4.5, 5.25, 6.0)
    if direction is not None:
        image.SetDirectionMatrix(numpy.ravel(direction).tolist())
    array = numpy_to_vtk(numpy.ravel(phantom(dtype)), deep=True)
    array.SetName(name)
    (image.GetCellData() if cells else image.GetPointData()).SetScalars(array)
    return image


def vtk_row(name, image, dtype, cells=False):
    lo = image.GetExtent()[::2]
    point = lambda *d: numpy.array(image.GetPoint(image.ComputePointId([lo[i] + d[i] for i in range(3)])))
    first = numpy.array(image.GetCell(0).GetBounds()).reshape(3, 2).mean(1) if cells else point(0, 0, 0)
    vectors = [point(1, 0, 0) - point(0, 0, 0), point(0, 1, 0) - point(0, 0, 0), point(0, 0, 1) - point(0, 0, 0)]
    row(name, phantom(dtype), vectors, first)


for dtype in TYPES:
    for text in [True, False]:
        writer, name = vtkStructuredPointsWriter(), f"vtk_{dtype}_{text}.vtk"
        image = vtk_image(dtype)
        writer.SetInputData(image), writer.SetFileName(name)
        writer.SetFileTypeToASCII() if text else writer.SetFileTypeToBinary()
        writer.Write()
        if text and dtype == "f8":
            # Of the digits that VTK writes, VTK's own reader makes these numbers.
            reader = vtkStructuredPointsReader()
            reader.SetFileName(name), reader.Update()
            read = vtk_to_numpy(reader.GetOutput().GetPointData().GetScalars()).reshape(NZ, NY, NX)
            row(name, read, straight, (-4.5, 5.25, 6.0))
        elif not (text and dtype == "u1"):  # shares of 255, which are refused
            vtk_row(name, image, dtype)
for text in [True, False]:
    # What follows the voxels is none of them.
    image, writer, name = vtk_image("i4"), vtkStructuredPointsWriter(), f"vtk_metadata_{text}.vtk"
    image.GetPointData().GetScalars().SetComponentName(0, "a component")
    writer.SetInputData(image), writer.SetFileName(name)
    writer.SetFileTypeToASCII() if text else writer.SetFileTypeToBinary()
    writer.Write()
    assert b"METADATA" in open(name, "rb").read()
    vtk_row(name, image, "i4")
# Several arrays, which are named: in cells, on points, of the same name in both, of several values.
image = vtk_image("f4", name="both")
for data, cells, names in [(image.GetPointData(), False, {"other": "i2", "third": "u4"}),
                           (image.GetCellData(), True, {"both": "u1", "of cells": "i4"})]:
    vectors = numpy_to_vtk(numpy.zeros((NX * NY * NZ, 3), "f4"), deep=True)
    vectors.SetName("vectors")
    data.SetVectors(vectors)
    for name, dtype in names.items():
        n = [e - cells for e in (NZ, NY, NX)]
        array = numpy_to_vtk(numpy.ravel(phantom(dtype)[:n[0], :n[1], :n[2]]), deep=True)
        array.SetName(name)
        data.AddArray(array)
named = []
for text in [True, False]:
    writer = vtkStructuredPointsWriter()
    writer.SetInputData(image), writer.SetFileName(f"named_{text}.vtk")
    writer.SetFileTypeToASCII() if text else writer.SetFileTypeToBinary()
    writer.Write(), named.append(f"named_{text}.vtk")
for mode in ["Ascii", "Binary", "Appended"]:
    writer = vtkXMLImageDataWriter()
    getattr(writer, f"SetDataModeTo{mode}")()
    writer.SetInputData(image), writer.SetFileName(f"named_{mode}.vti"), writer.Write(), named.append(f"named_{mode}.vti")
for name in named:
    at, half = numpy.array([-4.5, 5.25, 6.0]), numpy.array(SPACING) / 2
    row(f"{name}:/both", phantom("f4"), straight, at)
    row(f"{name}:/other", phantom("i2"), straight, at)
    row(f"{name}:/third", phantom("u4"), straight, at)
    row(f"{name}:/of cells", phantom("i4")[:-1, :-1, :-1], straight, at + half)
writer = vtkStructuredPointsWriter()
image = vtk_image("u2", cells=True)
writer.SetInputData(image), writer.SetFileName("vtk_cells.vtk"), writer.SetFileTypeToBinary(), writer.Write()
vtk_row("vtk_cells.vtk", image, "u2", True)


def write_vti(name, image, mode, codec, wide, big=False, coded=False):
    writer = vtkXMLImageDataWriter()
    writer.SetInputData(image), writer.SetFileName(name)
    {"ascii": writer.SetDataModeToAscii, "binary": writer.SetDataModeToBinary, "appended": writer.SetDataModeToAppended}[mode]()
    {"none": writer.SetCompressorTypeToNone, "zlib": writer.SetCompressorTypeToZLib, "lz4": writer.SetCompressorTypeToLZ4}[codec]()
    writer.SetHeaderTypeToUInt64() if wide else writer.SetHeaderTypeToUInt32()
    writer.SetByteOrderToBigEndian() if big else writer.SetByteOrderToLittleEndian()
    writer.SetEncodeAppendedData(coded), writer.SetBlockSize(64)
    assert writer.Write()


for dtype in TYPES:
    for mode in ["ascii", "binary", "appended"]:
        for codec in ["none", "zlib", "lz4"] if mode != "ascii" else ["none"]:
            for coded in [True, False] if mode == "appended" else [False]:
                for big in [True, False]:
                    name = f"vti_{dtype}_{mode}_{codec}_{coded}_{big}.vti"
                    image = vtk_image(dtype, turn, first=(2, -1, 5))
                    write_vti(name, image, mode, codec, dtype in ("u2", "f8"), big, coded)
                    vtk_row(name, image, dtype)
for cells in [False, True]:
    for mode in ["ascii", "binary", "appended"]:
        image = vtk_image("i2", cells=cells)
        for extra in ["another", "a third"]:
            array = numpy_to_vtk(numpy.ravel(phantom("f4")), deep=True)
            array.SetName(extra)
            (image.GetCellData() if cells else image.GetPointData()).AddArray(array)
        name = f"vti_several_{cells}_{mode}.vti"
        write_vti(name, image, mode, "zlib", True)
        vtk_row(name, image, "i2", cells)

# Packed.
for name in ["itk_u2_False.mha", "itk_u2_True.mha", "nifti2_i2_be.nii", "numpy_f4_be.npy", "pages_u2_be.tif", "itk_201_3.nrrd",
             "vtk_u2_False.vtk", "vtk_u2_True.vtk", "vti_u2_appended_none_False_True.vti", "vti_u2_appended_zlib_True_False.vti",
             "vti_u2_binary_lz4_False_False.vti"]:
    data = open(name, "rb").read()
    line = next(line for line in table if line.startswith(name + "\t"))
    half = len(data) // 2
    packed = {"gz": gzip.compress(data[:half]) + gzip.compress(data[half:]), "zst": imagecodecs.zstd_encode(data)}
    for end, content in packed.items():
        open(f"{name}.{end}", "wb").write(content)
        table.append(f"{name}.{end}" + line[len(name):])
nrrd.write("by_pynrrd.nrrd", phantom("i4").T, {"space directions": straight, "space origin": [1, 2, 3], "space dimension": 3})
row("by_pynrrd.nrrd", phantom("i4"), straight, (1, 2, 3))
