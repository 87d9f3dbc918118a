//! OME-TIFF: XML in the description of the first page.

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::order::{Counts, Order};
use crate::units;
use crate::wrong::{EXPORT_AGAIN, Wrong};

/// Pages behind each other that hold planes behind each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Run {
    page: u64,
    /// By the order.
    plane: u64,
    count: u64,
    /// Which of [`Ome::files`]; the own one where none is said.
    file: Option<usize>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ome {
    pub(super) order: Order,
    pub(super) spacing: [Option<f64>; 3],
    pub(super) unit: Option<&'static str>,
    /// None: pages in order.
    pub(super) runs: Vec<Run>,
    /// Names of files that planes lie in.
    pub(super) files: Vec<String>,
    pub(super) images: u64,
}

fn attribute(tag: &BytesStart<'_>, name: &str) -> Option<String> {
    let found = tag.attributes().flatten().find(|a| a.key.local_name().as_ref() == name.as_bytes())?;
    found.unescape_value().ok().map(|v| v.into_owned())
}

fn count(tag: &BytesStart<'_>, name: &str) -> Option<u64> {
    attribute(tag, name)?.trim().parse().ok()
}

impl Ome {
    pub(super) fn is_ome(description: &str) -> bool {
        let text = description.trim_start_matches('\u{feff}').trim_start();
        (text.starts_with("<?xml") || text.starts_with("<OME")) && text.contains("<OME") && text.contains("<Pixels")
    }

    pub(super) fn parse(description: &str) -> Result<Self, Wrong> {
        let wrong = |why: String| Wrong::new("OME-XML", why, EXPORT_AGAIN);
        let mut reader = Reader::from_str(description.trim_start_matches('\u{feff}').trim_start());
        let (mut found, mut images): (Option<Self>, u64) = (None, 0);
        loop {
            let event = reader.read_event().map_err(|e| wrong(e.to_string()))?;
            let (Event::Start(tag) | Event::Empty(tag)) = &event else {
                match event {
                    Event::Eof => break,
                    _ => continue,
                }
            };
            match tag.local_name().as_ref() {
                b"Pixels" => {
                    images += 1;
                    if images == 1 {
                        found = Some(Self::of_pixels(tag)?);
                    }
                }
                b"TiffData" if images == 1 => {
                    if let Some(ome) = &mut found {
                        ome.add_run(tag);
                    }
                }
                b"UUID" if images == 1 => {
                    if let (Some(ome), Some(file)) = (&mut found, attribute(tag, "FileName")) {
                        ome.name_file(file);
                    }
                }
                _ => {}
            }
        }
        let found = found.ok_or_else(|| wrong("it has no Pixels".into()))?;
        Ok(Self { images, ..found })
    }

    fn of_pixels(tag: &BytesStart<'_>) -> Result<Self, Wrong> {
        let n = |name| count(tag, name).unwrap_or(1).max(1);
        let counts = Counts { z: n("SizeZ"), c: n("SizeC"), t: n("SizeT") };
        let order = attribute(tag, "DimensionOrder").unwrap_or_else(|| "XYZCT".into()).to_ascii_lowercase();
        let mut axes: Vec<u8> = order.bytes().filter(|b| b"zct".contains(b)).collect();
        let axes = match (order.starts_with("xy"), axes.len()) {
            (true, 3) => [axes.remove(0), axes.remove(0), axes.remove(0)],
            _ => return Err(Wrong::new("OME-XML", "its DimensionOrder is none", EXPORT_AGAIN)),
        };
        let size = |axis: &str| {
            let size = attribute(tag, &format!("PhysicalSize{axis}"))?.parse::<f64>().ok().filter(|s| *s > 0.0)?;
            let unit = attribute(tag, &format!("PhysicalSize{axis}Unit")).unwrap_or_else(|| "µm".into());
            Some((size, units::length(&unit)))
        };
        let sizes = ["X", "Y", "Z"].map(size);
        let given: Vec<_> = sizes.iter().flatten().collect();
        // Axes of different units become micrometres.
        let is_same = given.windows(2).all(|w| w[0].1 == w[1].1);
        let (spacing, unit) = match is_same {
            true => (sizes.map(|s| s.map(|s| s.0)), given.first().and_then(|s| s.1).map(|u| u.0)),
            false => (sizes.map(|s| s.map(|s| s.0 * s.1.map_or(1.0, |u| u.1))), Some("um")),
        };
        Ok(Self { order: Order { counts, axes }, spacing, unit, runs: Vec::new(), files: Vec::new(), images: 1 })
    }

    fn add_run(&mut self, tag: &BytesStart<'_>) {
        let n = |name| count(tag, name);
        let named = ["IFD", "FirstZ", "FirstC", "FirstT", "PlaneCount"].map(n);
        let [ifd, z, c, t, planes] = named;
        let first = self.order.index(z.unwrap_or(0), c.unwrap_or(0), t.unwrap_or(0));
        // Without a count: one plane where a page is named, all others else.
        let planes = planes.unwrap_or(if ifd.is_some() { 1 } else { self.order.counts.all() });
        self.runs.push(Run { page: ifd.unwrap_or(0), plane: first, count: planes, file: None });
    }

    /// Of the run that came last.
    fn name_file(&mut self, name: String) {
        let Some(run) = self.runs.last_mut() else { return };
        // Mostly that of the run before.
        let at = self.files.iter().rposition(|file| *file == name);
        run.file = Some(at.unwrap_or_else(|| {
            self.files.push(name);
            self.files.len() - 1
        }));
    }

    pub(super) fn is_every_run_in_a_file(&self) -> bool {
        self.runs.iter().all(|run| run.file.is_some())
    }

    /// The page that holds the plane of this number, and which of the files.
    pub(super) fn page(&self, plane: u64) -> Option<(u64, Option<usize>)> {
        if self.runs.is_empty() {
            return Some((plane, None));
        }
        let within = |run: &Run| {
            let i = plane.checked_sub(run.plane).filter(|i| *i < run.count)?;
            Some((run.page.checked_add(i)?, run.file))
        };
        self.runs.iter().find_map(within)
    }
}
