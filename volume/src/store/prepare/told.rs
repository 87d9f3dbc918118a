//! What is told of how an input became a store.

use super::job::Job;
use crate::store::manifest::Manifest;

impl Job<'_> {
    /// What was guessed, mapped or counted on the way, the header's notes first.
    pub(super) fn notes(&self, m: &Manifest) -> Vec<String> {
        let mut notes = self.header.notes.clone();
        notes.extend(m.no_data.as_ref().map(|no_data| no_data.words(m.not_finite.nan)));
        let Some((scan, _)) = self.mapping else { return notes };
        let how = if m.lossless { "exactly".to_owned() } else { format!("within {:e} of each value", m.scale * 0.5) };
        notes.push(format!(
            "mapped from {} to 16 bits in two passes, {how}: value = {} * stored + {}",
            8 * self.header.voxel_type.bytes(),
            m.scale,
            m.offset
        ));
        if scan.rounded > 0 {
            notes.push(format!(
                "{} voxels are whole numbers beyond 2^53 (9007199254740992), which were rounded to 53 bits",
                scan.rounded
            ));
        }
        notes.extend(m.not_finite.words());
        notes
    }
}
