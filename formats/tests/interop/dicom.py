# The phantom of phantom.py as DICOM, by pydicom, imagecodecs and SimpleITK (GDCM).
import gzip, random
import imagecodecs, pydicom, SimpleITK
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.encaps import encapsulate, encapsulate_extended
from pydicom.sequence import Sequence
from pydicom.uid import UID, generate_uid

CT, ENHANCED = UID("1.2.840.10008.5.1.4.1.1.2"), UID("1.2.840.10008.5.1.4.1.1.2.1")
DOSE, PARAMETRIC = UID("1.2.840.10008.5.1.4.1.1.481.2"), UID("1.2.840.10008.5.1.4.1.1.30")
IMPLICIT, EXPLICIT = UID("1.2.840.10008.1.2"), UID("1.2.840.10008.1.2.1")
DEFLATED, BIG = UID("1.2.840.10008.1.2.1.99"), UID("1.2.840.10008.1.2.2")
ORIGIN = (-4.5, 5.25, 6.0)
random.seed(1)


def image(array, syntax=EXPLICIT, kind=CT, series="1.2.3"):
    """A data set of one array of two or three axes, without its place."""
    meta = FileMetaDataset()
    meta.TransferSyntaxUID, meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = syntax, kind, generate_uid()
    ds = FileDataset(None, {}, file_meta=meta, preamble=bytes(128))
    ds.SOPClassUID, ds.SOPInstanceUID = kind, meta.MediaStorageSOPInstanceUID
    ds.SeriesInstanceUID, ds.StudyInstanceUID, ds.PatientName, ds.Modality = series, "1.2", "Phantom", "CT"
    # Sequences of every kind before the pixels, to be passed.
    inner = Dataset()
    inner.CodeValue, inner.Rows = "1", 77
    outer = Dataset()
    outer.PurposeOfReferenceCodeSequence = Sequence([inner, inner])
    outer.is_undefined_length_sequence_item = True
    ds.ReferencedImageSequence = Sequence([outer])
    ds["ReferencedImageSequence"].is_undefined_length = True
    ds.SourceImageSequence = Sequence([inner])
    ds.Rows, ds.Columns, ds.SamplesPerPixel, ds.PhotometricInterpretation = *array.shape[-2:], 1, "MONOCHROME2"
    if array.ndim == 3:
        ds.NumberOfFrames = array.shape[0]
    is_big = syntax == BIG
    raw = array.astype(array.dtype.newbyteorder(">" if is_big else "<")).tobytes()
    if array.dtype.kind == "f":
        setattr(ds, "FloatPixelData" if array.itemsize == 4 else "DoubleFloatPixelData", raw)
        return ds
    ds.BitsAllocated = ds.BitsStored = 8 * array.itemsize
    ds.HighBit, ds.PixelRepresentation = ds.BitsStored - 1, int(array.dtype.kind == "i")
    words = is_big or array.itemsize > 1
    if is_big and array.itemsize == 1:
        # Pairs of bytes are numbers of 16 bits.
        raw = (raw + bytes(len(raw) % 2))
        raw = numpy.frombuffer(raw, "u2").byteswap().tobytes()
    ds.PixelData = raw + bytes(len(raw) % 2)
    ds["PixelData"].VR = "OW" if words else "OB"
    return ds


def place(ds, z, directions=numpy.eye(3), spacing=SPACING, origin=ORIGIN):
    """Of slice `z`: directions have an axis a column."""
    x, y, normal = directions.T
    point = numpy.array(origin) + normal * spacing[2] * z
    text = lambda numbers: ["%.10g" % n for n in numbers]
    ds.ImagePositionPatient, ds.ImageOrientationPatient = text(point), text([*x, *y])
    # Rows first, which are y.
    ds.PixelSpacing = text([spacing[1], spacing[0]])
    # None of these is where slices lie.
    ds.SliceThickness, ds.SpacingBetweenSlices, ds.SliceLocation = "17.0", "19.0", "-4"
    return ds


def save(ds, path):
    syntax = ds.file_meta.TransferSyntaxUID
    pydicom.dcmwrite(path, ds, implicit_vr=syntax == IMPLICIT, little_endian=syntax != BIG, enforce_file_format=True)


def save_series(folder, slices):
    """Under names that say nothing, with numbers that say something else."""
    os.mkdir(folder)
    numbers = random.sample(range(1000), len(slices))
    for z, ds in enumerate(slices):
        ds.InstanceNumber = numbers[z]
        save(ds, f"{folder}/{random.choice(['IM', '', 'x.'])}{numbers[z]:04}{random.choice(['', '.dcm', '.IMA'])}")


def series(folder, array, syntax=EXPLICIT, change=lambda ds, z: None, read=None, directions=numpy.eye(3), **more):
    slices = [place(image(array[z], syntax), z, directions) for z in range(len(array))]
    for z, ds in enumerate(slices):
        change(ds, z)
    save_series(folder, slices)
    row(folder, array if read is None else read, (directions @ straight).T, ORIGIN, "mm", **more)


# Types, each with every plain syntax.
for dtype in ["u1", "i1", "u2", "i2", "u4", "i4", "f4", "f8"]:
    for key, syntax in {"implicit": IMPLICIT, "explicit": EXPLICIT, "deflated": DEFLATED, "big": BIG}.items():
        series(f"{key}_{dtype}", phantom(dtype), syntax)
        frames = phantom(dtype)
        save(place(image(frames, syntax), 0), f"frames_{key}_{dtype}")
        row(f"frames_{key}_{dtype}", frames)
flat = phantom("u1", (1, 5, 7))
save(place(image(flat[0], BIG), 0), "odd_big")
row("odd_big", flat)

# Every way that axes lie without a mirror, and a turn.
turn = numpy.array(SimpleITK.Euler3DTransform((0, 0, 0), 0.3, -0.7, 1.1).GetMatrix()).reshape(3, 3)
directions = {"turned": turn}
for p in [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)]:
    for signs in range(8):
        m = numpy.zeros((3, 3))
        for axis in range(3):
            m[p[axis], axis] = -1 if signs >> axis & 1 else 1
        if numpy.linalg.det(m) > 0:
            directions["".join(map(str, p)) + f"_{signs}"] = m
for key, direction in directions.items():
    series(f"axes_{key}", phantom("i2"), directions=direction)

# Bits: fewer than the word has, with rubbish above them, and not at its end.
twelve = phantom("u1").astype("u2") * 16
signed = (twelve.astype("i4") - 2048).astype("i2")


def bits(ds, stored, high, is_signed, words):
    ds.BitsStored, ds.HighBit, ds.PixelRepresentation, ds.PixelData = stored, high, int(is_signed), words.tobytes()


series("bits_12", twelve, change=lambda ds, z: bits(ds, 12, 11, False, twelve[z] | 0xA000))
series("bits_12_signed", signed, change=lambda ds, z: bits(ds, 12, 11, True, (signed[z].astype("u2") & 0xFFF) | 0x5000))
series("bits_12_high", twelve, change=lambda ds, z: bits(ds, 12, 15, False, twelve[z] << 4 | 5))

# What numbers mean.
def hounsfield(ds, z):
    ds.RescaleSlope, ds.RescaleIntercept, ds.RescaleType = "0.5", "-1024", "HU"


def each(ds, z):
    ds.RescaleSlope, ds.RescaleIntercept = str(0.125 * (z + 1)), str(-z)


series("hounsfield", phantom("u2"), change=hounsfield, rescale=(0.5, -1024))
values = numpy.stack([phantom("u2")[z] * (0.125 * (z + 1)) - z for z in range(NZ)])
series("slope_of_each", phantom("u2"), change=each, read=values)

# Coded, as imagecodecs and pydicom do it: a file a slice, frames in fragments of their own, and in several each.
smooth = lambda dtype: (phantom("u1", (4, 40, 33)).astype(dtype) * (100 if dtype[1] == "2" else 1))
lossless = {
    "jpeg_lossless": ("1.2.840.10008.1.2.4.70", lambda a: imagecodecs.ljpeg_encode(a)),
    "jpeg_lossless_any": ("1.2.840.10008.1.2.4.57", lambda a: imagecodecs.ljpeg_encode(a)),
    "jpeg_ls": ("1.2.840.10008.1.2.4.80", lambda a: imagecodecs.jpegls_encode(a)),
    "jpeg_2000": ("1.2.840.10008.1.2.4.90", lambda a: imagecodecs.jpeg2k_encode(a, reversible=True, codecformat="j2k")),
    "jpeg_2000_boxes": ("1.2.840.10008.1.2.4.91", lambda a: imagecodecs.jpeg2k_encode(a, reversible=True, codecformat="jp2")),
    "fragments": ("1.2.840.10008.1.2.1.98", lambda a: a.tobytes()),
}
for key, (syntax, encode) in lossless.items():
    for dtype in ["u1", "u2"]:
        for what, array in {"small": phantom(dtype), "smooth": smooth(dtype)}.items():
            coded = [encode(numpy.ascontiguousarray(plane)) for plane in array]
            padded = [bytes(c) + bytes(len(c) % 2) for c in coded]

            def put(ds, z):
                ds.file_meta.TransferSyntaxUID = UID(syntax)
                ds.PixelData = encapsulate([padded[z]], has_bot=z % 2 == 0)
                ds["PixelData"].is_undefined_length = True

            series(f"{key}_{dtype}_{what}", array, change=put)
            for way in ["each", "several", "extended"]:
                ds = image(array)
                ds.file_meta.TransferSyntaxUID = UID(syntax)
                if way == "extended":
                    ds.PixelData, ds.ExtendedOffsetTable, ds.ExtendedOffsetTableLengths = encapsulate_extended(padded)
                else:
                    ds.PixelData = encapsulate(padded, fragments_per_frame=3 if way == "several" else 1)
                ds["PixelData"].is_undefined_length = True
                save(ds, f"frames_{key}_{dtype}_{what}_{way}")
                row(f"frames_{key}_{dtype}_{what}_{way}", array)
for dtype in ["u1", "i1", "u2", "i2"]:
    for what, array in {"small": phantom(dtype), "smooth": phantom(dtype, (4, 40, 33))}.items():
        slices = [place(image(array[z]), z) for z in range(len(array))]
        for ds in slices:
            ds.compress(pydicom.uid.RLELossless, generate_instance_uid=False)
        save_series(f"rle_{dtype}_{what}", slices)
        row(f"rle_{dtype}_{what}", array, straight, ORIGIN, "mm")
        ds = image(array)
        ds.compress(pydicom.uid.RLELossless, generate_instance_uid=False)
        save(ds, f"frames_rle_{dtype}_{what}")
        row(f"frames_rle_{dtype}_{what}", array)
for what, level in [("near", 2), ("exact", 0)]:
    array = smooth("u2")
    coded = [imagecodecs.jpegls_encode(plane, level) for plane in array]

    def put(ds, z):
        ds.file_meta.TransferSyntaxUID = UID("1.2.840.10008.1.2.4.81")
        ds.PixelData = encapsulate([bytes(coded[z]) + bytes(len(coded[z]) % 2)])
        ds["PixelData"].is_undefined_length = True

    series(f"jpeg_ls_{what}", array, change=put, read=numpy.stack([imagecodecs.jpegls_decode(c) for c in coded]))
# Noise, flat planes, edges, single points: what codecs have their own ways for.
rng = numpy.random.default_rng(7)
for rows, columns in [(9, 1), (17, 31), (64, 65)]:
    y, x = numpy.indices((rows, columns))
    for deep in [8, 12, 16]:
        top = (1 << deep) - 1
        wave = (numpy.sin(x / 5) + numpy.cos(y / 7) + 2) / 4 * top
        planes = {
            "noise": rng.integers(0, top + 1, x.shape), "flat": numpy.full(x.shape, top // 3),
            "wave": numpy.clip(wave.astype(int) + rng.integers(-3, 4, x.shape), 0, top),
            "points": numpy.where(rng.random(x.shape) < 0.03, rng.integers(0, top + 1, x.shape), 0),
            "edges": numpy.where((x // 5 + y // 3) % 2, top, 0),
        }
        for what, plane in planes.items():
            plane = numpy.ascontiguousarray(plane.astype("u1" if deep == 8 else "u2"))
            for key in ["jpeg_ls", "jpeg_2000"] + (["jpeg_lossless"] if rows > 9 and what != "flat" else []):
                ds, name = image(plane), f"{key}_{what}_{rows}_{deep}"
                coded = bytes(lossless[key][1](plane))
                ds.file_meta.TransferSyntaxUID = UID(lossless[key][0])
                ds.PixelData = encapsulate([coded + bytes(len(coded) % 2)])
                ds["PixelData"].is_undefined_length = True
                save(ds, name)
                row(name, plane)
flat = numpy.kron(phantom("u1", (3, 2, 3)), numpy.ones((1, 8, 8), "u1"))
coded = [imagecodecs.jpeg8_encode(plane, level=100) for plane in flat]


def put(ds, z):
    ds.file_meta.TransferSyntaxUID = UID("1.2.840.10008.1.2.4.50")
    ds.PixelData = encapsulate([bytes(coded[z]) + bytes(len(coded[z]) % 2)])
    ds["PixelData"].is_undefined_length = True


series("jpeg", flat, change=put, read=numpy.stack([imagecodecs.jpeg8_decode(c) for c in coded]))

# Signed numbers in JPEG 2000, whose codestream says so, by OpenJPEG in pydicom's hands.
for dtype in ["i1", "i2"]:
    array = phantom(dtype, (4, 40, 33))
    slices = [place(image(array[z]), z) for z in range(len(array))]
    for ds in slices:
        ds.compress(pydicom.uid.JPEG2000Lossless, generate_instance_uid=False)
    save_series(f"jpeg_2000_{dtype}", slices)
    row(f"jpeg_2000_{dtype}", array, straight, ORIGIN, "mm")

# Frames with groups of their own, upside down and shuffled.
def group(**values):
    ds = Dataset()
    for key, value in values.items():
        setattr(ds, key, value)
    return ds


for key, syntax in {"explicit": EXPLICIT, "implicit": IMPLICIT, "big": BIG}.items():
    for undefined in [False, True]:
        array = phantom("i2")
        order = [2, 0, 3, 1]
        ds = image(array[order], syntax, ENHANCED)
        x, y, normal = turn.T
        number = lambda values: ["%.10g" % v for v in values]
        measures = group(PixelSpacing=[2.0, 1.0], SliceThickness=9.0)
        orientation = group(ImageOrientationPatient=number([*x, *y]))
        meaning = group(RescaleSlope="2", RescaleIntercept="-1000", RescaleType="HU")
        ds.SharedFunctionalGroupsSequence = Sequence([group(
            PixelMeasuresSequence=Sequence([measures]), PlaneOrientationSequence=Sequence([orientation]),
            PixelValueTransformationSequence=Sequence([meaning]))])
        frames = []
        for z in order:
            position = group(ImagePositionPatient=number(numpy.array(ORIGIN) + normal * 3 * z))
            content = group(DimensionIndexValues=[1, z + 1], FrameAcquisitionNumber=1)
            frames.append(group(FrameContentSequence=Sequence([content]), PlanePositionSequence=Sequence([position])))
            frames[-1].is_undefined_length_sequence_item = undefined
        ds.PerFrameFunctionalGroupsSequence = Sequence(frames)
        for name in ["SharedFunctionalGroupsSequence", "PerFrameFunctionalGroupsSequence"]:
            ds[name].is_undefined_length = undefined
        save(ds, f"enhanced_{key}_{undefined}")
        row(f"enhanced_{key}_{undefined}", array, (turn @ straight).T, ORIGIN, "mm", rescale=(2, -1000))

# A dose: frames behind the first, downwards.
ds = place(image(phantom("u4")[::-1], kind=DOSE), NZ - 1)
ds.GridFrameOffsetVector, ds.DoseGridScaling, ds.DoseUnits = [0, -3, -6, -9], "0.25", "GY"
ds.FrameIncrementPointer = 0x3004000C
save(ds, "dose.dcm")
row("dose.dcm", phantom("u4"), straight, ORIGIN, "mm", rescale=(0.25, 0))

# Without positions: by number. Beside files that are no slices, in a pattern, in a list, packed.
os.mkdir("numbered")
for z in range(NZ):
    ds = image(phantom("u2")[z])
    ds.InstanceNumber, ds.SpacingBetweenSlices, ds.PixelSpacing = z + 9, "3.0", [2.0, 1.0]
    save(ds, f"numbered/{(z * 7) % 11}")
row("numbered", phantom("u2"), straight, unit="mm")
series("beside", phantom("u2"))
report = image(phantom("u2")[0])
for name in ["Rows", "Columns", "PixelData", "BitsAllocated"]:
    delattr(report, name)
save(report, "beside/report.dcm")
open("beside/notes.txt", "w").write("a note\n")
os.mkdir("beside/folder")
for z in range(NZ):
    save(place(image(phantom("u2")[z]), z), f"slice{(z * 7) % 11}.dcm")
row("slice*.dcm", phantom("u2"), straight, ORIGIN, "mm")
open("list.txt", "w").write("".join(f"slice{(z * 7) % 11}.dcm\n" for z in [1, 3, 2]))
row("list.txt", phantom("u2")[1:], straight, numpy.array(ORIGIN) + (0, 0, 3), "mm")
open("one.dcm.gz", "wb").write(gzip.compress(open("frames_explicit_i2", "rb").read()))
row("one.dcm.gz", phantom("i2"))
# A file of the group of meta data without a preamble.
open("bare", "wb").write(open("frames_explicit_i2", "rb").read()[132:])
row("bare", phantom("i2"))

# By SimpleITK, which has GDCM: slices as its own reader of series reads them back.
for key, compressed in {"itk": None, "itk_j2k": "JPEG2000", "itk_jpeg": "JPEG"}.items():
    for dtype in ["u1", "u2", "i2"]:
        for name, direction in {"straight": numpy.eye(3), "turned": turn}.items():
            folder = f"{key}_{dtype}_{name}"
            os.mkdir(folder)
            # GDCM codes no slices of a few pixels.
            volume = SimpleITK.GetImageFromArray(phantom(dtype, (NZ, 64, 66) if compressed else (NZ, NY, NX)))
            volume.SetSpacing(SPACING), volume.SetOrigin(ORIGIN), volume.SetDirection(numpy.ravel(direction).tolist())
            writer = SimpleITK.ImageFileWriter()
            writer.KeepOriginalImageUIDOn()
            if compressed:
                writer.UseCompressionOn(), writer.SetCompressor(compressed)
            for z in range(NZ):
                plane = volume[:, :, z]
                point = volume.TransformIndexToPhysicalPoint((0, 0, z))
                for tag, value in {
                    "0008|0060": "CT", "0020|000e": "1.2.3.4", "0020|0013": str(z), "0020|0032": "\\".join(map(repr, point)),
                    "0020|0037": "\\".join(repr(float(direction[i, j])) for j in range(2) for i in range(3)),
                }.items():
                    plane.SetMetaData(tag, value)
                writer.SetFileName(f"{folder}/{(z * 7) % 11}.dcm")
                writer.Execute(plane)
            reader = SimpleITK.ImageSeriesReader()
            reader.SetFileNames(reader.GetGDCMSeriesFileNames(folder))
            back = reader.Execute()
            vectors = (numpy.array(back.GetDirection()).reshape(3, 3) @ numpy.diag(back.GetSpacing())).T
            row(folder, SimpleITK.GetArrayFromImage(back).astype(dtype), vectors, back.GetOrigin(), "mm")
