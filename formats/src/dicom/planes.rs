//! Planes of a series put in order: by where they lie along the normal of their slices, else by their numbers. Where
//! they are no even stack at right angles, it is said which of them is out of place.

use brickcast_volume::format::Placement;
use glam::DVec3;

use super::group::Group;
use super::image::Image;
use crate::mended::Filled;
use crate::space::Place;
use crate::wrong::Wrong;

/// How far an even step may be missed, of the step; positions are written with few digits.
const UNEVEN: f64 = 0.05;
/// What of that is not worth a word.
const TOLD: f64 = 1e-3;
/// Sideways shift over height: what more it is, is a tilt.
const TILT: f64 = 1e-3;
/// A gap of so many steps has room for a slice.
const MISSING: f64 = 1.5;

/// One plane: which image it is of, and which frame of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    pub(super) image: u32,
    pub(super) frame: u32,
}

#[derive(Debug)]
pub(super) struct Ordered {
    /// Nothing where a slice is to be filled.
    pub(super) planes: Vec<Option<Plane>>,
    pub(super) filled: Filled,
    pub(super) place: Place,
    pub(super) notes: Vec<String>,
    /// At each place lay several slices, of which one was asked for.
    pub(super) has_several: bool,
}

impl Ordered {
    fn whole(place: Place, planes: Vec<Plane>, notes: Vec<String>) -> Self {
        let planes = planes.into_iter().map(Some).collect();
        Self { planes, filled: Filled::default(), place, notes, has_several: false }
    }
}

/// What is wrong with a plane, and in which image.
pub(super) type Misplaced = (u32, Wrong);

const APART: &str = "put the slices of one volume into a folder of their own, or name them by a pattern or a list";

/// Of one size, type and orientation each; of several slices at each place the one of this `time`. Where it `fills`,
/// slices that are missing between positions are left to be filled, and of two at one place the first is taken.
pub(super) fn ordered(images: &[Image], time: Option<u64>, fills: bool) -> Result<Ordered, Misplaced> {
    let mut planes: Vec<Plane> = (0..)
        .zip(images)
        .flat_map(|(image, i)| (0..i.groups.len() as u32).map(move |frame| Plane { image, frame }))
        .collect();
    let all = Stack { images, fills };
    let with = planes.iter().filter(|plane| all.group(**plane).position.is_some()).count();
    match with {
        0 => all.by_number(planes),
        n if n == planes.len() => {
            let normal = all.group(planes[0]).normal();
            let height = |plane: &Plane| all.position(*plane).dot(normal);
            planes.sort_by(|a, b| height(a).total_cmp(&height(b)));
            let several = all.several(&planes, normal);
            match several {
                1 => all.by_position(planes, normal),
                n => all.by_position(all.one_of(planes, n, time)?, normal).map(|found| Ordered {
                    notes: [vec![format!("of {n} slices at each place the one of --time was taken")], found.notes]
                        .concat(),
                    has_several: true,
                    ..found
                }),
            }
        }
        _ => {
            let without = planes.iter().find(|plane| all.group(**plane).position.is_none());
            let plane = *without.unwrap_or(&planes[0]);
            let why = format!("{} has none, but {with} others have one", all.name(plane));
            Err((plane.image, Wrong::new("ImagePositionPatient", why, APART)))
        }
    }
}

struct Stack<'a> {
    images: &'a [Image],
    fills: bool,
}

impl Stack<'_> {
    fn group(&self, plane: Plane) -> &Group {
        &self.images[plane.image as usize].groups[plane.frame as usize]
    }

    fn position(&self, plane: Plane) -> DVec3 {
        self.group(plane).position.unwrap_or_default()
    }

    fn name(&self, plane: Plane) -> String {
        let image = &self.images[plane.image as usize];
        let file = image.path.file_name().unwrap_or_default().to_string_lossy();
        let file = brickcast_volume::format::excerpt(&file);
        match image.groups.len() {
            1 => file,
            _ => format!("frame {} of {file}", plane.frame + 1),
        }
    }

    /// Vectors from what the first plane says, the step along the normal among them.
    fn place(&self, first: Plane, step: DVec3, is_step_said: bool, notes: &mut Vec<String>) -> Place {
        let group = self.group(first);
        if group.spacing.is_none() && is_step_said {
            notes.push("spacing not said in the plane (PixelSpacing): 1, 1 assumed (--spacing X,Y,Z overrides)".into());
        }
        let [x, y] = group.axes.unwrap_or([DVec3::X, DVec3::Y]);
        let [rows, columns] = group.spacing.unwrap_or([1.0; 2]);
        let said = Placement {
            spacing: group.spacing.is_some() || is_step_said,
            origin: group.position.is_some(),
            directions: group.axes.is_some(),
        };
        Place { vectors: [x * columns, y * rows, step], origin: group.position.unwrap_or_default(), said }
    }

    /// A step that no positions say.
    fn assumed_step(&self, first: Plane, notes: &mut Vec<String>) -> (f64, bool) {
        let group = self.group(first);
        match (group.between, group.thickness) {
            (Some(step), _) => {
                notes.push(format!("the step from slice to slice is {step}, as SpacingBetweenSlices says"));
                (step, true)
            }
            (None, Some(step)) => {
                notes.push(format!("the step from slice to slice is {step}, as SliceThickness says: no gaps assumed"));
                (step, true)
            }
            (None, None) => {
                if group.spacing.is_some() {
                    notes.push("spacing not said from slice to slice: 1 assumed (--spacing X,Y,Z overrides)".into());
                }
                (1.0, false)
            }
        }
    }

    fn by_number(&self, mut planes: Vec<Plane>) -> Result<Ordered, Misplaced> {
        let mut notes = Vec::new();
        let number = |plane: &Plane| self.images[plane.image as usize].instance;
        if self.images.len() > 1 {
            if let Some(plane) = planes.iter().find(|plane| number(plane).is_none()) {
                let why = format!("{} has neither this nor an InstanceNumber", self.name(*plane));
                let remedy = "name the slices in their order by a list, as another format (TIFF, PNG)";
                return Err((plane.image, Wrong::new("ImagePositionPatient", why, remedy)));
            }
            planes.sort_by_key(|plane| (number(plane), plane.frame));
            self.check_numbers(&planes)?;
            notes.push("no ImagePositionPatient: slices are in the order of InstanceNumber".into());
        } else if planes.len() > 1 {
            notes.push("its frames have no positions: taken as slices in their order".into());
        }
        let (step, is_said) = self.assumed_step(planes[0], &mut notes);
        let step = self.group(planes[0]).normal() * step;
        Ok(Ordered::whole(self.place(planes[0], step, is_said, &mut notes), planes, notes))
    }

    fn check_numbers(&self, planes: &[Plane]) -> Result<(), Misplaced> {
        let number = |plane: Plane| self.images[plane.image as usize].instance.unwrap_or_default();
        let pairs = || planes.windows(2).map(|w| (w[0], w[1])).filter(|(a, b)| a.image != b.image);
        let names = |a: Plane, b: Plane| format!("{} and {}", self.name(a), self.name(b));
        let (b, why) = match (
            pairs().find(|(a, b)| number(*a) == number(*b)),
            pairs().find(|(a, b)| number(*b).saturating_sub(number(*a)) > 1),
        ) {
            (None, None) => return Ok(()),
            (Some((a, b)), _) => (b, format!("{} both have the number {}", names(a, b), number(a))),
            (None, Some((a, b))) => {
                let (lo, hi) = (number(a) + 1, number(b) - 1);
                let missing = if lo == hi { format!("{lo} is") } else { format!("{lo} to {hi} are") };
                (b, format!("{missing} missing, between {}", names(a, b)))
            }
        };
        Err((b.image, Wrong::new("InstanceNumber", why, APART)))
    }

    /// Sorted along the normal.
    fn by_position(&self, mut planes: Vec<Plane>, normal: DVec3) -> Result<Ordered, Misplaced> {
        let mut notes = Vec::new();
        let (first, last) = (planes[0], planes[planes.len() - 1]);
        if planes.len() == 1 {
            let (step, is_said) = self.assumed_step(first, &mut notes);
            return Ok(Ordered::whole(self.place(first, normal * step, is_said, &mut notes), planes, notes));
        }
        let height = |plane: &Plane| self.position(*plane).dot(normal);
        let mut heights: Vec<f64> = planes.iter().map(height).collect();
        if self.fills {
            let least = least_step(&heights);
            planes.dedup_by(|b, a| {
                let is_doubled = height(b) - height(a) <= least;
                if is_doubled {
                    notes.push(format!("left out: {}, which lies where {} does", self.name(*b), self.name(*a)));
                }
                is_doubled
            });
            heights = planes.iter().map(height).collect();
        }
        self.check_doubled(&planes, &heights)?;
        // Where each of them comes among those that there should be.
        let mut filled = Filled::default();
        let at = match self.fills {
            true => self.places(&planes, &heights, &mut filled)?,
            false => {
                self.check_gaps(&planes, &heights)?;
                (0..planes.len()).collect()
            }
        };
        let count = at[planes.len() - 1].max(1) as f64;
        let (bottom, span) = (heights[0], heights[planes.len() - 1] - heights[0]);
        let step = (self.position(last) - self.position(first)) / count;
        let along = span / count;
        let sideways = (step - normal * along).length();
        if sideways > TILT * along {
            let why = format!(
                "each slice lies {sideways:.4} mm aside of the one below it, {along:.4} mm away: the gantry was tilted \
                 by {:.2} degrees",
                (sideways / along).atan().to_degrees()
            );
            let remedy = "resample it to axes at right angles, e.g. with dcm2niix (which writes NIfTI) or Slicer";
            return Err((first.image, Wrong::new("ImagePositionPatient", why, remedy)));
        }
        let pixel = self.group(first).spacing.map_or(along, |[a, b]| a.min(b)).max(1e-9);
        let mut farthest = 0.0_f64;
        for (plane, height) in planes.iter().zip(&heights) {
            let even = self.position(first) + step * ((height - bottom) / along);
            let aside = (self.position(*plane) - even).length();
            if aside > UNEVEN * pixel {
                let why = format!("{} lies {aside:.4} mm aside of the line of the others", self.name(*plane));
                return Err((plane.image, Wrong::new("ImagePositionPatient", why, APART)));
            }
        }
        for (i, height) in at.iter().zip(&heights) {
            farthest = farthest.max((height - bottom - along * *i as f64).abs());
        }
        if farthest > UNEVEN * along {
            let (thin, wide) = heights
                .windows(2)
                .map(|w| w[1] - w[0])
                .fold((f64::MAX, 0.0_f64), |(lo, hi), gap| (lo.min(gap), hi.max(gap)));
            let why = format!("the steps from slice to slice are not even: from {thin:.4} to {wide:.4} mm");
            let remedy = "resample it to even steps, e.g. with dcm2niix (which writes NIfTI) or Slicer";
            return Err((first.image, Wrong::new("ImagePositionPatient", why, remedy)));
        }
        if farthest > TOLD * along {
            notes
                .push(format!("slices lie up to {farthest:.4} mm beside an even step of {along:.4} mm: taken as even"));
        }
        notes.push(format!("sorted by position: {} slices, a step of {along} mm", planes.len()));
        let place = self.place(first, step, true, &mut notes);
        let mut slots = vec![None; at[planes.len() - 1] + 1];
        at.iter().zip(planes).for_each(|(i, plane)| slots[*i] = Some(plane));
        Ok(Ordered { place, planes: slots, filled, notes, has_several: false })
    }

    /// Where each slice comes among those that there should be, with room for what is missing.
    fn places(&self, planes: &[Plane], heights: &[f64], filled: &mut Filled) -> Result<Vec<usize>, Misplaced> {
        let least = heights.windows(2).map(|w| w[1] - w[0]).fold(f64::MAX, f64::min);
        let Some(at) = with_holes(heights, least).or_else(|| with_holes(heights, usual_step(heights))) else {
            self.check_gaps(planes, heights)?;
            let why = "more slices would be missing than there are";
            return Err((planes[0].image, Wrong::new("ImagePositionPatient", why, APART)));
        };
        for (i, pair) in at.windows(2).enumerate() {
            let between = || format!("between {} and {}", self.name(planes[i]), self.name(planes[i + 1]));
            (pair[0] + 1..pair[1]).for_each(|_| filled.add(between(), "which is missing"));
        }
        Ok(at)
    }

    /// How many slices lie at each place, where these are as many everywhere; else 1.
    fn several(&self, planes: &[Plane], normal: DVec3) -> usize {
        let heights: Vec<f64> = planes.iter().map(|plane| self.position(*plane).dot(normal)).collect();
        let least = least_step(&heights);
        let mut counts = heights.chunk_by(|a, b| b - a <= least).map(<[f64]>::len);
        let first = counts.next().unwrap_or(1);
        if counts.all(|count| count == first) { first } else { 1 }
    }

    /// Of `several` slices at each place one.
    fn one_of(&self, planes: Vec<Plane>, several: usize, time: Option<u64>) -> Result<Vec<Plane>, Misplaced> {
        let places = planes.len() / several;
        let Some(time) = time.and_then(|t| usize::try_from(t).ok()).filter(|t| *t < several) else {
            let why = format!(
                "{several} slices lie at each of {places} places, {} and {} at one: several times, echoes or parts in \
                 one series; --time 0 to {} takes one of each",
                self.name(planes[0]),
                self.name(planes[1]),
                several - 1
            );
            return Err((planes[0].image, Wrong::new("ImagePositionPatient", why, APART)));
        };
        let key = |plane: &Plane| {
            let image = &self.images[plane.image as usize];
            (image.time, image.instance, plane.image, plane.frame)
        };
        let one = |place: &[Plane]| {
            let mut place = place.to_vec();
            place.sort_by_key(key);
            place[time]
        };
        Ok(planes.chunks(several).map(one).collect())
    }

    fn check_doubled(&self, planes: &[Plane], heights: &[f64]) -> Result<(), Misplaced> {
        let gap = |i: usize| heights[i + 1] - heights[i];
        let least = least_step(heights);
        let Some(i) = (0..planes.len() - 1).find(|i| gap(*i) <= least) else { return Ok(()) };
        let same = (i..planes.len() - 1).take_while(|i| gap(*i) <= least).count() + 1;
        let why = format!(
            "{} and {} lie at the same place, {same} slices there in all: several times, echoes or parts in one series",
            self.name(planes[i]),
            self.name(planes[i + 1])
        );
        Err((planes[i + 1].image, Wrong::new("ImagePositionPatient", why, APART)))
    }

    fn check_gaps(&self, planes: &[Plane], heights: &[f64]) -> Result<(), Misplaced> {
        let mut gaps: Vec<f64> = heights.windows(2).map(|w| w[1] - w[0]).collect();
        let missing = |gap: f64, usual: f64| (gap / usual).round() - 1.0;
        let usual = usual_step(heights);
        let Some(i) = gaps.iter().position(|gap| *gap > MISSING * usual) else { return Ok(()) };
        let count: f64 = gaps.drain(..).filter(|gap| *gap > MISSING * usual).map(|gap| missing(gap, usual)).sum();
        let why = format!(
            "{} and {} lie {:.4} mm apart, others {usual:.4}: {count} slices are missing",
            self.name(planes[i]),
            self.name(planes[i + 1]),
            heights[i + 1] - heights[i],
        );
        Err((planes[i + 1].image, Wrong::new("ImagePositionPatient", why, "put the missing slices there")))
    }
}

/// The place of each in steps of `usual`; nothing where more would be missing than there are.
fn with_holes(heights: &[f64], usual: f64) -> Option<Vec<usize>> {
    let mut at = vec![0];
    for gap in heights.windows(2).map(|w| w[1] - w[0]) {
        let steps = (gap / usual).round().max(1.0);
        let next = at[at.len() - 1] as f64 + steps;
        at.push((next < 2.0 * heights.len() as f64).then_some(next as usize)?);
    }
    Some(at)
}

/// The middle one of those between slices.
fn usual_step(heights: &[f64]) -> f64 {
    let mut gaps: Vec<f64> = heights.windows(2).map(|w| w[1] - w[0]).collect();
    let middle = gaps.len().saturating_sub(1) / 2;
    gaps.sort_by(f64::total_cmp);
    gaps.get(middle).copied().unwrap_or(1.0)
}

/// Slices that are nearer to each other lie at one place.
fn least_step(heights: &[f64]) -> f64 {
    let span = heights.last().zip(heights.first()).map_or(0.0, |(last, first)| last - first);
    1e-6_f64.max(1e-3 * span / heights.len() as f64)
}
