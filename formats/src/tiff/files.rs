//! The pages of a file, and of others that it names beside itself.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use brickcast_volume::format::excerpt;

use super::file::TiffFile;
use super::page::Page;
use crate::wrong::Wrong;

const SUBFILE: u16 = 254;
/// Pages of a file at most.
pub(super) const MOST_PAGES: usize = 1 << 20;

pub(super) struct Pages {
    pub(super) directories: Vec<u64>,
    pub(super) first: Page,
    pub(super) left_out: usize,
}

/// Every page of full size, and that all are of one size and type.
pub(super) fn pages(tiff: &mut TiffFile, first: u64) -> Result<Pages, Wrong> {
    let (mut at, mut seen, mut found) = (first, HashSet::new(), None::<Pages>);
    while at != 0 {
        if seen.len() >= MOST_PAGES || !seen.insert(at) {
            return Err(Wrong::broken("directory", format!("the one at byte {at} comes again, or there are too many")));
        }
        let directory = tiff.directory(at)?;
        // Reduced pictures and masks.
        let is_aside = tiff.one(&directory, SUBFILE)?.unwrap_or(0) & 5 != 0;
        match &mut found {
            None => found = Some(Pages { directories: vec![at], first: Page::of(tiff, &directory)?, left_out: 0 }),
            Some(pages) if is_aside => pages.left_out += 1,
            Some(pages) => {
                let page = Page::of(tiff, &directory)?;
                if page.shape != pages.first.shape {
                    let words =
                        |p: &Page| format!("{} x {} of {}", p.shape.size[0], p.shape.size[1], p.shape.voxel_type);
                    let why = format!("it is {}, but page 1 is {}", words(&page), words(&pages.first));
                    let remedy = "save the pages of one size as a file of their own";
                    return Err(Wrong::new(format!("page {}", seen.len()), why, remedy));
                }
                pages.directories.push(at);
            }
        }
        at = directory.next;
    }
    found.ok_or_else(|| Wrong::broken("directory", "there is none"))
}

/// A file and those beside it, each opened once.
pub(super) struct Files {
    pub(super) own: Pages,
    pub(super) paths: Vec<PathBuf>,
    /// By their names: which of the paths, and the directories of its pages.
    pub(super) others: HashMap<String, (u32, Vec<u64>)>,
}

impl Files {
    pub(super) fn new(path: &Path, own: Pages) -> Self {
        Self { own, paths: vec![path.into()], others: HashMap::new() }
    }

    /// Which file, and which directory in it; else how many pages it has.
    pub(super) fn place(&mut self, page: u64, name: Option<&str>) -> Result<Result<(u32, u64), usize>, Wrong> {
        let own_name = self.paths[0].file_name().and_then(|name| name.to_str());
        let name = name.filter(|name| Some(*name) != own_name);
        if let Some(name) = name
            && !self.others.contains_key(name)
        {
            let directories = self.directories_of(name)?;
            self.others.insert(name.into(), (self.paths.len() as u32 - 1, directories));
        }
        let (file, directories) = match name.and_then(|name| self.others.get(name)) {
            Some((file, directories)) => (*file, directories),
            None => (0, &self.own.directories),
        };
        let directory = usize::try_from(page).ok().and_then(|page| directories.get(page));
        Ok(directory.map(|directory| (file, *directory)).ok_or(directories.len()))
    }

    fn directories_of(&mut self, name: &str) -> Result<Vec<u64>, Wrong> {
        let wrong =
            |why: &str, remedy| Wrong::new("OME-XML", format!("slices lie in `{}`, {why}", excerpt(name)), remedy);
        // Nothing is opened but what lies beside it.
        let is_bare = Path::new(name).file_name().is_some_and(|own| own == name);
        let path = self.paths[0].with_file_name(name);
        if !is_bare || !path.is_file() {
            return Err(wrong("which is not beside it", "put the files of one export into one folder"));
        }
        let (mut tiff, first) = TiffFile::open(&path)?;
        let pages = pages(&mut tiff, first)?;
        if pages.first.shape != self.own.first.shape {
            return Err(wrong("whose pages are of another size or type", "export it again"));
        }
        self.paths.push(path);
        Ok(pages.directories)
    }
}
