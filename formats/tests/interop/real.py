# Files that no one here wrote, as packages carry them, against what the packages' own readers say. A row of two cells is refused
# with these words.
import glob
import nibabel, pydicom, SimpleITK, skimage.io, tifffile

pydicom_files = os.path.join(os.path.dirname(pydicom.__file__), "data", "test_files")
nibabel_files = os.path.dirname(nibabel.__file__)


def refused(path, words):
    table.append(f"{path}\t{words}")


def stored(path):
    """The numbers in a file of DICOM: pydicom's, or those of GDCM where pydicom has no decoder at hand."""
    try:
        return pydicom.pixels.pixel_array(path, raw=True)
    except Exception:
        ds = pydicom.dcmread(path, stop_before_pixels=True)
        assert (ds.get("RescaleSlope", 1), ds.get("RescaleIntercept", 0)) == (1, 0), path
        array = SimpleITK.GetArrayFromImage(SimpleITK.ReadImage(path))
        # What GDCM widens.
        kind = "iu"[ds.PixelRepresentation == 0]
        return array.astype(f"{kind}{ds.BitsAllocated // 8}")


def dicom_series(name, paths, near=0):
    """As its slices' positions say, each against the others."""
    sets = [pydicom.dcmread(path) for path in paths]
    one = sets[0]
    vectors = origin = None
    arrays = [stored(path) for path in paths]
    rescale = (float(one.get("RescaleSlope", one.get("DoseGridScaling", 1))), float(one.get("RescaleIntercept", 0)))
    array = arrays[0] if len(arrays) == 1 else numpy.stack(arrays)
    if "ImageOrientationPatient" in one and one.ImageOrientationPatient:
        x, y = [v / numpy.linalg.norm(v) for v in numpy.array(one.ImageOrientationPatient, float).reshape(2, 3)]
        normal = numpy.cross(x, y)
        rows, columns = map(float, one.PixelSpacing)
        if "GridFrameOffsetVector" in one and array.ndim == 3:
            places = [numpy.array(one.ImagePositionPatient, float) + normal * (float(o) - float(one.GridFrameOffsetVector[0]))
                      for o in one.GridFrameOffsetVector]
        else:
            places = [numpy.array(ds.ImagePositionPatient, float) for ds in sets]
        order = sorted(range(len(places)), key=lambda i: places[i] @ normal)
        origin = places[order[0]]
        if len(places) > 1:
            array = array[order]
            step = (places[order[-1]] - origin) / (len(places) - 1)
        else:
            step = normal * float(one.get("SpacingBetweenSlices") or one.get("SliceThickness") or 1)
        vectors = straightened(numpy.array([x * columns, y * rows, step]).T)
    row(name, array, vectors, origin, "mm" if vectors is not None else None, rescale, near=near)


def straightened(vectors):
    """The nearest axes at right angles, a column each: headers have few digits."""
    lengths = numpy.linalg.norm(vectors, axis=0)
    u, _, v = numpy.linalg.svd(vectors / lengths)
    return ((u @ v) * lengths).T


def has_magic(path):
    with open(path, "rb") as file:
        start = file.read(132)
    return start[128:] == b"DICM" or start[:8] == b"\2\0\0\0UL\4\0"


# What is wrong in these: made broken, or thinned out, by those who keep them.
WRONG = {
    "csa_slice_norm.dcm": "PixelData: there is none", "MR_truncated.dcm": "ends after 8130 of its 8192 bytes",
    "rtplan_truncated.dcm": "the file ends in it", "badVR.dcm": "NumberOfFrames: `1A`",
    "JPEG2000-embedded-sequence-delimiter.dcm": "PixelData: JPEG 2000",
    # Of 12 bits in lossy JPEG, which we do not decode.
    "JPEG-lossy.dcm": "the image has 12 bits", "JPGExtended.dcm": "the image has 12 bits",
}
WRONG_FOLDERS = {
    "dicomdirtests": "no image", "SE000000": "no image", "CT2": "161 slices are missing", "CT2N": "ImageOrientationPatient",
    "MR1": "3 series: MR series 1 `FAST LOCALIZER`", "MR2": "3 series", "MR700": "ImageOrientationPatient",
}
paths = glob.glob(f"{pydicom_files}/*") + glob.glob(f"{nibabel_files}/**/*.dcm", recursive=True)
for path in sorted(path for path in paths if os.path.isfile(path)):
    if not has_magic(path):
        continue
    ds, name = pydicom.dcmread(path), os.path.basename(path)
    if name in WRONG:
        refused(path, WRONG[name])
    elif "Rows" not in ds:
        refused(path, "no image")
    elif ds.get("SamplesPerPixel", 1) > 1 or ds.PhotometricInterpretation.startswith("PALETTE"):
        refused(path, "colour")
    else:
        dicom_series(path, [path], near=1 if name == "JPEG2000.dcm" else 0)
for folder in sorted(glob.glob(f"{pydicom_files}/dicomdirtests/**/", recursive=True)):
    paths = [path for path in glob.glob(f"{folder}*") if os.path.isfile(path) and has_magic(path)]
    name = os.path.basename(folder.rstrip("/"))
    if name in WRONG_FOLDERS:
        refused(folder, WRONG_FOLDERS[name])
    elif len(paths) > 1:
        dicom_series(folder, paths)

# NIfTI and Analyze, by nibabel; of several times the first.
NO_NIFTI = {"nifti1.hdr": ".img", "nifti2.hdr": ".img", "analyze.hdr": ".img", "row_major.dconn.nii": "dim[5]"}
for path in sorted(glob.glob(f"{nibabel_files}/tests/data/*.nii*") + glob.glob(f"{nibabel_files}/tests/data/*.hdr")):
    if os.path.basename(path) in NO_NIFTI:
        refused(path, NO_NIFTI[os.path.basename(path)])
        continue
    stored_image = nibabel.load(path)
    data = numpy.asarray(stored_image.dataobj.get_unscaled())
    data = data[..., 0] if data.ndim == 4 else data
    affine = numpy.diag([-1.0, -1.0, 1.0, 1.0]) @ stored_image.affine
    unit = {"mm": "mm", "micron": "um", "meter": "m"}.get(stored_image.header.get_xyzt_units()[0])
    slope, inter = stored_image.dataobj.slope, stored_image.dataobj.inter
    row(path, data.T, straightened(affine[:3, :3]), affine[:3, 3], unit, (slope, inter))

# Arrays of NumPy, and pictures and pages of scikit-image.
package = os.path.dirname(numpy.__file__)
for path in sorted(glob.glob(f"{package}/lib/tests/data/*.npy")):
    refused(path, "descr" if "objarr" in path else "shape")
path = os.path.join(os.path.dirname(skimage.__file__), "data")
row(f"{path}/multipage.tif", tifffile.imread(f"{path}/multipage.tif"))
row(f"{path}/lfw_subset.npy", numpy.load(f"{path}/lfw_subset.npy"))
for name in ["camera", "coins", "text", "page", "moon", "clock_motion", "brick", "grass", "gravel", "microaneurysms"]:
    row(f"{path}/{name}.png", skimage.io.imread(f"{path}/{name}.png"))
for name in ["astronaut", "chelsea", "coffee"]:
    refused(f"{path}/{name}.png", "colour")
refused(f"{path}/multipage_rgb.tif", "PlanarConfiguration")
