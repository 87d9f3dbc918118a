//! Other people's Zarr implementations open our stores and read equal voxels: zarrs (Rust) and zarr-python.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use brickcast_volume::format::{FormatError, SourceHeader, VolumeSource, VoxelType};
use brickcast_volume::space::Geometry;
use brickcast_volume::store::{ChunkCache, PrepareOptions, RegionOptions, Segmentation, SeriesWriter, Store, prepare};
use zarrs::array::{Array, ElementOwned, FromArrayBytes};
use zarrs::filesystem::FilesystemStore;

/// Odd on every axis, over a chunk's face on y and z and a shard's on x.
const DIMS: [u32; 3] = [261, 45, 67];

#[derive(Debug)]
struct MemorySource {
    header: SourceHeader,
    bytes: Vec<u8>,
    next: usize,
}

impl VolumeSource for MemorySource {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.next = 0;
        Ok(())
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        let plane = (DIMS[0] * DIMS[1]) as usize * self.header.voxel_type.bytes();
        let end = (self.next + count as usize * plane).min(self.bytes.len());
        planes.clear();
        planes.extend_from_slice(&self.bytes[self.next..end]);
        self.next = end;
        Ok(())
    }
}

/// Noise, x fastest; zeros at first, so that some inner chunks are absent.
fn noise() -> Vec<u16> {
    let [nx, ny, nz] = DIMS;
    let voxels = (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| (x, y, z))));
    voxels
        .map(|(x, y, z)| {
            let h = x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77) ^ z.wrapping_mul(0xC2B2_AE3D);
            if x < 40 && y < 40 && z < 40 { 0 } else { ((h ^ h >> 15).wrapping_mul(0x2C1B_3C6D) >> 12) as u16 }
        })
        .collect()
}

fn make_store(path: &Path, voxel_type: VoxelType, bytes: Vec<u8>) {
    let geometry = Geometry::new(DIMS, [0.25, 0.5, 1.5], [1.0, -2.0, 3.5]).unwrap();
    let header = SourceHeader { space_unit: Some("mm".into()), ..SourceHeader::new("memory", geometry, voxel_type) };
    let segmentation = Segmentation::Windows { range: 0.4 };
    let options = PrepareOptions {
        source_name: Some("a \"quoted\" name.nrrd".into()),
        regions: Some(RegionOptions { segmentation, min_region: 0 }),
        ..PrepareOptions::default()
    };
    prepare(&mut MemorySource { header, bytes, next: 0 }, path, &options, &mut |_| {}).unwrap();
}

/// Labels and distances of the whole store as we read them, x fastest.
fn our_regions(path: &Path) -> (Vec<u32>, Vec<u8>) {
    let store = Store::open(path).unwrap();
    let grid = store.manifest().grid;
    let voxels = DIMS.iter().product::<u32>() as usize;
    let (mut labels, mut distances) = (vec![0; voxels], vec![0; voxels]);
    let cache = ChunkCache::new(1 << 24);
    for brick in grid.bricks() {
        let read = store.read_brick_regions(brick, 0, &cache).unwrap();
        let (lo, d) = (read.covered.lo.as_uvec3(), read.covered.dims());
        for i in 0..read.labels.len() as u32 {
            let [x, y, z] = [lo.x + i % d.x, lo.y + i / d.x % d.y, lo.z + i / d.x / d.y];
            let to = (x + DIMS[0] * (y + DIMS[1] * z)) as usize;
            labels[to] = read.labels[i as usize];
            distances[to] = read.distances[i as usize];
        }
    }
    assert!(labels.contains(&1) && labels.contains(&0), "the test's volume must have voxels in and outside regions");
    (labels, distances)
}

fn zarrs_reads<T>(voxel_type: VoxelType, voxels: &[T], to_le: impl Fn(&T) -> Vec<u8>)
where
    T: ElementOwned + PartialEq + std::fmt::Debug,
    Vec<T>: FromArrayBytes,
{
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.zarr");
    make_store(&path, voxel_type, voxels.iter().flat_map(to_le).collect());
    let array = Array::open(Arc::new(FilesystemStore::new(&path).unwrap()), "/0").unwrap();
    assert_eq!(array.shape(), [u64::from(DIMS[2]), u64::from(DIMS[1]), u64::from(DIMS[0])]);
    let names: Vec<_> = array.dimension_names().clone().unwrap().into_iter().flatten().collect();
    assert_eq!(names, ["z", "y", "x"]);
    let read: Vec<T> = array.retrieve_array_subset(&array.subset_all()).unwrap();
    assert!(read == voxels, "zarrs reads other voxels of {voxel_type:?}");
    let (labels, distances) = our_regions(&path);
    let store = Arc::new(FilesystemStore::new(&path).unwrap());
    let array = Array::open(store.clone(), "/labels/regions/0").unwrap();
    assert!(array.retrieve_array_subset::<Vec<u32>>(&array.subset_all()).unwrap() == labels, "other labels");
    let array = Array::open(store, "/distances").unwrap();
    assert!(array.retrieve_array_subset::<Vec<u8>>(&array.subset_all()).unwrap() == distances, "other distances");
}

#[test]
fn zarrs_reads_equal_voxels() {
    let noise = noise();
    let bytes: Vec<u8> = noise.iter().map(|v| (v >> 8) as u8).collect();
    zarrs_reads(VoxelType::U8, &bytes, |v| vec![*v]);
    let signed: Vec<i8> = bytes.iter().map(|v| *v as i8).collect();
    zarrs_reads(VoxelType::I8, &signed, |v| v.to_le_bytes().to_vec());
    zarrs_reads(VoxelType::U16, &noise, |v| v.to_le_bytes().to_vec());
    let signed: Vec<i16> = noise.iter().map(|v| *v as i16).collect();
    zarrs_reads(VoxelType::I16, &signed, |v| v.to_le_bytes().to_vec());
}

/// Opens the store at argv[1] by its metadata alone, and compares its voxels with the raw file at argv[2] of dtype
/// argv[3].
const PYTHON: &str = r#"
import sys, numpy, zarr
store, raw, dtype, labels, distances = sys.argv[1:6]
group = zarr.open_group(store, mode="r")
(image,) = group.attrs["ome"]["multiscales"]
assert group.attrs["ome"]["version"] == "0.5", group.attrs["ome"]
assert image["name"] == 'a "quoted" name.nrrd', image
assert image["axes"] == [{"name": n, "type": "space", "unit": "millimeter"} for n in "zyx"], image["axes"]
datasets = image["datasets"]
dataset = datasets[0]
assert [d["path"] for d in datasets] == ["0", "1", "2", "3"], datasets
scale, translation = dataset["coordinateTransformations"]
assert scale == {"type": "scale", "scale": [1.5, 0.5, 0.25]}, scale
assert translation == {"type": "translation", "translation": [3.5, -2.0, 1.0]}, translation
array = group[dataset["path"]]
assert array.dtype == numpy.dtype(dtype), array.dtype
assert tuple(array.metadata.dimension_names) == ("z", "y", "x")
assert array.attrs["brickcast"]["scale"] == 1.0
want = numpy.fromfile(raw, dtype=dtype).reshape(array.shape)
assert numpy.array_equal(array[...], want), "other voxels"
assert numpy.array_equal(array[30:41, 3:4, 250:], want[30:41, 3:4, 250:]), "other voxels in part"
assert group["labels"].attrs["ome"] == {"version": "0.5", "labels": ["regions"]}, group["labels"].attrs["ome"]
label = group["labels/regions"]
(levels,) = label.attrs["ome"]["multiscales"]
assert label.attrs["ome"]["image-label"] == {"source": {"image": "../../"}}, label.attrs["ome"]
assert levels["axes"] == image["axes"] and levels["datasets"] == datasets, levels
array = label[levels["datasets"][0]["path"]]
assert array.dtype == numpy.uint32 and array.shape == want.shape
assert numpy.array_equal(array[...], numpy.fromfile(labels, dtype="<u4").reshape(array.shape)), "other labels"
def sums(voxels, n):
    for axis in range(3):
        voxels = numpy.add.reduceat(voxels, range(0, voxels.shape[axis], n), axis)
    return voxels
for level, dataset in enumerate(datasets):
    n = 2**level
    scale, translation = (t[t["type"]] for t in dataset["coordinateTransformations"])
    assert scale == [1.5 * n, 0.5 * n, 0.25 * n], scale
    assert translation == [3.5 + 0.75 * (n - 1), -2.0 + 0.25 * (n - 1), 1.0 + 0.125 * (n - 1)], translation
    total, count = sums(want.astype("i8"), n), sums(numpy.ones(want.shape, "i8"), n)
    array = group[dataset["path"]]
    assert array.dtype == numpy.dtype(dtype) and array.shape == total.shape, (level, array.shape)
    assert array.attrs["brickcast"] == group["0"].attrs["brickcast"], level
    assert numpy.array_equal(array[...], (2 * total + count) // (2 * count)), f"level {level} is not of means"
    array = label[dataset["path"]]
    assert array.dtype == numpy.uint32 and array.shape == total.shape and array[...].max() > 0, level
    if level > 0:
        array = zarr.open_array(store, path=f"levels/{level}/distances", mode="r")
        assert array.dtype == numpy.uint8 and array.shape == total.shape and array[...].max() >= 3, level
array = group["distances"]
assert array.dtype == numpy.uint8
assert numpy.array_equal(array[...], numpy.fromfile(distances, dtype="u1").reshape(array.shape)), "other distances"
"#;

fn python_reads(voxel_type: VoxelType, dtype: &str, bytes: Vec<u8>) {
    let dir = tempfile::tempdir().unwrap();
    let (store, raw) = (dir.path().join("s.zarr"), dir.path().join("raw"));
    std::fs::write(&raw, &bytes).unwrap();
    make_store(&store, voxel_type, bytes);
    let (labels, distances) = our_regions(&store);
    let (label_file, distance_file) = (dir.path().join("labels"), dir.path().join("distances"));
    std::fs::write(&label_file, labels.iter().flat_map(|l| l.to_le_bytes()).collect::<Vec<_>>()).unwrap();
    std::fs::write(&distance_file, distances).unwrap();
    let mut python = Command::new("python3");
    python.args(["-c", PYTHON]).arg(&store).arg(&raw).arg(dtype).args([label_file, distance_file]);
    let output = python.output().unwrap();
    assert!(output.status.success(), "{dtype}: {}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn zarr_python_reads_equal_voxels_and_the_ome_metadata() {
    let probe = Command::new("python3")
        .args(["-c", "import zarr, sys; sys.exit(int(zarr.__version__.split('.')[0]) < 3)"])
        .output();
    if !probe.is_ok_and(|p| p.status.success()) {
        brickcast_harness::ignore("python3 with zarr >= 3 is missing: pip install 'zarr>=3'");
    }
    let noise = noise();
    let low: Vec<u8> = noise.iter().map(|v| (v >> 8) as u8).collect();
    let words: Vec<u8> = noise.iter().flat_map(|v| v.to_le_bytes()).collect();
    python_reads(VoxelType::U8, "uint8", low.clone());
    python_reads(VoxelType::I8, "int8", low);
    python_reads(VoxelType::U16, "<u2", words.clone());
    python_reads(VoxelType::I16, "<i2", words);
}

/// Opens the series at argv[1] as a collection of images, by zarr-python and, where it is there, by ome-zarr-py; the
/// voxels of step i are those of the raw file at argv[2 + i].
const PYTHON_SERIES: &str = r#"
import sys, numpy, zarr
series, raws = sys.argv[1], sys.argv[2:]
group = zarr.open_group(series, mode="r")
assert group.attrs["ome"] == {"version": "0.5", "bioformats2raw.layout": 3}, group.attrs["ome"]
names = group["OME"].attrs["ome"]["series"]
assert names == [str(i) for i in range(len(raws))], names
for name, raw in zip(names, raws):
    (image,) = group[name].attrs["ome"]["multiscales"]
    array = group[name][image["datasets"][0]["path"]]
    assert numpy.array_equal(array[...], numpy.fromfile(raw, dtype="<u2").reshape(array.shape)), name
try:
    import ome_zarr.io, ome_zarr.reader
except ImportError:
    sys.exit(3)
for name, raw in zip(names, raws):
    (node,) = ome_zarr.reader.Reader(ome_zarr.io.parse_url(f"{series}/{name}"))()
    levels = node.data
    assert len(levels) == 4, len(levels)
    want = numpy.fromfile(raw, dtype="<u2").reshape(levels[0].shape)
    assert numpy.array_equal(numpy.asarray(levels[0]), want), name
"#;

#[test]
fn a_series_is_a_collection_of_images_to_others() {
    let probe = Command::new("python3")
        .args(["-c", "import zarr, sys; sys.exit(int(zarr.__version__.split('.')[0]) < 3)"])
        .output();
    if !probe.is_ok_and(|p| p.status.success()) {
        brickcast_harness::ignore("python3 with zarr >= 3 is missing: pip install 'zarr>=3'");
    }
    let dir = tempfile::tempdir().unwrap();
    let geometry = Geometry::new(DIMS, [0.25, 0.5, 1.5], [1.0, -2.0, 3.5]).unwrap();
    let header = SourceHeader::new("memory", geometry, VoxelType::U16);
    let series = dir.path().join("series.zarr");
    let mut writer = SeriesWriter::create(&series, &PrepareOptions::default(), &[]).unwrap();
    let mut sources: Vec<MemorySource> = (0..2_u16)
        .map(|step| {
            let bytes = noise().iter().flat_map(|v| (v / 2 + 1000 * step).to_le_bytes()).collect();
            MemorySource { header: header.clone(), bytes, next: 0 }
        })
        .collect();
    sources.iter_mut().for_each(|source| writer.look_at(source, &mut |_| {}).unwrap());
    for source in &mut sources {
        source.rewind().unwrap();
        writer.add(source, (None, None), &mut |_| {}).unwrap();
    }
    writer.finish(&[], None).unwrap();
    let mut python = Command::new("python3");
    python.args(["-W", "ignore", "-c", PYTHON_SERIES]).arg(&series);
    for (step, source) in sources.iter().enumerate() {
        let raw = dir.path().join(format!("raw{step}"));
        std::fs::write(&raw, &source.bytes).unwrap();
        python.arg(raw);
    }
    let output = python.output().unwrap();
    match output.status.code() {
        Some(0) => {}
        Some(3) => brickcast_harness::leave_out("python3 lacks ome-zarr: pip install ome-zarr"),
        _ => panic!("{}", String::from_utf8_lossy(&output.stderr)),
    }
}
