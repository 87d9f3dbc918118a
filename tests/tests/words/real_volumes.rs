//! Volumes that others have made.

use brickcast_tests::process::shared_data;
use brickcast_volume::format::{self, RawHints, VoxelType};

/// Dims, type, and the facts that their page states.
#[test]
fn shared_volumes_are_read() {
    for (name, dims, voxel_type) in
        [("engine", [256, 256, 128], VoxelType::U8), ("walnut_u16", [128, 96, 114], VoxelType::U16)]
    {
        let mut source = format::open(&shared_data(&format!("{name}.nrrd")), &RawHints::default()).unwrap();
        assert_eq!((source.header().geometry.dims().to_array(), source.header().voxel_type), (dims, voxel_type));
        let (mut planes, mut bytes, mut last) = (Vec::new(), 0, 0);
        for _ in 0..dims[2].div_ceil(32) {
            source.read_planes(32, &mut planes).unwrap();
            bytes += planes.len();
            last = *planes.last().unwrap();
        }
        assert_eq!(bytes, dims.iter().product::<u32>() as usize * voxel_type.bytes());
        if name == "engine" {
            assert_eq!(last, 10, "the page says that the very last voxel is 10");
        }
    }
}
