//! Whole files of DICOM: each way that pixels are written down, and frames with groups of their own.

use std::io::Write as _;

use crate::written::{COLUMNS, ROWS, Slice, part, sequence};

/// The numbers 7, 1007, 2007 and so on, as imagecodecs codes them.
const LOSSLESS_JPEG: &str = include_str!("lossless.jpg.hex");
const JPEG_2000: &str = include_str!("grey.j2k.hex");

fn bytes(hex: &str) -> Vec<u8> {
    let hex = hex.trim();
    (0..hex.len()).step_by(2).map(|i| u8::from_str_radix(&hex[i..i + 2], 16).unwrap()).collect()
}

fn rle() -> Vec<u8> {
    let mut header = [0_u32; 16];
    (header[0], header[1], header[2]) = (2, 64, 66);
    let segments = [245, 1, 5, 1, 2, 3, 4, 5, 6, 251, 9];
    header.iter().flat_map(|n| n.to_le_bytes()).chain(segments).collect()
}

fn coded(syntax: &str, fragments: &[&[u8]]) -> Slice {
    let mut slice = Slice::at(1);
    slice.fragments(&format!("1.2.840.10008.1.2.{syntax}"), fragments);
    slice
}

/// Two frames, upside down.
fn enhanced() -> Slice {
    let mut slice = Slice::at(0).pixels(&[3; 2 * 2 * COLUMNS * ROWS]);
    slice.without(0x0020_0032);
    slice.text(0x0028_0008, b"IS", "2");
    let position = |z: u32| {
        let place = part(0x0020_0032, b"DS", format!("1\\2\\{z}").as_bytes());
        part(0x0020_9113, b"SQ", &sequence(&[place]))
    };
    let meaning = [part(0x0028_1052, b"DS", b"-1000"), part(0x0028_1053, b"DS", b"2")].concat();
    slice.sequence(0x5200_9229, &[part(0x0028_9145, b"SQ", &sequence(&[meaning]))]);
    slice.sequence(0x5200_9230, &[position(4), position(2)]);
    slice
}

fn deflated() -> Vec<u8> {
    let mut slice = Slice::at(2);
    slice.syntax = "1.2.840.10008.1.2.1.99".into();
    let plain = slice.bytes();
    let at = plain.windows(4).position(|w| w == [8, 0, 0x60, 0]).unwrap();
    let mut encoder = flate2::write::DeflateEncoder::new(plain[..at].to_vec(), flate2::Compression::fast());
    encoder.write_all(&plain[at..]).unwrap();
    encoder.finish().unwrap()
}

pub(crate) fn dicoms() -> Vec<Vec<u8>> {
    let numbers: Vec<u16> = (0..(COLUMNS * ROWS) as u16).map(|i| i * 1000 + 7).collect();
    let mut jpeg_ls = Vec::new();
    jpegls::encode(&numbers, COLUMNS as u32, ROWS as u32, &mut jpeg_ls).unwrap();
    let mut frames = Slice::at(0).pixels(&[5; 3 * 2 * COLUMNS * ROWS]);
    frames.text(0x0028_0008, b"IS", "3");
    frames.text(0x3004_000c, b"DS", "0\\3\\6");
    let mut pieces = coded("1.98", &[&[1; 24], &[2; 24]]);
    pieces.text(0x0028_0008, b"IS", "2");
    let plain = [Slice::at(1), frames, enhanced(), pieces, coded("5", &[&rle()])];
    let jpegs = [
        coded("4.70", &[&bytes(LOSSLESS_JPEG)]),
        coded("4.80", &[&jpeg_ls]),
        coded("4.90", &[&bytes(JPEG_2000)]),
        coded("4.90", &[&bytes(JPEG_2000)[..40], &bytes(JPEG_2000)[40..]]),
    ];
    plain.iter().chain(&jpegs).map(Slice::bytes).chain([deflated()]).collect()
}
