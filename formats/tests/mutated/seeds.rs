//! Whole files of every format, between them of every field and codec that matters.

use std::io::{Read as _, Write as _};

pub(crate) fn gzip(data: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(data).unwrap();
    encoder.finish().unwrap()
}

fn zlib(data: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(data).unwrap();
    encoder.finish().unwrap()
}

fn zstd(data: &[u8]) -> Vec<u8> {
    zstd::bulk::compress(data, 1).unwrap()
}

fn lzw(data: &[u8]) -> Vec<u8> {
    weezl::encode::Encoder::with_tiff_size_switch(weezl::BitOrder::Msb, 8).encode(data).unwrap()
}

pub(crate) fn voxels(count: usize) -> Vec<u8> {
    (0..count).map(|i| (i * 7) as u8).collect()
}

/// Pages of 16 x 12 pixels; `tags` beside size and parts.
struct Pages<'a> {
    is_big: bool,
    tags: &'a [(u16, u64)],
    description: &'a str,
    /// Of each page.
    parts: Vec<Vec<Vec<u8>>>,
    tiles: bool,
}

impl Pages<'_> {
    fn bytes(&self) -> Vec<u8> {
        let wide = |n: u64| if self.is_big { n.to_le_bytes().to_vec() } else { (n as u32).to_le_bytes().to_vec() };
        let mut out = match self.is_big {
            true => b"II\x2b\0\x08\0\0\0\0\0\0\0\0\0\0\0".to_vec(),
            false => b"II\x2a\0\0\0\0\0".to_vec(),
        };
        let mut last = if self.is_big { 8 } else { 4 };
        for parts in &self.parts {
            let list = |numbers: &[u64], out: &mut Vec<u8>| -> (u64, Vec<u8>) {
                let bytes: Vec<u8> = numbers.iter().flat_map(|n| wide(*n)).collect();
                match numbers.len() {
                    1 => (1, bytes),
                    n => {
                        let at = out.len() as u64;
                        out.extend(bytes);
                        (n as u64, wide(at))
                    }
                }
            };
            let mut offsets = Vec::new();
            for part in parts {
                offsets.push(out.len() as u64);
                out.extend(part);
            }
            let counts: Vec<u64> = parts.iter().map(|p| p.len() as u64).collect();
            let (offsets, counts) = (list(&offsets, &mut out), list(&counts, &mut out));
            let text = out.len() as u64;
            out.extend(self.description.bytes().chain([0]));
            let at = out.len() as u64;
            let number = wide(at);
            out[last..last + number.len()].copy_from_slice(&number);
            let kind = if self.is_big { 16_u16 } else { 4 };
            let mut entries = vec![(256, kind, 1, wide(16)), (257, kind, 1, wide(12))];
            entries.extend(self.tags.iter().map(|(tag, n)| (*tag, kind, 1, wide(*n))));
            if !self.description.is_empty() {
                entries.push((270, 2, self.description.len() as u64 + 1, wide(text)));
            }
            let (offset_tag, count_tag) = if self.tiles { (324, 325) } else { (273, 279) };
            entries.extend([(offset_tag, kind, offsets.0, offsets.1), (count_tag, kind, counts.0, counts.1)]);
            entries.sort_by_key(|entry| entry.0);
            match self.is_big {
                true => out.extend((entries.len() as u64).to_le_bytes()),
                false => out.extend((entries.len() as u16).to_le_bytes()),
            }
            for (tag, kind, count, value) in entries {
                out.extend([u16::to_le_bytes(tag), u16::to_le_bytes(kind)].concat());
                out.extend(wide(count));
                out.extend(value);
            }
            last = out.len();
            out.extend(wide(0));
        }
        out
    }
}

pub(crate) fn tiffs() -> Vec<Vec<u8>> {
    let plane = voxels(16 * 12 * 2);
    let strips = |pack: &dyn Fn(&[u8]) -> Vec<u8>| -> Vec<Vec<u8>> { plane.chunks(16 * 2 * 5).map(pack).collect() };
    let page = |compression, predictor, parts: Vec<Vec<u8>>| {
        let tags = [(258, 16), (259, compression), (277, 1), (278, 5), (317, predictor)];
        Pages { is_big: false, tags: &tags, description: "", parts: vec![parts.clone(), parts], tiles: false }.bytes()
    };
    let packed = |data: &[u8]| data.chunks(100).flat_map(|c| [&[c.len() as u8 - 1], c].concat()).collect::<Vec<u8>>();
    let mut seeds = vec![
        page(1, 1, strips(&<[u8]>::to_vec)),
        page(5, 2, strips(&lzw)),
        page(8, 2, strips(&zlib)),
        page(32773, 1, strips(&packed)),
        page(50000, 1, strips(&zstd)),
    ];
    let tags = [(258, 32), (259, 8), (277, 1), (317, 3), (322, 16), (323, 16), (339, 3)];
    let tile = zlib(&voxels(16 * 16 * 4));
    seeds.push(Pages { is_big: true, tags: &tags, description: "", parts: vec![vec![tile]; 3], tiles: true }.bytes());
    let tags = [(258, 8), (259, 1), (277, 1), (278, 12)];
    let description = "ImageJ=1.54f\nimages=6\nchannels=2\nslices=3\nhyperstack=true\nunit=um\nspacing=3.0\n";
    let all = vec![vec![voxels(16 * 12)]];
    let mut contiguous = Pages { is_big: false, tags: &tags, description, parts: all.clone(), tiles: false }.bytes();
    // Where the planes that no directory names follow the first.
    let start = contiguous.windows(16).position(|w| *w == voxels(192)[..16]).unwrap();
    contiguous.splice(start + 192..start + 192, []);
    contiguous.resize(start + 6 * 192 + 64, 3);
    seeds.push(contiguous);
    let description = r#"<?xml version="1.0"?><OME><Image><Pixels DimensionOrder="XYCZT" SizeX="16" SizeY="12"
        SizeZ="2" SizeC="2" SizeT="1" PhysicalSizeX="0.5" PhysicalSizeZ="2" PhysicalSizeZUnit="mm"><TiffData IFD="0" FirstZ="0" PlaneCount="4"/></Pixels></Image></OME>"#;
    let four = vec![vec![voxels(192)]; 4];
    seeds.push(Pages { is_big: true, tags: &tags, description, parts: four, tiles: false }.bytes());
    let tags = [(258, 8), (259, 5), (262, 2), (277, 3), (278, 12), (317, 2)];
    let grey = lzw(&[vec![9; 3], [0; 3].repeat(15)].concat().repeat(12));
    seeds.push(Pages { is_big: false, tags: &tags, description: "", parts: vec![vec![grey]], tiles: false }.bytes());
    seeds
}

fn of_hex(text: &str) -> Vec<u8> {
    (0..text.len()).step_by(2).map(|i| u8::from_str_radix(&text[i..i + 2], 16).unwrap()).collect()
}

/// As h5py wrote them: old files and new ones, every index of chunks, layout and filter, groups of many links.
const HDF5: &str = include_str!("hdf5.gz.hex");

pub(crate) fn hdf5() -> Vec<Vec<u8>> {
    let unpacked = |line: &str| {
        let mut file = Vec::new();
        flate2::read::GzDecoder::new(&of_hex(line)[..]).read_to_end(&mut file).unwrap();
        file
    };
    HDF5.lines().map(unpacked).collect()
}

const JPEG: &str = include_str!("grey.jpg.hex");

pub(crate) fn pictures() -> Vec<Vec<u8>> {
    let png = |color, depth, data: &[u8]| {
        let mut out = Vec::new();
        let mut encoder = png::Encoder::new(&mut out, 16, 12);
        encoder.set_color(color);
        encoder.set_depth(depth);
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        out
    };
    let pixels = voxels(16 * 12 * 2);
    let grey: Vec<u8> = voxels(192).iter().flat_map(|v| [*v; 3]).collect();
    let bmp = |bits: u8, palette: Vec<u8>, pixels: &[u8]| {
        let start = (54 + palette.len() as u32).to_le_bytes();
        let head =
            [&b"BM\0\0\0\0\0\0\0\0"[..], &start, &[40, 0, 0, 0, 16, 0, 0, 0, 12, 0, 0, 0, 1, 0, bits, 0], &[0; 24]];
        [&head.concat()[..], &palette, pixels].concat()
    };
    let greys = (0..=255).flat_map(|i| [i, i, i, 0]).collect();
    vec![
        png(png::ColorType::Grayscale, png::BitDepth::Sixteen, &pixels),
        png(png::ColorType::Rgb, png::BitDepth::Eight, &grey),
        png(png::ColorType::Grayscale, png::BitDepth::Two, &pixels[..48]),
        bmp(8, greys, &voxels(192)),
        bmp(24, Vec::new(), &grey),
        of_hex(JPEG.trim()),
    ]
}

pub(crate) fn meta_images() -> Vec<Vec<u8>> {
    let data = voxels(4 * 3 * 2 * 2);
    let file = |more: &str, data: &[u8]| {
        let head = "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = True\n\
                    TransformMatrix = 0 1 0 -1 0 0 0 0 1\nOffset = 1 -2 3e1\nElementSpacing = 1 2.5 3\n\
                    DimSize = 4 3 2\nElementType = MET_SHORT\n";
        [head.as_bytes(), more.as_bytes(), data].concat()
    };
    let names = ["a.bin", "b.bin"].map(|name| format!("{name}\n")).concat();
    vec![
        file("ElementDataFile = LOCAL\n", &data),
        file("HeaderSize = -1\nElementDataFile = LOCAL\n", &data),
        file("CompressedData = True\nCompressedDataSize = 30\nElementDataFile = LOCAL\n", &zlib(&data)),
        file(&format!("ElementDataFile = LIST\n{names}"), &[]),
        file("ElementDataFile = %d.bin 1 2 1\n", &[]),
        file("HeaderSize = 0\nElementDataFile = whole.bin\n", &[]),
        gzip(&file("ElementDataFile = LOCAL\n", &data)),
    ]
}

pub(crate) fn niftis() -> Vec<Vec<u8>> {
    let put = |head: &mut Vec<u8>, at: usize, bytes: &[u8]| head[at..at + bytes.len()].copy_from_slice(bytes);
    let data = voxels(4 * 3 * 2 * 2 * 2);
    let one = |codes: [u16; 2]| {
        let mut head = vec![0; 352];
        put(&mut head, 0, &348_u32.to_le_bytes());
        put(&mut head, 40, &[4_u16, 4, 3, 2, 2, 1, 1, 1].map(u16::to_le_bytes).concat());
        put(&mut head, 70, &[4_u16, 16].map(u16::to_le_bytes).concat());
        put(&mut head, 76, &[-1_f32, 1.0, 2.0, 3.0].map(f32::to_le_bytes).concat());
        put(&mut head, 108, &[352_f32, 0.5, -10.0].map(f32::to_le_bytes).concat());
        head[123] = 2;
        put(&mut head, 252, &codes.map(u16::to_le_bytes).concat());
        put(&mut head, 256, &[0.1_f32, 0.2, 0.3, 4.0, 5.0, 6.0].map(f32::to_le_bytes).concat());
        let rows = [0_f32, 2.0, 0.0, 1.0, -1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 3.0, 3.0];
        put(&mut head, 280, &rows.map(f32::to_le_bytes).concat());
        put(&mut head, 344, b"n+1\0");
        [head, data.clone()].concat()
    };
    let mut two = vec![0; 544];
    put(&mut two, 0, &540_u32.to_be_bytes());
    put(&mut two, 4, b"n+2\0\r\n\x1a\n");
    put(&mut two, 12, &[4_u16, 16].map(u16::to_be_bytes).concat());
    put(&mut two, 16, &[3_u64, 4, 3, 2, 1, 1, 1, 1].map(u64::to_be_bytes).concat());
    put(&mut two, 104, &[1_f64, 1.0, 2.0, 3.0].map(f64::to_be_bytes).concat());
    put(&mut two, 168, &544_u64.to_be_bytes());
    two.extend(&data[..48]);
    vec![one([0, 1]), one([1, 0]), one([0, 0]), gzip(&one([1, 1])), two.clone(), zstd(&two)]
}

pub(crate) fn arrays() -> Vec<Vec<u8>> {
    let file = |header: &str, bytes: usize| {
        let header = format!("{header:<117}\n");
        [&b"\x93NUMPY\x01\0"[..], &(header.len() as u16).to_le_bytes(), header.as_bytes(), &voxels(bytes)].concat()
    };
    vec![
        file("{'descr': '<u2', 'fortran_order': False, 'shape': (2, 3, 4), }", 48),
        file("{'descr': '>f8', 'fortran_order': True, 'shape': (2, 3, 4), }", 192),
        file("{'descr': '<f2', 'fortran_order': False, 'shape': (3, 4), }", 24),
        gzip(&file("{'descr': '|i1', 'fortran_order': False, 'shape': (1, 2, 3, 4), }", 24)),
    ]
}

pub(crate) fn legacy() -> Vec<Vec<u8>> {
    let file = |format: &str, more: &str, data: &[u8]| {
        let head = format!(
            "# vtk DataFile Version 3.0\ntitle\n{format}\nDATASET STRUCTURED_POINTS\nDIMENSIONS 4 3 2\n\
             SPACING 1 2 3\nORIGIN -1 2.5 0\n{more}"
        );
        [head.as_bytes(), data].concat()
    };
    let scalars = "POINT_DATA 24\nSCALARS v short 1\nLOOKUP_TABLE default\n";
    let text = (0..24).map(|i| (i * 9 - 40).to_string()).collect::<Vec<_>>().join(" ") + "\n";
    vec![
        file("BINARY", scalars, &voxels(48)),
        file("ASCII", scalars, text.as_bytes()),
        file("BINARY", "CELL_DATA 6\nFIELD FieldData 1\nv 1 6 double\n", &voxels(48)),
        gzip(&file("ASCII", scalars, text.as_bytes())),
    ]
}

pub(crate) fn image_data() -> Vec<Vec<u8>> {
    let file = |compressor: &str, array: &str, appended: Vec<u8>| {
        let head = format!(
            r#"<?xml version="1.0"?><VTKFile type="ImageData" version="1.0" byte_order="LittleEndian"
    header_type="UInt32"{compressor}>
<ImageData WholeExtent="0 3 0 2 0 1" Origin="0 1 2" Spacing="1 2 3" Direction="1 0 0 0 1 0 0 0 1">
<Piece Extent="0 3 0 2 0 1"><PointData Scalars="v"><DataArray type="Int16" Name="v" {array}</DataArray></PointData></Piece>
</ImageData><AppendedData encoding="raw">
_"#
        );
        [head.as_bytes(), &appended].concat()
    };
    let text = (0..24).map(|i| (i * 9 - 40).to_string()).collect::<Vec<_>>().join(" ");
    let numbers = |all: &[u32]| all.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let blocks = |pack: &dyn Fn(&[u8]) -> Vec<u8>| {
        let packed: Vec<Vec<u8>> = voxels(48).chunks(20).map(pack).collect();
        let sizes: Vec<u32> = [3, 20, 8].into_iter().chain(packed.iter().map(|p| p.len() as u32)).collect();
        [numbers(&sizes), packed.concat()].concat()
    };
    // 48 and 48 letters of base64 that are 4 and 48 bytes.
    let coded = "MAAAAAAA".to_owned() + &"AQIDBAUGBwgJCgsM".repeat(3) + "AQIDBAUGBwgJCgsM";
    let appended = r#"format="appended" offset="0">"#;
    vec![
        file("", &format!(r#"format="ascii">{text}"#), Vec::new()),
        file("", &format!(r#"format="binary">{coded}"#), Vec::new()),
        file("", appended, [numbers(&[48]), voxels(48)].concat()),
        file(r#" compressor="vtkZLibDataCompressor""#, appended, blocks(&zlib)),
        file(r#" compressor="vtkLZ4DataCompressor""#, appended, blocks(&lz4_flex::block::compress)),
    ]
}

pub(crate) fn amira() -> Vec<Vec<u8>> {
    let file = |coding: &str, kind: &str, packing: &str, data: &[u8]| {
        let head = format!(
            "# AmiraMesh {coding} 2.1\n\ndefine Lattice 4 3 2\n\nParameters {{\n    Units {{\n\
             Coordinates \"mm\"\n    }}\n    BoundingBox 0 3 1 5 -2 1.5,\n    CoordType \"uniform\"\n}}\n\n\
             Lattice {{ byte[2] Pairs }} @1\nLattice {{ {kind} Data }} @2{packing}\n\n# Data section follows\n@1\n"
        );
        let pairs = if coding == "ASCII" { "1 ".repeat(48).into_bytes() } else { voxels(48) };
        [head.as_bytes(), &pairs, b"\n@2\n", data, b"\n"].concat()
    };
    let text = (0..24).map(|i| (i * 9 - 40).to_string()).collect::<Vec<_>>().join("\n");
    let packed = zlib(&voxels(48));
    let runs = [&[20, 7, 0x84][..], &voxels(4)].concat();
    vec![
        file("BINARY-LITTLE-ENDIAN", "ushort", "", &voxels(48)),
        file("BINARY", "short", &format!("(HxZip,{})", packed.len()), &packed),
        file("BINARY", "byte", &format!("(HxByteRLE,{})", runs.len()), &runs),
        file("ASCII", "float", "", text.as_bytes()),
    ]
}

pub(crate) fn vgi() -> Vec<Vec<u8>> {
    let file = |kind: &str, bits: u32, more: &str| {
        let head = format!(
            "{{volume1}}\n[representation]\nsize = 4 3 2\n[file1]\nSkipHeader = 0\nFileFormat = raw\nSize = 4 3 2\n\
             Name = whole.bin\nDatatype = {kind}\nBitsPerElement = {bits}\n{more}{{volumeprimitive1}}\n[geometry]\n\
             resolution = 0.5 1 2.5\nunit = mm\n"
        );
        head.into_bytes()
    };
    vec![file("unsigned integer", 16, "Endian = big\n"), file("signed integer", 8, ""), file("unsigned integer", 8, "")]
}
