//! What this machine lacks is said, and counted, by the test program itself.

use std::process::Command;

/// This program once more, on some of its tests, without any GPU driver: what it prints.
fn without_drivers(filter: &str, require_all: bool) -> (bool, String) {
    let mut program = Command::new(std::env::current_exe().unwrap());
    // OpenGL's drivers, too.
    for name in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES", "__EGL_VENDOR_LIBRARY_FILENAMES"] {
        program.env(name, "no/such/driver.json");
    }
    program.env_remove("BRICKCAST_REQUIRE_ALL").env_remove("BRICKCAST_ADAPTER").args([filter, "--color", "never"]);
    if require_all {
        program.env("BRICKCAST_REQUIRE_ALL", "1");
    }
    let output = program.output().unwrap();
    (output.status.success(), String::from_utf8(output.stdout).unwrap())
}

#[test]
fn what_needs_a_driver_is_ignored_where_there_is_none() {
    let (ok, said) = without_drivers("calls::", false);
    let line = |test: &str| said.lines().find(|line| line.contains(test)).unwrap_or(&said).to_owned();
    assert!(line("oversized_bricks_are_refused").contains("ignored (no Vulkan, "), "{said}");
    assert!(ok && said.contains("test result: ok. 1 passed; 0 failed; 9 ignored; "), "{said}");
    // The CPU's part of a test is no whole test.
    let (ok, said) = without_drivers("uniform_bricks_need_no_voxels", false);
    assert!(said.contains("ignored (in part: no Vulkan, "), "{said}");
    assert!(ok && said.contains("0 passed; 0 failed; 1 ignored; "), "{said}");
}

/// As in CI.
#[test]
fn what_needs_a_driver_fails_where_all_is_required() {
    let (ok, said) = without_drivers("oversized_bricks_are_refused", true);
    assert!(!ok && said.contains("oversized_bricks_are_refused ... FAILED"), "{said}");
    // What the failed test said is shown.
    assert!(
        said.contains("BRICKCAST_REQUIRE_ALL is set: no Vulkan, ") && said.contains("0 passed; 1 failed; "),
        "{said}"
    );
}
