//! What finding regions needs, before it is asked for: whole planes are held for it.

use std::fs;

use super::profile::REGION_HALO;
use super::region_error::RegionsError;
use super::shell::has_halos;
use crate::brick::BrickGrid;
use crate::regions::components::SLAB_PLANES;

/// Bytes for each voxel of a slab: its code, its label, its distance in the scratch file and in the store.
const SLAB_BYTES: u64 = 2 + 4 + 1 + 1;
/// Bytes for each voxel of a plane while components are told apart: the faces of blocks, and what goes on into the next slab.
const PLANE_BYTES: u64 = 32;
/// Bytes of a label and a distance.
const HALO_BYTES: u64 = 4 + 1;

/// Bytes that regions of a volume need at least, whatever is in it.
pub(super) fn region_bytes(grid: &BrickGrid) -> u64 {
    let (d, size) = (grid.volume_dims(), u64::from(grid.brick_size()));
    let plane = u64::from(d.x) * u64::from(d.y);
    let of_slab = SLAB_BYTES * u64::from(SLAB_PLANES.min(d.z)) + PLANE_BYTES;
    // Planes of voxels that the shells of a layer of bricks are; that layer and half of the next are held.
    let grown = size + 2 * u64::from(REGION_HALO.last);
    let shells = (grown.pow(3) - size.pow(3)).div_ceil(size * size);
    let of_halos = if has_halos(grid.brick_size()) { HALO_BYTES * shells.min(2 * u64::from(d.z)) } else { 0 };
    plane * (of_slab + of_halos)
}

/// An error rather than a machine that swaps, or a process that is killed.
pub(super) fn check_regions(grid: &BrickGrid) -> Result<(), RegionsError> {
    check(region_bytes(grid), available())
}

fn check(need: u64, available: Option<u64>) -> Result<(), RegionsError> {
    match available {
        Some(available) if need > available => Err(RegionsError::Memory { need, available }),
        _ => Ok(()),
    }
}

/// Bytes that this process can still get without swapping; nothing where the system does not tell.
fn available() -> Option<u64> {
    let number = |path| fs::read_to_string(path).ok()?.trim().parse::<u64>().ok();
    let of_group = number("/sys/fs/cgroup/memory.max")
        .and_then(|max| Some(max.saturating_sub(number("/sys/fs/cgroup/memory.current")?)));
    let of_machine = available_of(&fs::read_to_string("/proc/meminfo").ok()?)?;
    Some(of_group.unwrap_or(u64::MAX).min(of_machine))
}

fn available_of(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<u64>().ok()? << 10)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::UVec3;

    #[test]
    fn the_need_follows_the_plane_and_not_the_depth() {
        let need = |dims: [u32; 3], size| region_bytes(&BrickGrid::new(UVec3::from(dims), size).unwrap());
        let per_voxel = |n: u32, depth, size| need([n, n, depth], size) / u64::from(n * n);
        assert_eq!(per_voxel(2048, 100, 64), per_voxel(4096, 1000, 64));
        // docs/store-format.md names what halos take.
        assert_eq!(per_voxel(2048, 100, 8), 8 * 32 + 32);
        assert_eq!(per_voxel(2048, 100, 64), 8 * 32 + 32 + 175);
        assert!(per_voxel(2048, 4, 64) < 110);
    }

    #[test]
    fn more_than_there_is_is_refused_with_both_figures() {
        assert_eq!(check(100, Some(100)), Ok(()));
        assert_eq!(check(100, None), Ok(()));
        let error = check(5 << 30, Some(1 << 30)).unwrap_err().to_string();
        assert!(error.contains("5368709120") && error.contains("1073741824"), "{error}");
    }

    #[test]
    fn what_is_available_is_read_in_kibibytes() {
        assert_eq!(available_of("MemTotal:  8 kB\nMemAvailable:    2048 kB\n"), Some(2 << 20));
        assert_eq!(available_of("MemTotal:  8 kB\n"), None);
    }
}
