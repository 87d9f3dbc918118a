//! Tags that are looked at: group and element as one number.

pub(super) const SYNTAX: u32 = 0x0002_0010;
pub(super) const META_LENGTH: u32 = 0x0002_0000;
pub(super) const IMAGE_TYPE: u32 = 0x0008_0008;
pub(super) const MODALITY: u32 = 0x0008_0060;
pub(super) const DESCRIPTION: u32 = 0x0008_103e;
pub(super) const THICKNESS: u32 = 0x0018_0050;
pub(super) const BETWEEN: u32 = 0x0018_0088;
pub(super) const IMAGER_SPACING: u32 = 0x0018_1164;
pub(super) const SERIES: u32 = 0x0020_000e;
pub(super) const SERIES_NUMBER: u32 = 0x0020_0011;
pub(super) const ACQUISITION: u32 = 0x0020_0012;
pub(super) const TEMPORAL: u32 = 0x0020_0100;
pub(super) const INSTANCE: u32 = 0x0020_0013;
pub(super) const POSITION: u32 = 0x0020_0032;
pub(super) const ORIENTATION: u32 = 0x0020_0037;
pub(super) const SAMPLES: u32 = 0x0028_0002;
pub(super) const PHOTOMETRIC: u32 = 0x0028_0004;
pub(super) const FRAMES: u32 = 0x0028_0008;
pub(super) const ROWS: u32 = 0x0028_0010;
pub(super) const COLUMNS: u32 = 0x0028_0011;
pub(super) const SPACING: u32 = 0x0028_0030;
pub(super) const ALLOCATED: u32 = 0x0028_0100;
pub(super) const STORED: u32 = 0x0028_0101;
pub(super) const HIGH_BIT: u32 = 0x0028_0102;
pub(super) const SIGNED: u32 = 0x0028_0103;
pub(super) const PADDING: u32 = 0x0028_0120;
pub(super) const PADDING_LIMIT: u32 = 0x0028_0121;
pub(super) const INTERCEPT: u32 = 0x0028_1052;
pub(super) const SLOPE: u32 = 0x0028_1053;
pub(super) const RESCALE_TYPE: u32 = 0x0028_1054;
pub(super) const LOSSY: u32 = 0x0028_2110;
pub(super) const VALUE_TABLE: u32 = 0x0028_3000;
pub(super) const FRAME_OFFSETS: u32 = 0x3004_000c;
pub(super) const DOSE_UNITS: u32 = 0x3004_0002;
pub(super) const DOSE_SCALING: u32 = 0x3004_000e;
pub(super) const FRAME_STARTS: u32 = 0x7fe0_0001;
pub(super) const FLOATS: u32 = 0x7fe0_0008;
pub(super) const DOUBLES: u32 = 0x7fe0_0009;
pub(super) const PIXELS: u32 = 0x7fe0_0010;

pub(super) const SHARED: u32 = 0x5200_9229;
pub(super) const PER_FRAME: u32 = 0x5200_9230;
/// Sequences of functional groups that say where a frame lies and what its numbers mean.
pub(super) const GROUPS: [u32; 4] = [0x0020_9113, 0x0020_9116, 0x0028_9110, 0x0028_9145];

pub(super) const ITEM: u32 = 0xfffe_e000;
pub(super) const ITEM_END: u32 = 0xfffe_e00d;
pub(super) const SEQUENCE_END: u32 = 0xfffe_e0dd;

/// What is kept of a data set itself.
pub(super) const KEPT: [u32; 30] = [
    IMAGE_TYPE,
    MODALITY,
    DESCRIPTION,
    THICKNESS,
    BETWEEN,
    IMAGER_SPACING,
    SERIES,
    SERIES_NUMBER,
    ACQUISITION,
    TEMPORAL,
    INSTANCE,
    POSITION,
    ORIENTATION,
    SAMPLES,
    PHOTOMETRIC,
    FRAMES,
    ROWS,
    COLUMNS,
    SPACING,
    ALLOCATED,
    STORED,
    HIGH_BIT,
    SIGNED,
    PADDING,
    PADDING_LIMIT,
    INTERCEPT,
    SLOPE,
    RESCALE_TYPE,
    LOSSY,
    DOSE_UNITS,
];

/// Of these there is a number a frame.
pub(super) const LONG: [u32; 3] = [FRAME_OFFSETS, DOSE_SCALING, FRAME_STARTS];

pub(super) fn name(tag: u32) -> &'static str {
    match tag {
        POSITION => "ImagePositionPatient",
        ORIENTATION => "ImageOrientationPatient",
        SPACING => "PixelSpacing",
        BETWEEN => "SpacingBetweenSlices",
        THICKNESS => "SliceThickness",
        INTERCEPT => "RescaleIntercept",
        SLOPE => "RescaleSlope",
        FRAMES => "NumberOfFrames",
        FRAME_OFFSETS => "GridFrameOffsetVector",
        DOSE_SCALING => "DoseGridScaling",
        ROWS => "Rows",
        COLUMNS => "Columns",
        ALLOCATED => "BitsAllocated",
        STORED => "BitsStored",
        HIGH_BIT => "HighBit",
        SIGNED => "PixelRepresentation",
        IMAGER_SPACING => "ImagerPixelSpacing",
        _ => "data set",
    }
}
