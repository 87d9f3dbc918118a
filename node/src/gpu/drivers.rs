//! What graphics drivers are told before they are loaded: we draw into memory, so that they need not look for a
//! desktop.

/// Variables that keep Mesa from asking a desktop for anything. Where no desktop is, it says "error: XDG_RUNTIME_DIR is
/// invalid or not set" for each question on standard error, and whoever greps logs for errors is paged.
const QUIET: [(&str, &str); 2] = [
    // The layer that sorts Vulkan devices by the screen they drive; we sort them ourselves.
    ("NODEVICE_SELECT", "1"),
    ("EGL_LOG_LEVEL", "fatal"),
];
/// Whoever sets one of these wants the layer's choice.
const CHOICES: [&str; 2] = ["MESA_VK_DEVICE_SELECT", "DRI_PRIME"];

/// Sets what keeps drivers quiet, unless whoever runs the program has set it, or relies on what it would switch off.
///
/// # Safety
/// No other thread runs yet: at the top of `main`, before anything else.
pub unsafe fn need_no_desktop() {
    for (name, value) in wanted(|name| std::env::var_os(name).is_some()) {
        // SAFETY: the caller says that no other thread reads the environment meanwhile.
        unsafe { std::env::set_var(name, value) };
    }
}

fn wanted(is_set: impl Fn(&str) -> bool) -> impl Iterator<Item = (&'static str, &'static str)> {
    let chosen = CHOICES.iter().any(|name| is_set(name));
    QUIET.into_iter().filter(move |(name, _)| !(is_set(name) || chosen && *name == "NODEVICE_SELECT"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_user_set_stays() {
        let names = |set: &[&str]| wanted(|name| set.contains(&name)).map(|(name, _)| name).collect::<Vec<_>>();
        assert_eq!(names(&[]), ["NODEVICE_SELECT", "EGL_LOG_LEVEL"]);
        assert_eq!(names(&["EGL_LOG_LEVEL"]), ["NODEVICE_SELECT"]);
        assert_eq!(names(&["DRI_PRIME"]), ["EGL_LOG_LEVEL"]);
    }
}
