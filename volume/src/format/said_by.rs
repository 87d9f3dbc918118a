//! Where the facts of a volume come from.

use super::source::Placement;

/// Who says a fact of a volume.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum SaidBy {
    #[default]
    Header,
    /// Of TIFF, of DICOM.
    Tags,
    /// Of a raw file.
    FileName,
    /// The user.
    Flag,
    /// A brick store's manifest.
    Store,
    /// Nobody: it was assumed.
    Default,
}

impl SaidBy {
    /// For people.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Header => "header",
            Self::Tags => "tags",
            Self::FileName => "file name",
            Self::Flag => "flag",
            Self::Store => "store",
            Self::Default => "default",
        }
    }

    pub(super) fn flag_or(is_said: bool, else_by: Self) -> Self {
        if is_said { Self::Flag } else { else_by }
    }
}

/// What a reader knows of where its facts come from; what lies in space is said of by its [`Placement`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FactsBy {
    pub dims: SaidBy,
    pub voxel_type: SaidBy,
    /// What of the placement the file says.
    pub place: SaidBy,
    /// What of the placement the user said.
    pub overruled: Placement,
}

impl FactsBy {
    /// All of it is the file's.
    #[must_use]
    pub fn all(by: SaidBy) -> Self {
        Self { dims: by, voxel_type: by, place: by, overruled: Placement::default() }
    }
}

/// Each fact by the name that it has in `brickcast info --json`, and who says it.
pub type Facts = [(&'static str, SaidBy); 7];

/// Facts of these, in this order: dims, type, spacing, origin, directions, unit, values.
pub(super) fn facts(by: [SaidBy; 7]) -> Facts {
    let [dims, voxel_type, spacing, origin, directions, unit, values] = by;
    [
        ("dims", dims),
        ("type", voxel_type),
        ("spacing", spacing),
        ("origin", origin),
        ("directions", directions),
        ("unit", unit),
        ("values", values),
    ]
}

/// A store says all of it itself.
#[must_use]
pub fn facts_of_store() -> Facts {
    facts([SaidBy::Store; 7])
}
