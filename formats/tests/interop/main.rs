//! Files that other programs write are read voxel by voxel.

fn main() -> std::process::ExitCode {
    brickcast_harness::main()
}
