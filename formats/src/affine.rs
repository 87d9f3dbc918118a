//! Quaternions and matrices of medical formats.

use glam::{DMat3, DQuat, DVec3};

/// The rotation that NIfTI's `quatern_b`, `_c` and `_d` stand for.
pub(crate) fn rotation_of_quaternion([b, c, d]: [f64; 3]) -> DMat3 {
    let rest = 1.0 - (b * b + c * c + d * d);
    match rest < 1e-7 {
        // A half turn, whose a is lost in rounding.
        true => {
            let v = DVec3::new(b, c, d).normalize_or(DVec3::X);
            DMat3::from_quat(DQuat::from_xyzw(v.x, v.y, v.z, 0.0))
        }
        false => DMat3::from_quat(DQuat::from_xyzw(b, c, d, rest.sqrt())),
    }
}
