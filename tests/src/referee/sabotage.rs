//! Mistakes that raycasters make.

/// A deliberate mistake in [`super::render_bricks`]. The product must differ from each by more than its tolerances
/// allow, on at least one scene: then a product that makes the mistake turns the suite red.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sabotage {
    /// No mistake: brick by brick, the picture must be that of the whole volume.
    None,
    /// Values are read half a voxel off: centres taken to lie at whole indices.
    HalfVoxelShift,
    /// The voxels' fastest axis is taken to be z.
    AxisSwap,
    /// Left and right are swapped (`right = up x forward`).
    Mirror,
    /// Row 0 is at the bottom.
    UpsideDown,
    /// Spacing is ignored: cubic voxels of the smallest spacing around the same centre.
    CubicVoxels,
    /// The world position of voxel (0, 0, 0)'s *corner* is taken to be the origin.
    OriginAtCorner,
    /// A brick's first sample lies at its entry, not on the common grid.
    PhasePerBrick,
    /// All samples half a step farther.
    HalfStepShift,
    /// Samples are counted from the volume's entry, not from the eye.
    PhaseFromEntry,
    /// Bricks have no neighbours' voxels: values are clamped at brick borders.
    MissingGhosts,
    /// Entry and exit in f32 from a brick-local eye: the two bricks at a face disagree about a sample on it.
    BrickLocalPlanes,
    /// `t_k <= t_out`: both bricks own a sample on their common face.
    ClosedExit,
    /// `t_in < t_k`: nobody owns a sample on a face.
    OpenEntry,
    /// Each brick takes one sample more than it owns.
    OneSampleTooMany,
    /// The colour handed out is not multiplied by the opacity.
    StraightAlpha,
    /// Bricks' layers are joined with colours taken for straight: `C = A_f C_f + (1 - A_f) C_b`.
    StraightOver,
    /// Opacities are used as they are, whatever the step.
    UncorrectedOpacity,
    /// Bricks are joined back to front as if it were front to back.
    ReversedOrder,
    /// Samples behind the eye count.
    BehindTheEye,
    /// Opacities refer to one voxel along the ray's main axis rather than to the opacity unit (twice the unit here).
    DoubledUnit,
}

impl Sabotage {
    pub const MISTAKES: [Self; 20] = [
        Self::HalfVoxelShift,
        Self::AxisSwap,
        Self::Mirror,
        Self::UpsideDown,
        Self::CubicVoxels,
        Self::OriginAtCorner,
        Self::PhasePerBrick,
        Self::HalfStepShift,
        Self::PhaseFromEntry,
        Self::MissingGhosts,
        Self::BrickLocalPlanes,
        Self::ClosedExit,
        Self::OpenEntry,
        Self::OneSampleTooMany,
        Self::StraightAlpha,
        Self::StraightOver,
        Self::UncorrectedOpacity,
        Self::ReversedOrder,
        Self::BehindTheEye,
        Self::DoubledUnit,
    ];
}
