//! Transfer syntaxes: how a data set is written down, and how its pixels are coded.

/// For pixels that no decoder is there for.
pub(super) const REWRITE: &str =
    "rewrite it with gdcmconv --raw IN OUT (of GDCM) or dcmdjpeg IN OUT (of DCMTK), which take the coding off";

/// How pixels are coded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Codec {
    /// As numbers, in fragments or in one piece.
    Raw,
    Rle,
    Jpeg,
    JpegLossless,
    JpegLs,
    Jpeg2000,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Syntax {
    pub(super) name: &'static str,
    pub(super) is_implicit: bool,
    pub(super) is_big: bool,
    pub(super) is_deflated: bool,
    /// Nothing where no decoder is at hand.
    pub(super) codec: Option<Codec>,
    /// Of coded pixels, whether values may differ from what was coded.
    pub(super) has_loss: bool,
}

const PLAIN: Syntax = Syntax {
    name: "Explicit VR Little Endian",
    is_implicit: false,
    is_big: false,
    is_deflated: false,
    codec: Some(Codec::Raw),
    has_loss: false,
};
pub(super) const IMPLICIT: Syntax = Syntax { name: "Implicit VR Little Endian", is_implicit: true, ..PLAIN };

const fn coded(name: &'static str, codec: Codec) -> Syntax {
    Syntax { name, codec: Some(codec), ..PLAIN }
}

const fn lossy(name: &'static str, codec: Codec) -> Syntax {
    Syntax { has_loss: true, ..coded(name, codec) }
}

const fn none(name: &'static str) -> Syntax {
    Syntax { name, codec: None, ..PLAIN }
}

/// What follows `1.2.840.10008.1.2`.
static SYNTAXES: [(&str, Syntax); 38] = [
    ("", IMPLICIT),
    (".1", PLAIN),
    (".1.98", coded("Encapsulated Uncompressed", Codec::Raw)),
    (".1.99", Syntax { name: "Deflated Explicit VR Little Endian", is_deflated: true, ..PLAIN }),
    (".2", Syntax { name: "Explicit VR Big Endian", is_big: true, ..PLAIN }),
    (".5", coded("RLE Lossless", Codec::Rle)),
    (".4.50", lossy("JPEG Baseline", Codec::Jpeg)),
    (".4.51", lossy("JPEG Extended", Codec::Jpeg)),
    (".4.57", coded("JPEG Lossless", Codec::JpegLossless)),
    (".4.70", coded("JPEG Lossless SV1", Codec::JpegLossless)),
    (".4.80", coded("JPEG-LS Lossless", Codec::JpegLs)),
    (".4.81", lossy("JPEG-LS Near-lossless", Codec::JpegLs)),
    (".4.90", coded("JPEG 2000 Lossless", Codec::Jpeg2000)),
    (".4.91", lossy("JPEG 2000", Codec::Jpeg2000)),
    (".4.53", none("JPEG Spectral Selection")),
    (".4.55", none("JPEG Full Progression")),
    (".4.92", none("JPEG 2000 Part 2 Lossless")),
    (".4.93", none("JPEG 2000 Part 2")),
    (".4.94", none("JPIP Referenced")),
    (".4.95", none("JPIP Referenced Deflate")),
    (".4.100", none("MPEG2 Main Profile")),
    (".4.100.1", none("Fragmentable MPEG2 Main Profile")),
    (".4.101", none("MPEG2 High Profile")),
    (".4.101.1", none("Fragmentable MPEG2 High Profile")),
    (".4.102", none("MPEG-4 AVC/H.264 High Profile")),
    (".4.103", none("MPEG-4 AVC/H.264 BD-compatible")),
    (".4.104", none("MPEG-4 AVC/H.264 High Profile for 2D")),
    (".4.105", none("MPEG-4 AVC/H.264 High Profile for 3D")),
    (".4.106", none("MPEG-4 AVC/H.264 Stereo High Profile")),
    (".4.107", none("HEVC/H.265 Main Profile")),
    (".4.108", none("HEVC/H.265 Main 10 Profile")),
    (".4.110", none("JPEG XL Lossless")),
    (".4.111", none("JPEG XL JPEG Recompression")),
    (".4.112", none("JPEG XL")),
    (".4.201", none("High-Throughput JPEG 2000 Lossless")),
    (".4.202", none("High-Throughput JPEG 2000 RPCL Lossless")),
    (".4.203", none("High-Throughput JPEG 2000")),
    (".8.1", none("Deflated Image Frame")),
];

/// Nothing for what the standard does not have, or had.
pub(super) fn of(uid: &str) -> Option<Syntax> {
    let rest = uid.strip_prefix("1.2.840.10008.1.2")?;
    SYNTAXES.iter().find(|(ending, _)| *ending == rest).map(|(_, syntax)| *syntax)
}
