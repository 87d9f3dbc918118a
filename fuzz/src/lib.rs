//! What all targets do: bytes become a file, which is opened and read, in whatever way it likes.

use std::cell::RefCell;
use std::path::PathBuf;

use brickcast_volume::format::RawHints;

/// Of a volume that became huge no more is read: what comes after is as what came before.
const MOST_BYTES: usize = 8 << 20;
const MOST_PIECES: u32 = 64;

thread_local! {
    /// One folder of this process; `cargo fuzz -j` runs several.
    static FOLDER: RefCell<Option<(tempfile::TempDir, PathBuf)>> = const { RefCell::new(None) };
}

/// Reads `data` as the file `name`, whose suffix alone tells formats without a mark.
///
/// # Panics
/// A temporary file cannot be written; what the reader breaks.
pub fn read(name: &str, data: &[u8]) {
    FOLDER.with_borrow_mut(|folder| {
        let (_, path) = folder.get_or_insert_with(|| {
            // In memory where there is such a place.
            let shared = std::path::Path::new("/dev/shm");
            let folder = if shared.is_dir() { tempfile::tempdir_in(shared) } else { tempfile::tempdir() };
            let folder = folder.expect("a temporary folder");
            let path = folder.path().join(name);
            (folder, path)
        });
        std::fs::write(&*path, data).expect("a temporary file");
        let Ok(mut source) = brickcast_formats::open(path, &RawHints::default()) else { return };
        let d = source.header().geometry.dims().to_array();
        let (mut piece, mut bytes) = (Vec::new(), 0);
        for _ in 0..MOST_PIECES {
            if source.read_piece(1 << 20, &mut piece).is_err() || piece.is_empty() {
                break;
            }
            bytes += piece.len();
            if bytes > MOST_BYTES {
                break;
            }
        }
        let hi = d.map(|n| n.min(9));
        let _ = source.read_box(hi.map(|n| n / 2), hi, &mut piece);
        let _ = source.rewind().and_then(|()| source.read_piece(64, &mut piece));
    });
}
