//! What can go wrong between a picture and its file.

use std::path::PathBuf;

use brickcast_volume::small_file::FileError;

use crate::picture::PictureError;

#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    #[error("{path:?}: the format is chosen by the extension; use .png, .exr, or .apng, .gif, .mp4, .webm")]
    Extension { path: PathBuf },
    #[error("cannot write {path:?}: the folder {folder:?} does not exist; create it first")]
    NoFolder { path: PathBuf, folder: PathBuf },
    #[error("cannot write {path:?}: it is a folder; name a file in it")]
    IsFolder { path: PathBuf },
    #[error("cannot write {path:?}: {error}")]
    Write { path: PathBuf, error: std::io::Error },
    #[error(transparent)]
    Read(#[from] FileError),
    #[error("cannot encode {path:?}: {problem}")]
    Encode { path: PathBuf, problem: String },
    #[error("cannot decode {path:?}: {problem}")]
    Decode { path: PathBuf, problem: String },
    #[error(transparent)]
    Picture(#[from] PictureError),
    #[error("a frame of {got_width}x{got_height} does not fit {path:?}, whose frames are {width}x{height}")]
    FrameSize { path: PathBuf, got_width: u32, got_height: u32, width: u32, height: u32 },
    #[error("{path:?} was announced with {want} frames and got {got}")]
    FrameCount { path: PathBuf, want: u32, got: u32 },
    #[error("{0} frames: give at least 1 and at most {max}", max = super::limits::MAX_FRAMES)]
    Frames(u32),
    #[error("{0} frames a second: a .gif shows at most 50; take fewer, or write an .apng or a film")]
    GifRate(f64),
    #[error(
        "{path:?}: films are encoded by ffmpeg, which is not on the PATH; install it, or write frames (-o turn.png) or \
         an .apng or a .gif, and encode them where it is: ffmpeg -framerate 25 -i turn_%04d.png turn.mp4"
    )]
    NoEncoder { path: PathBuf },
    #[error("{path:?} is not compared: it does not hold the colours that were drawn, as .png, .apng and .exr do")]
    NotCompared { path: PathBuf },
    #[error("{0} frames per second: must lie between 0.1 and 240")]
    FramesPerSecond(f64),
}
