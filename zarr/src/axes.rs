//! Which axes of an array are x, y and z, and where along the others the volume lies.

use brickcast_volume::format::RawHints;
use brickcast_volume::shown::shown;

use crate::array::Array;
use crate::error::OmeZarrError;
use crate::image::Image;

/// The order of all axes, where nothing is said of them.
const USUAL: [&str; 5] = ["t", "c", "z", "y", "x"];

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Axes {
    /// Of the array, along x, y, z; an array of pictures has no z.
    pub(crate) space: [Option<usize>; 3],
    /// Where the volume lies along every axis; 0 along x, y, z.
    pub(crate) at: Vec<u64>,
    /// What was taken of several.
    pub(crate) notes: Vec<String>,
}

impl Axes {
    pub(crate) fn of(image: &Image, array: &Array, hints: &RawHints) -> Result<Self, OmeZarrError> {
        let count = array.shape.len();
        let mut notes = Vec::new();
        let names: Vec<String> = match &image.axes {
            Some(axes) if axes.len() == count => axes.iter().map(|axis| axis.name.clone()).collect(),
            Some(axes) => {
                let problem = format!("{} axes are named, the array has {count}", axes.len());
                return Err(array.json.problem(problem));
            }
            None if count <= USUAL.len() => {
                let names = &USUAL[USUAL.len() - count..];
                notes.push(format!("axes not said: {} assumed", names.join(", ")));
                names.iter().map(|name| (*name).to_owned()).collect()
            }
            None => return Err(array.json.problem(format!("nothing names its {count} axes"))),
        };
        let place = |name: &str| names.iter().position(|other| other == name);
        let space = [place("x"), place("y"), place("z")];
        if space[0].is_none() || space[1].is_none() {
            let problem = format!("its axes are {}: x and y are needed", shown(&names.join(", ")));
            return Err(array.json.problem(problem));
        }
        let flags = [("c", "--channel", hints.channel, "channel"), ("t", "--time", hints.time, "time")];
        if let Some((_, flag, Some(asked), _)) =
            flags.iter().find(|f| f.2.is_some_and(|n| n > 0) && place(f.0).is_none())
        {
            return Err(OmeZarrError::NoAxis { flag, asked: *asked });
        }
        let mut at = vec![0; count];
        for (axis, name) in names.iter().enumerate().filter(|(axis, _)| !space.contains(&Some(*axis))) {
            let length = array.shape[axis];
            match flags.iter().find(|(short, ..)| short == name).filter(|(short, ..)| place(short) == Some(axis)) {
                Some((_, flag, asked, what)) => {
                    at[axis] = index(flag, *asked, length)?;
                    if length > 1 && asked.is_none() {
                        let called = match image.channels.as_slice() {
                            named @ [_, ..] if *what == "channel" => format!(" ({})", first(named)),
                            _ => String::new(),
                        };
                        notes.push(format!("{what} 0 of {length}{called} was taken; {flag} N takes another"));
                    }
                }
                None if length == 1 => {}
                None => {
                    let problem = format!(
                        "its axis `{}` has {length} places; x, y, z, c and t are read, and others of one place",
                        shown(name)
                    );
                    return Err(array.json.problem(problem));
                }
            }
        }
        Ok(Self { space, at, notes })
    }
}

fn index(flag: &'static str, asked: Option<u64>, count: u64) -> Result<u64, OmeZarrError> {
    match asked.unwrap_or(0) {
        asked if asked < count => Ok(asked),
        asked => Err(OmeZarrError::Index { flag, asked, count }),
    }
}

fn first(names: &[String]) -> String {
    const SHOWN: usize = 8;
    let more = if names.len() > SHOWN { ", ..." } else { "" };
    names[..names.len().min(SHOWN)].join(", ") + more
}
