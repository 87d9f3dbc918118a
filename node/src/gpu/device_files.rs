//! Whether the system has any GPU, told by its device files: asked before a driver is loaded. A software driver and its
//! compiler take a tenth of a second, as long as a small picture, only to tell that they are no GPU.

use std::ffi::OsString;
use std::path::Path;

/// What the names of GPUs' device files begin with, whoever makes them; those of Mesa's drivers lie in a folder.
const FILES: [&str; 10] =
    ["nvidia", "nvgpu", "nvhost", "nvmap", "dxg", "mali", "kgsl", "pvr", "galcore", "goldfish_pipe"];
const FOLDER: &str = "dri";
/// Of a device that renders, and not only drives a screen.
const IN_FOLDER: &str = "renderD";

/// False where no driver can find a GPU: on Linux without a device file of one. Elsewhere drivers are to be asked.
pub(super) fn may_have_gpu() -> bool {
    !cfg!(target_os = "linux") || has_device(Path::new("/dev"))
}

/// True also where the folder of devices cannot be read.
fn has_device(dev: &Path) -> bool {
    let Ok(devices) = names(dev) else { return true };
    let begins = |name: &OsString, with: &str| name.as_encoded_bytes().starts_with(with.as_bytes());
    devices.iter().any(|name| FILES.iter().any(|file| begins(name, file)))
        || (devices.iter().any(|name| name == FOLDER)
            && names(&dev.join(FOLDER)).map_or(true, |cards| cards.iter().any(|name| begins(name, IN_FOLDER))))
}

fn names(folder: &Path) -> std::io::Result<Vec<OsString>> {
    std::fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.file_name())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gpu_has_a_device_file() {
        let of = |files: &[&str]| {
            let dev = tempfile::tempdir().unwrap();
            for file in files {
                let path = dev.path().join(file);
                std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                std::fs::write(path, "").unwrap();
            }
            has_device(dev.path())
        };
        for none in [&[][..], &["null", "tty", "kmsg", "shm/x"], &["dri/card0", "dri/by-path/pci-card"]] {
            assert!(!of(none), "{none:?}");
        }
        for one in ["dri/renderD128", "nvidia0", "nvidiactl", "dxg", "mali0", "kgsl-3d0", "nvhost-gpu"] {
            assert!(of(&["null", one]), "{one}");
        }
        assert!(has_device(Path::new("/no/such/folder")), "what cannot be told is asked of drivers");
    }
}
