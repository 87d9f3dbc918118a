//! Which formats there are.

use std::path::Path;

use super::error::OutputError;
use super::film;

/// What a file name's extension stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutputFormat {
    /// 8-bit straight RGBA, or opaque RGB over a background.
    Png,
    /// An animation of such pictures.
    Apng,
    /// 32-bit float premultiplied RGBA.
    Exr,
    /// An animation of opaque frames, 256 colours each.
    Gif,
    /// Films, which the user's ffmpeg encodes.
    Mp4,
    Webm,
}

/// What lies behind pictures of formats that have no alpha, where nothing else was said.
const WHITE: [f32; 3] = [1.0; 3];

impl OutputFormat {
    /// # Errors
    /// No extension or another one than png, apng, exr, gif, mp4, webm (in any case).
    pub fn from_path(path: &Path) -> Result<Self, OutputError> {
        match path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).as_deref() {
            Some("png") => Ok(Self::Png),
            Some("apng") => Ok(Self::Apng),
            Some("exr") => Ok(Self::Exr),
            Some("gif") => Ok(Self::Gif),
            Some("mp4") => Ok(Self::Mp4),
            Some("webm") => Ok(Self::Webm),
            _ => Err(OutputError::Extension { path: path.to_owned() }),
        }
    }

    /// What lies behind the pictures where `asked` was asked for: nothing where they keep their alpha.
    #[must_use]
    pub fn background(self, asked: Option<[f32; 3]>) -> Option<[f32; 3]> {
        match self {
            Self::Exr => None,
            Self::Png | Self::Apng => asked,
            Self::Gif | Self::Mp4 | Self::Webm => asked.or(Some(WHITE)),
        }
    }

    /// True where a sequence becomes one file.
    #[must_use]
    pub fn is_animation(self) -> bool {
        !matches!(self, Self::Png | Self::Exr)
    }

    /// # Errors
    /// What encodes this format is not there: `path` could not be written.
    pub fn check(self, path: &Path) -> Result<(), OutputError> {
        match self {
            Self::Mp4 | Self::Webm => film::check(path),
            Self::Png | Self::Apng | Self::Exr | Self::Gif => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_alpha_lies_on_white_unless_something_else_was_asked_for() {
        let grey = Some([0.5; 3]);
        assert_eq!(OutputFormat::Exr.background(grey), None);
        assert_eq!([None, grey].map(|asked| OutputFormat::Png.background(asked)), [None, grey]);
        assert_eq!([None, grey].map(|asked| OutputFormat::Gif.background(asked)), [Some(WHITE), grey]);
    }

    #[test]
    fn extensions_choose_the_format_and_others_are_refused_by_name() {
        for (name, want) in [
            ("a.png", OutputFormat::Png),
            ("b/C.PNG", OutputFormat::Png),
            ("x.y.apng", OutputFormat::Apng),
            ("a.gif", OutputFormat::Gif),
            ("a.Webm", OutputFormat::Webm),
        ] {
            assert_eq!(OutputFormat::from_path(Path::new(name)).unwrap(), want);
        }
        assert_eq!(OutputFormat::from_path(Path::new("a.exr")).unwrap(), OutputFormat::Exr);
        for name in ["a", "a.jpg", ".png", "dir.png/"] {
            if let Err(error) = OutputFormat::from_path(Path::new(name)) {
                let text = error.to_string();
                assert!(text.contains(name) && text.contains(".png, .exr, or .apng"), "{text}");
            } else {
                assert_eq!(name, "dir.png/");
            }
        }
    }
}
