//! Which formats there are.

use std::path::Path;

use super::error::OutputError;

/// What a file name's extension stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutputFormat {
    /// 8-bit straight RGBA, or opaque RGB over a background.
    Png,
    /// An animation of such pictures.
    Apng,
    /// 32-bit float premultiplied RGBA.
    Exr,
}

impl OutputFormat {
    /// # Errors
    /// No extension or another one than png, apng, exr (in any case).
    pub fn from_path(path: &Path) -> Result<Self, OutputError> {
        match path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).as_deref() {
            Some("png") => Ok(Self::Png),
            Some("apng") => Ok(Self::Apng),
            Some("exr") => Ok(Self::Exr),
            _ => Err(OutputError::Extension { path: path.to_owned() }),
        }
    }

    /// False where a background has no effect: EXR keeps its alpha.
    #[must_use]
    pub fn uses_background(self) -> bool {
        self != Self::Exr
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extensions_choose_the_format_and_others_are_refused_by_name() {
        for (name, want) in
            [("a.png", OutputFormat::Png), ("b/C.PNG", OutputFormat::Png), ("x.y.apng", OutputFormat::Apng)]
        {
            assert_eq!(OutputFormat::from_path(Path::new(name)).unwrap(), want);
        }
        assert_eq!(OutputFormat::from_path(Path::new("a.exr")).unwrap(), OutputFormat::Exr);
        for name in ["a", "a.jpg", ".png", "dir.png/"] {
            if let Err(error) = OutputFormat::from_path(Path::new(name)) {
                let text = error.to_string();
                assert!(text.contains(name) && text.contains(".png, .apng or .exr"), "{text}");
            } else {
                assert_eq!(name, "dir.png/");
            }
        }
    }
}
