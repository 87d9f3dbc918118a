//! Writes analytic fields as NRRD files, for benchmarks: Marschner & Lobb's, and concentric shells.
//!
//! `cargo run -p brickcast-volume --example fields -- DIR [EDGE]`

use std::error::Error;
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

/// Marschner & Lobb 1994, equation 2 (alpha 0.25, f_M 6), over -1..=1; 0..=1. It fades out towards the faces, where
/// what the definition of the first and last slab costs would hide everything else.
fn marschner_lobb([x, y, z]: [f64; 3]) -> f64 {
    let wave = (2.0 * PI * 6.0 * (FRAC_PI_2 * x.hypot(y)).cos()).cos();
    let fade = |x: f64| ((1.0 - x.abs()) / 0.15).clamp(0.0, 1.0);
    let fades = [x, y, z].map(fade).map(|f| f * f * (3.0 - 2.0 * f));
    (1.0 - (FRAC_PI_2 * z).sin() + 0.25 * (1.0 + wave)) / (2.0 * 1.25) * fades.iter().product::<f64>()
}

/// The distance from the middle, 1 there and 0 on the faces: every value is a shell.
fn shells([x, y, z]: [f64; 3]) -> f64 {
    1.0 - (x * x + y * y + z * z).sqrt()
}

fn write(path: &Path, edge: u32, field: fn([f64; 3]) -> f64) -> Result<(), Box<dyn Error>> {
    let mut data =
        format!("NRRD0004\ntype: uint16\ndimension: 3\nsizes: {edge} {edge} {edge}\nencoding: raw\nendian: little\n\n")
            .into_bytes();
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(edge) * 2.0 - 1.0;
    for z in 0..edge {
        for y in 0..edge {
            for x in 0..edge {
                let value = field([at(x), at(y), at(z)]).clamp(0.0, 1.0);
                data.extend(((value * 65535.0).round() as u16).to_le_bytes());
            }
        }
    }
    std::fs::write(path, data)?;
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let folder = args.next().ok_or("the folder to write to is missing")?;
    let edge = args.next().map_or(Ok(128), |text| text.parse())?;
    write(&Path::new(&folder).join("marschner_lobb.nrrd"), edge, marschner_lobb)?;
    write(&Path::new(&folder).join("shells.nrrd"), edge, shells)
}
