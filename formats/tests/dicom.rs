//! Series of DICOM: what is out of place is refused by the name of its file; what is said of values is kept.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers of tests are tests

#[path = "common/dicom.rs"]
mod written;

use std::path::Path;

use brickcast_formats::{is_stack, open};
use brickcast_volume::format::{FormatError, RawHints, VolumeSource, VoxelType};
use written::Slice;

type Change<'a> = &'a dyn Fn(&mut Slice);

/// Slices 0 to 4 under names that rise the other way, changed where asked.
fn series(changes: &[(u16, Change<'_>)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for z in 0..5 {
        let mut slice = Slice::at(z);
        changes.iter().filter(|(at, _)| *at == z).for_each(|(_, change)| change(&mut slice));
        std::fs::write(folder.path().join(format!("im{}", 4 - z)), slice.bytes()).unwrap();
    }
    folder
}

fn opened(path: &Path) -> Result<Box<dyn VolumeSource>, FormatError> {
    open(path, &RawHints::default())
}

fn refused(path: &Path, want: &[&str]) {
    let error = opened(path).map(|mut source| source.read_planes(u32::MAX >> 8, &mut Vec::new()));
    let error = error.and_then(|read| read).expect_err("must be refused").to_string();
    want.iter().for_each(|want| assert!(error.contains(want), "no {want} in: {error}"));
}

/// One slice alone, changed.
fn one_refused(change: Change<'_>, want: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let (path, mut slice) = (folder.path().join("one"), Slice::at(3));
    change(&mut slice);
    std::fs::write(&path, slice.bytes()).unwrap();
    refused(&path, &[want, &["one"]].concat());
}

fn values(path: &Path) -> Vec<u16> {
    let mut planes = Vec::new();
    opened(path).unwrap().read_planes(1000, &mut planes).unwrap();
    planes.chunks(24).map(|plane| u16::from_le_bytes([plane[0], plane[1]])).collect()
}

const POSITION: u32 = 0x0020_0032;
const ORIENTATION: u32 = 0x0020_0037;

#[test]
fn slices_lie_where_their_positions_say() {
    let folder = series(&[]);
    assert!(is_stack(folder.path()));
    assert_eq!(values(folder.path()), [0, 1, 2, 3, 4]);
    let source = opened(folder.path()).unwrap();
    let header = source.header();
    // Rows are half a millimetre apart, columns a quarter.
    assert_eq!(header.geometry.spacing().to_array(), [0.25, 0.5, 2.5]);
    assert_eq!(header.geometry.origin().to_array(), [1.0, 2.0, 0.0]);
    assert_eq!((header.space_unit.as_deref(), source.files().len()), (Some("mm"), 5));
    let notes = header.notes.join("\n");
    assert!(notes.contains("5 files of CT `chest`") && notes.contains("sorted by position"), "{notes}");
    // A pattern and a list take some of them, in their places all the same.
    assert_eq!(values(&folder.path().join("im[1-3]")), [1, 2, 3]);
    std::fs::write(folder.path().join("list.txt"), "im1\nim0\n").unwrap();
    assert_eq!(values(&folder.path().join("list.txt")), [3, 4]);
    let hints = RawHints { spacing: Some([1.0, 2.0, 3.0]), ..RawHints::default() };
    let source = open(folder.path(), &hints).unwrap();
    assert_eq!(source.header().geometry.spacing().to_array(), [1.0, 2.0, 3.0]);
}

#[test]
fn what_is_out_of_place_is_named() {
    let at = |text: &'static str| move |slice: &mut Slice| slice.text(POSITION, b"DS", text);
    let folder = series(&[]);
    std::fs::remove_file(folder.path().join("im2")).unwrap();
    refused(folder.path(), &["im3 and im1 lie 5.0000 mm apart, others 2.5000: 1 slices are missing"]);
    refused(series(&[(2, &at("1\\2\\7.5"))]).path(), &["im1", "im2", "lie at the same place, 2 slices", "echoes"]);
    refused(series(&[(2, &at("1\\2\\5.5"))]).path(), &["not even: from 2.0000 to 3.0000 mm", "resample"]);
    refused(series(&[(2, &at("1.1\\2\\5"))]).path(), &["im2", "im2 lies 0.1000 mm aside"]);
    refused(series(&[(2, &at(""))]).path(), &["im2 has none, but 4 others have one"]);
    refused(series(&[(2, &at("1\\2"))]).path(), &["im2", "ImagePositionPatient", "2 numbers instead of 3"]);
    refused(series(&[(2, &at("1\\2\\x"))]).path(), &["im2", "x` is no decimal number"]);
    let tilts: Vec<_> =
        (0..5).map(|z| move |s: &mut Slice| s.text(POSITION, b"DS", &format!("1\\{}\\{}", z * 2, z * 5))).collect();
    let tilts: Vec<(u16, Change<'_>)> = (0..).zip(&tilts).map(|(z, tilt)| (z, tilt as Change<'_>)).collect();
    refused(series(&tilts).path(), &["the gantry was tilted by 21.80 degrees", "resample"]);
    // Rounded decimals are no gap.
    let folder = series(&[(2, &at("1\\2\\5.01")), (3, &at("1.0001\\2\\7.5"))]);
    assert_eq!(values(folder.path()), [0, 1, 2, 3, 4]);
    let notes = opened(folder.path()).unwrap().header().notes.join("\n");
    assert!(notes.contains("0.0100 mm beside an even step of 2.5000 mm"), "{notes}");
}

#[test]
fn holes_are_filled_where_the_user_says_so() {
    let at = |text: &'static str| move |slice: &mut Slice| slice.text(POSITION, b"DS", text);
    let mend = |folder: &Path, no_data: Option<f64>| {
        let hints = RawHints { skip_broken: true, no_data, ..RawHints::default() };
        let mut source = open(folder, &hints)?;
        let mut planes = Vec::new();
        source.read_planes(99, &mut planes)?;
        let header = source.header();
        let first = |plane: &[u8]| u16::from_le_bytes([plane[0], plane[1]]);
        Ok::<_, FormatError>((planes.chunks(24).map(first).collect::<Vec<_>>(), header.clone()))
    };
    // Whole, it is what it was.
    assert_eq!(mend(series(&[]).path(), None).unwrap().0, [0, 1, 2, 3, 4]);
    let folder = series(&[(4, &at("1\\2\\15"))]);
    std::fs::remove_file(folder.path().join("im3")).unwrap();
    let (planes, header) = mend(folder.path(), Some(77.0)).unwrap();
    assert_eq!(planes, [0, 77, 2, 3, 77, 77, 4]);
    assert_eq!(header.geometry.spacing().to_array(), [0.25, 0.5, 2.5]);
    let notes = header.notes.join("\n");
    for want in ["--skip-broken: 3 of 7 slices were filled with 77", "filled: between im4 and im2, which is missing"] {
        assert!(notes.contains(want), "no {want} in {notes}");
    }
    // One unlike the others, one that is no image, one that is doubled, one that cannot be decoded.
    let broken = |s: &mut Slice| s.fragments("1.2.840.10008.1.2.5", &[b"nothing"]);
    let folder = series(&[(0, &|s| s.short(0x0028_0120, 9)), (1, &broken), (2, &|s| s.short(0x0028_0103, 1))]);
    std::fs::write(folder.path().join("im9"), Slice::at(4).bytes()).unwrap();
    std::fs::write(folder.path().join("im8"), &Slice::at(9).bytes()[..300]).unwrap();
    let (planes, header) = mend(folder.path(), None).unwrap();
    let notes = header.notes.join("\n");
    assert_eq!(planes, [0, 9, 9, 3, 4], "{notes}");
    for want in ["left out: ", "im2, which is of another", "im9, which lies where im0 does", "im8: DICOM", "im3: DICOM"]
    {
        assert!(notes.contains(want), "no {want} in {notes}");
    }
    let folder = tempfile::tempdir().unwrap();
    let mut one = Slice::at(0);
    broken(&mut one);
    std::fs::write(folder.path().join("one"), one.bytes()).unwrap();
    assert!(mend(folder.path(), None).unwrap_err().to_string().contains("no slice can be read"));
    std::fs::write(folder.path().join("one"), &one.bytes()[..300]).unwrap();
    assert!(mend(folder.path(), None).unwrap_err().to_string().contains("one"));
}

#[test]
fn of_several_slices_at_each_place_one_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: String, z: u16, time: u16| {
        let mut slice = Slice::at(z).pixels(&[10 * time + z; 12].map(u16::to_le_bytes).concat());
        // Counted from the top, time by time; the times themselves say which comes first.
        slice.text(0x0020_0013, b"IS", &(100 - 5 * time - z).to_string());
        slice.text(0x0020_0100, b"IS", &time.to_string());
        std::fs::write(folder.path().join(name), slice.bytes()).unwrap();
    };
    (0..15).for_each(|i| write(format!("im{i}"), i % 5, i / 5));
    let values_at = |time: u64| {
        let hints = RawHints { time: Some(time), ..RawHints::default() };
        let mut planes = Vec::new();
        open(folder.path(), &hints).and_then(|mut source| {
            assert!(!source.header().notes.join(" ").contains("are for OME-Zarr"), "{:?}", source.header().notes);
            source.read_planes(9, &mut planes)
        })?;
        Ok::<_, FormatError>(
            planes.chunks(24).map(|plane| u16::from_le_bytes([plane[0], plane[1]])).collect::<Vec<_>>(),
        )
    };
    assert_eq!(values_at(0).unwrap(), [0, 1, 2, 3, 4]);
    assert_eq!(values_at(2).unwrap(), [20, 21, 22, 23, 24]);
    let want = ["3 slices lie at each of 5 places", "--time 0 to 2 takes one of each"];
    refused(folder.path(), &want);
    assert!(values_at(3).unwrap_err().to_string().contains(want[1]));
    std::fs::remove_file(folder.path().join("im7")).unwrap();
    refused(folder.path(), &["lie at the same place, 3 slices there in all"]);
}

#[test]
fn what_is_unlike_the_others_is_named() {
    let cases: [(Change<'_>, &str); 6] = [
        (&|s| s.short(0x0028_0010, 2), "it is 4 x 2 pixels"),
        (&|s| s.short(0x0028_0103, 1), "pixels of int16"),
        (&|s| [(0x0028_0101, 12), (0x0028_0102, 11)].iter().for_each(|(t, n)| s.short(*t, *n)), "12 bits"),
        (&|s| s.text(ORIENTATION, b"DS", "0\\1\\0\\0\\0\\1"), "ImageOrientationPatient"),
        (&|s| s.text(ORIENTATION, b"DS", "0\\1\\0\\0\\1\\0"), "span no plane"),
        (&|s| s.text(0x0028_0030, b"DS", "0.5\\0.3"), "PixelSpacing"),
    ];
    for (change, want) in cases {
        refused(series(&[(2, change)]).path(), &["im2", want]);
    }
    let other = |s: &mut Slice| {
        s.text(0x0020_000e, b"UI", "1.9");
        s.text(0x0008_103e, b"LO", "scout");
    };
    let folder = series(&[(0, &other), (1, &other)]);
    let want = ["2 series: ", "CT `chest` (3 files, one of them im0)", "CT `scout` (2 files, one of them im3)"];
    refused(folder.path(), &[&want[..], &["by a pattern in quotes or a list"]].concat());
    assert_eq!(values(&folder.path().join("im[0-2]")), [2, 3, 4]);
    let folder = series(&[]);
    std::fs::write(folder.path().join("text"), "no slice").unwrap();
    assert_eq!(values(folder.path()).len(), 5);
    std::fs::write(folder.path().join("list.txt"), "im1\ntext\n").unwrap();
    refused(&folder.path().join("list.txt"), &["text", "it is no DICOM"]);
    std::fs::write(folder.path().join("a.png"), "no slice").unwrap();
    refused(folder.path(), &["a.png", "im0", "of different kinds"]);
}

#[test]
fn without_positions_numbers_count() {
    let bare = |slice: &mut Slice| slice.without(POSITION);
    let numbered = |number: &'static str| {
        move |s: &mut Slice| {
            s.without(POSITION);
            s.text(0x0020_0013, b"IS", number);
        }
    };
    let all = |third: Change<'_>| series(&[(0, &bare), (1, &bare), (2, third), (3, &bare), (4, &bare)]);
    let folder = all(&bare);
    assert_eq!(values(folder.path()), [0, 1, 2, 3, 4]);
    let notes = opened(folder.path()).unwrap().header().notes.join("\n");
    assert!(
        notes.contains("in the order of InstanceNumber") && notes.contains("spacing not said from slice to slice"),
        "{notes}"
    );
    refused(all(&numbered("3")).path(), &["im1 and im2 both have the number 3"]);
    refused(all(&numbered("9")).path(), &["2 is missing, between im3 and im1"]);
    refused(all(&numbered("")).path(), &["im2 has neither this nor an InstanceNumber"]);
}

#[test]
fn what_cannot_be_read_is_refused_with_what_to_do() {
    let rgb = |s: &mut Slice| {
        s.short(0x0028_0002, 3);
        s.text(0x0028_0004, b"CS", "RGB");
    };
    one_refused(&rgb, &["colour", "`RGB`", "to grey"]);
    one_refused(&|s| s.text(0x0028_0004, b"CS", "PALETTE COLOR"), &["colour"]);
    one_refused(&|s| s.short(0x0028_0100, 12), &["BitsAllocated", "12 bits a pixel"]);
    one_refused(&|s| s.short(0x0028_0101, 17), &["BitsStored"]);
    one_refused(&|s| s.syntax = "1.2.3.4".into(), &["TransferSyntaxUID", "`1.2.3.4`", "gdcmconv"]);
    let jxl = |s: &mut Slice| s.fragments("1.2.840.10008.1.2.4.110", &[b"jxl"]);
    one_refused(&jxl, &["JPEG XL Lossless is not decoded here", "gdcmconv", "dcmdjpeg"]);
    for syntax in ["5", "4.50", "4.70", "4.80", "4.90"] {
        let broken = |s: &mut Slice| s.fragments(&format!("1.2.840.10008.1.2.{syntax}"), &[b"nothing"]);
        one_refused(&broken, &["PixelData"]);
    }
    one_refused(&|s| s.put(0x7fe0_0010, b"OW", &[0; 22]), &["PixelData", "22 bytes for 1 frames of 24"]);
    one_refused(&|s| s.without(0x7fe0_0010), &["PixelData", "there is none"]);
    one_refused(&|s| s.without(0x0028_0010), &["no image", "DICOMDIR"]);
    one_refused(&|s| s.text(0x0028_1053, b"DS", "0"), &["RescaleSlope", "0, RescaleIntercept 0"]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut");
    let whole = Slice::at(0).bytes();
    for length in 132..whole.len() {
        std::fs::write(&path, &whole[..length]).unwrap();
        refused(&path, &["cut"]);
    }
}

#[test]
fn what_is_assumed_is_said() {
    let mosaic = |s: &mut Slice| {
        s.text(0x0008_0008, b"CS", "ORIGINAL\\PRIMARY\\MOSAIC");
        s.without(0x0028_0030);
        s.text(0x0028_2110, b"CS", "01");
    };
    let all: Vec<(u16, Change<'_>)> = (0..5).map(|z| (z, &mosaic as Change<'_>)).collect();
    let folder = series(&all);
    let source = opened(folder.path()).unwrap();
    assert_eq!(source.header().geometry.spacing().to_array(), [1.0, 1.0, 2.5]);
    let notes = source.header().notes.join("\n");
    for want in [
        "spacing not said in the plane (PixelSpacing): 1, 1 assumed",
        "a mosaic: its slices lie side by side",
        "compressed with loss",
    ] {
        assert!(notes.contains(want), "no {want} in {notes}");
    }
    let detector = |s: &mut Slice| {
        s.without(0x0028_0030);
        s.text(0x0018_1164, b"DS", "0.5\\0.25");
    };
    let folder = series(&[(0, &detector)]);
    let source = opened(&folder.path().join("im4")).unwrap();
    assert_eq!(source.header().geometry.spacing().to_array(), [0.25, 0.5, 1.0]);
    let notes = source.header().notes.join("\n");
    assert!(notes.contains("the detector's") && notes.contains("a single slice"), "{notes}");
}

#[test]
fn what_numbers_mean_is_kept() {
    let hounsfield = |s: &mut Slice| {
        let texts: [(u32, &[u8; 2], &str); 4] = [
            (0x0028_1052, b"DS", "-1024"),
            (0x0028_1053, b"DS", "2"),
            (0x0028_1054, b"LO", "HU"),
            (0x0028_0004, b"CS", "MONOCHROME1"),
        ];
        texts.iter().for_each(|(tag, vr, text)| s.text(*tag, vr, text));
        s.short(0x0028_0120, 63536);
        s.short(0x0028_0103, 1);
    };
    let all: Vec<(u16, Change<'_>)> = (0..5).map(|z| (z, &hounsfield as Change<'_>)).collect();
    let folder = series(&all);
    let source = opened(folder.path()).unwrap();
    let header = source.header();
    assert_eq!((header.rescale.after(1.0, 0.0), header.no_data.as_slice()), ((2.0, -1024.0), &[-2000.0][..]));
    assert_eq!(header.voxel_type, VoxelType::I16);
    let notes = header.notes.join("\n");
    for want in ["Hounsfield", "MONOCHROME1", "-2000 stands for no data", "2 times the voxels' numbers"] {
        assert!(notes.contains(want), "no {want} in {notes}");
    }
    // One slice whose slope is another makes all of them values.
    let other = |s: &mut Slice| s.text(0x0028_1053, b"DS", "0.1");
    let folder = series(&[(3, &other)]);
    let mut source = opened(folder.path()).unwrap();
    assert_eq!(source.header().voxel_type, VoxelType::F64);
    let mut planes = Vec::new();
    source.read_planes(5, &mut planes).unwrap();
    let numbers: Vec<f64> = planes.chunks(96).map(|p| f64::from_le_bytes(p[..8].try_into().unwrap())).collect();
    assert_eq!(numbers, [0.0, 1.0, 2.0, 0.1 * 3.0, 4.0]);
    // Nor can a volume have values that fall with the numbers.
    let falling = |s: &mut Slice| s.text(0x0028_1053, b"DS", "-0.5");
    let all: Vec<(u16, Change<'_>)> = (0..5).map(|z| (z, &falling as Change<'_>)).collect();
    opened(series(&all).path()).unwrap().read_planes(5, &mut planes).unwrap();
    assert_eq!(f64::from_le_bytes(planes[4 * 96..4 * 96 + 8].try_into().unwrap()), -2.0);
}

#[test]
fn a_damaged_slice_among_sound_ones_is_read_or_named() {
    let folder = series(&[]);
    let path = folder.path().join("im2");
    let whole = std::fs::read(&path).unwrap();
    let (mut read, mut refused) = (0, 0);
    for at in 132..whole.len() {
        for bit in [1, 1 << 3, 1 << 6] {
            let mut damaged = whole.clone();
            damaged[at] ^= bit;
            std::fs::write(&path, &damaged).unwrap();
            let all = opened(folder.path()).and_then(|mut source| source.read_planes(9, &mut Vec::new()));
            match all {
                Ok(()) => read += 1,
                Err(error) => {
                    assert!(error.to_string().contains(folder.path().to_str().unwrap()), "{error}");
                    refused += 1;
                }
            }
        }
    }
    assert!(read > 100 && refused > 100, "{read} read, {refused} refused");
}
