//! Why a picture is empty, told before a ray is cast where that can be known, and once it is there else.

use brickcast_volume::scene::{RegionView, Scene};
use brickcast_volume::store::Manifest;
use brickcast_volume::style::{Clip, Mode};
use brickcast_volume::transfer_function::TransferFunction;
use brickcast_volume::{Geometry, OwnedBox, Premul};
use glam::{DMat3, DVec3, DVec4, UVec3};

use super::preset_fit::values_of;
use crate::picture::Picture;

/// Less alpha than this is 0 in eight bits.
const LEAST_ALPHA: f32 = 0.5 / 255.0;

/// What is known of a picture before it is rendered.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Outlook {
    /// Nothing will show, and why.
    Nothing(String),
    /// Nothing or little may show, and why.
    Little(String),
}

impl Outlook {
    /// For people.
    pub(crate) fn in_words(&self) -> String {
        match self {
            Self::Nothing(why) => format!("nothing of the volume shows: {why}"),
            Self::Little(why) => format!("nothing or little of the volume may show: {why}"),
        }
    }

    pub(crate) fn why(&self) -> &str {
        match self {
            Self::Nothing(why) | Self::Little(why) => why,
        }
    }
}

/// What can be told of a scene on a store without its voxels.
pub(crate) fn outlook(scene: &Scene, store: &Manifest) -> Option<Outlook> {
    let nothing = clipped(&scene.look.style.clip, &store.geometry)
        .or_else(|| out_of_view(scene, &store.geometry))
        .or_else(|| no_region(scene, store))
        .or_else(|| no_opacity(scene, store));
    nothing.map(Outlook::Nothing).or_else(|| clear_projection(scene, store).map(Outlook::Little))
}

/// True where no pixel shows anything.
pub(crate) fn is_empty(picture: &Picture) -> bool {
    picture.pixels().iter().all(|p: &Premul| p.a < LEAST_ALPHA)
}

/// What to tell once `empty` of `frames` complete pictures are there and show nothing.
pub(crate) fn afterwards(empty: usize, frames: usize, told: Option<&Outlook>) -> Option<String> {
    match told {
        _ if empty == 0 => None,
        Some(Outlook::Nothing(_)) => None,
        Some(Outlook::Little(_)) if empty == frames => {
            Some(if frames == 1 { "nothing shows in the picture" } else { "nothing shows in any frame" }.to_owned())
        }
        _ if empty < frames => Some(format!("nothing shows in {empty} of {frames} frames")),
        _ => Some(
            "nothing shows: no ray meets a value that has opacity and is in view; brickcast info tells the volume's \
             values, size and spacing"
                .to_owned(),
        ),
    }
}

fn clipped(clip: &Clip, geometry: &Geometry) -> Option<String> {
    let (lo, hi) = (DVec3::ZERO, geometry.dims().as_dvec3());
    if leaves_something(&clip.index_planes(geometry), lo, hi) {
        return None;
    }
    let (from, to) = world_box(geometry);
    let volume = format!("the volume's box, {} to {} in world units", at(from), at(to));
    Some(match (clip.bounds, clip.planes.is_empty()) {
        (Some((lo, hi)), true) => format!("the clip box, {} to {}, does not meet {volume}", at(lo), at(hi)),
        (None, _) => format!("the clip planes leave nothing of {volume}"),
        (Some(_), false) => format!("clip box and clip planes together leave nothing of {volume}"),
    })
}

/// True where a point of the box is inside all half spaces `n . p >= w`: then a corner of what is left lies on three
/// planes.
fn leaves_something(planes: &[DVec4], lo: DVec3, hi: DVec3) -> bool {
    let faces = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().zip([0, 1, 2]);
    let faces = faces.flat_map(|(axis, a)| [axis.extend(lo[a]), (-axis).extend(-hi[a])]);
    let all: Vec<DVec4> = planes.iter().copied().chain(faces).collect();
    let slack = 1e-9 * (1.0 + hi.max_element());
    let inside = |p: DVec3| all.iter().all(|plane| plane.truncate().dot(p) >= plane.w - slack);
    for (i, a) in all.iter().enumerate() {
        for (j, b) in all.iter().enumerate().skip(i + 1) {
            for c in &all[j + 1..] {
                let normals = DMat3::from_cols(a.truncate(), b.truncate(), c.truncate()).transpose();
                if normals.determinant().abs() > 1e-12 && inside(normals.inverse() * DVec3::new(a.w, b.w, c.w)) {
                    return true;
                }
            }
        }
    }
    false
}

fn out_of_view(scene: &Scene, geometry: &Geometry) -> Option<String> {
    let view = scene.view_of(geometry).ok()?;
    if !view.project(&OwnedBox { lo: UVec3::ZERO, hi: geometry.dims() }).is_empty() {
        return None;
    }
    let (eye, forward) = (scene.view.camera.position(), scene.view.camera.basis().2);
    let center = geometry.center_world();
    let (from, to) = world_box(geometry);
    let is_behind = (center - eye).dot(forward) < 0.0;
    let where_it_is = if is_behind { "the volume lies behind the camera" } else { "the volume lies outside the frame" };
    let camera = format!("the eye is at {} and looks at {}", at(eye), at(scene.view.camera.focal_point()));
    Some(format!("{where_it_is}: {camera}, the volume's box is {} to {} in world units", at(from), at(to)))
}

fn no_region(scene: &Scene, store: &Manifest) -> Option<String> {
    let regions = store.regions.as_ref();
    match scene.look.region_view {
        RegionView::Regions if regions.is_none_or(|r| r.voxels == 0) => {
            Some("--view regions shows regions, and the store has none".to_owned())
        }
        RegionView::Residual if regions.is_some_and(|r| r.voxels == store.geometry.voxel_count()) => {
            Some("--view residual shows what is in no region, and every voxel is in one".to_owned())
        }
        _ => None,
    }
}

fn no_opacity(scene: &Scene, store: &Manifest) -> Option<String> {
    let [lo, hi] = values_of(store);
    let functions =
        || [Some(&scene.look.transfer_function), scene.look.region_transfer_function.as_ref()].into_iter().flatten();
    if functions().any(|function| Opaque::of(function).within(lo, hi)) {
        return None;
    }
    let surfaces = &scene.look.style.surfaces;
    // One below all values is met where rays enter the volume.
    if surfaces.iter().any(|s| s.value <= hi && s.opacity > 0.0) {
        return None;
    }
    let volume = format!("the volume's values run from {lo} to {hi}");
    let ranges: Vec<String> = functions().filter_map(opaque_range).collect();
    Some(match (surfaces.iter().map(|s| s.value).reduce(f64::min), ranges.is_empty()) {
        (Some(value), true) if surfaces.iter().any(|s| s.opacity > 0.0) => {
            format!("the isosurface {value} lies above all values: {volume}")
        }
        (_, true) => format!("the transfer function has no opacity anywhere ({volume})"),
        (surface, false) => format!(
            "no value of the volume has opacity under this transfer function: {volume}, its opacity {}{}",
            ranges.join(" and "),
            surface.map(|value| format!("; the isosurface {value} lies above them")).unwrap_or_default()
        ),
    })
}

/// Where a function has opacity: asked for every cell of a volume, so no question walks its points.
pub(super) struct Opaque<'a> {
    function: &'a TransferFunction,
    /// How many of the points before each, and of all, have opacity.
    before: Vec<usize>,
}

impl<'a> Opaque<'a> {
    pub(super) fn of(function: &'a TransferFunction) -> Self {
        let counts = function.opacities().iter().scan(0, |count, point| {
            *count += usize::from(point.opacity > 0.0);
            Some(*count)
        });
        Self { function, before: std::iter::once(0).chain(counts).collect() }
    }

    /// True where a value from `lo` to `hi` has opacity.
    pub(super) fn within(&self, lo: f64, hi: f64) -> bool {
        let points = self.function.opacities();
        let (from, to) = (points.partition_point(|p| p.x < lo), points.partition_point(|p| p.x <= hi));
        self.function.opacity(lo) > 0.0 || self.function.opacity(hi) > 0.0 || self.before[to] > self.before[from]
    }
}

/// Where the function has opacity, in words.
fn opaque_range(function: &TransferFunction) -> Option<String> {
    let points = function.opacities();
    let first = points.iter().position(|p| p.opacity > 0.0)?;
    let last = points.iter().rposition(|p| p.opacity > 0.0)?;
    let from = first.checked_sub(1).map(|i| points[i].x);
    let to = points.get(last + 1).map(|p| p.x);
    Some(match (from, to) {
        (Some(from), Some(to)) => format!("lies between {from} and {to}"),
        (Some(from), None) => format!("begins above {from}"),
        (None, Some(to)) => format!("ends at {to}"),
        (None, None) => "is everywhere".to_owned(),
    })
}

/// The smallest value of a ray, and often the mean, is the air's.
fn clear_projection(scene: &Scene, store: &Manifest) -> Option<String> {
    let [lo, hi] = values_of(store);
    let (what, shown) = match scene.look.style.mode {
        Mode::Minimum => ("--mode minip shows the smallest value of each ray", lo),
        Mode::Average => ("--mode average shows the mean value of each ray", store.mean),
        Mode::Composite | Mode::Maximum => return None,
    };
    (scene.look.transfer_function.opacity(shown) == 0.0).then(|| {
        format!(
            "{what}, and the transfer function is clear at {shown}; choose a window from the volume's smallest value \
             on: --window {lo},{hi}"
        )
    })
}

/// World, lower and upper corner of the box around the volume.
fn world_box(geometry: &Geometry) -> (DVec3, DVec3) {
    let dims = geometry.dims().as_dvec3();
    let corner = |i: u32| DVec3::from_array(std::array::from_fn(|a| if i >> a & 1 == 1 { dims[a] } else { 0.0 }));
    (0..8)
        .map(|i| geometry.world_from_voxel(corner(i)))
        .fold((DVec3::MAX, DVec3::MIN), |(lo, hi), p| (lo.min(p), hi.max(p)))
}

fn at(p: DVec3) -> String {
    let round = |v: f64| if v.abs() < 1e6 { (v * 1e4).round() / 1e4 } else { v };
    format!("({}, {}, {})", round(p.x), round(p.y), round(p.z))
}

#[cfg(test)]
mod tests {
    use brickcast_volume::style::ClipPlane;
    use brickcast_volume::transfer_function::{ColorPoint, Colormap, OpacityPoint};

    use super::*;

    #[test]
    fn half_spaces_that_meet_only_outside_the_box_leave_nothing() {
        let (lo, hi) = (DVec3::ZERO, DVec3::splat(10.0));
        let plane = |x: f64, y: f64, z: f64, w: f64| {
            let n = DVec3::new(x, y, z);
            (n / n.length()).extend(w / n.length())
        };
        for (planes, want) in [
            (vec![], true),
            (vec![plane(1.0, 0.0, 0.0, 9.0)], true),
            (vec![plane(1.0, 0.0, 0.0, 11.0)], false),
            (vec![plane(1.0, 1.0, 1.0, 29.0)], true),
            (vec![plane(1.0, 1.0, 1.0, 31.0)], false),
            // Each alone cuts the box, together they leave none of it.
            (vec![plane(1.0, 1.0, 0.0, 15.0), plane(-1.0, 0.0, 0.0, -4.0)], false),
            (vec![plane(1.0, 1.0, 0.0, 13.0), plane(-1.0, 0.0, 0.0, -4.0)], true),
        ] {
            assert_eq!(leaves_something(&planes, lo, hi), want, "{planes:?}");
        }
    }

    #[test]
    fn clip_boxes_are_compared_in_world_units() {
        let geometry = Geometry::new([24; 3], [0.05; 3], [0.0; 3]).unwrap();
        let bounds = |lo: f64, hi: f64| Clip { bounds: Some((DVec3::splat(lo), DVec3::splat(hi))), planes: vec![] };
        assert_eq!(clipped(&bounds(0.2, 1.0), &geometry), None);
        let why = clipped(&bounds(4.0, 20.0), &geometry).unwrap();
        assert!(why.contains("(4, 4, 4) to (20, 20, 20)") && why.contains("(-0.025, -0.025, -0.025)"), "{why}");
        let planes = vec![ClipPlane { normal: DVec3::X, offset: 4.0 }];
        assert!(clipped(&Clip { bounds: None, planes }, &geometry).unwrap().contains("clip planes leave nothing"));
    }

    #[test]
    fn opacity_between_points_and_beyond_them_counts() {
        let window = TransferFunction::window(100.0, 200.0, 0.5, Colormap::Viridis).unwrap();
        for (lo, hi, want) in [(0.0, 99.0, false), (0.0, 100.0, false), (0.0, 101.0, true), (300.0, 400.0, true)] {
            assert_eq!(Opaque::of(&window).within(lo, hi), want, "{lo} {hi}");
        }
        let points = [(10.0, 0.0), (11.0, 1.0), (12.0, 0.0)].map(|(x, opacity)| OpacityPoint { x, opacity });
        let peak = TransferFunction::new(vec![ColorPoint { x: 0.0, rgb: [1.0; 3] }], points.to_vec()).unwrap();
        assert!(Opaque::of(&peak).within(0.0, 100.0) && !Opaque::of(&peak).within(12.0, 100.0));
        assert_eq!(opaque_range(&peak).as_deref(), Some("lies between 10 and 12"));
        assert_eq!(opaque_range(&window).as_deref(), Some("begins above 100"));
    }

    #[test]
    fn an_empty_picture_is_told_once() {
        let nothing = Outlook::Nothing("x".to_owned());
        let little = Outlook::Little("x".to_owned());
        assert_eq!(afterwards(0, 3, None), None);
        assert_eq!(afterwards(3, 3, Some(&nothing)), None);
        assert!(afterwards(1, 1, None).unwrap().contains("nothing shows"));
        assert!(afterwards(2, 3, None).unwrap().contains("2 of 3 frames"));
        assert!(afterwards(1, 1, Some(&little)).is_some());
    }
}
