//! The brick store from outside: what goes in comes out, damage is named, bytes from the wire do no harm.

mod damage;
mod halos;
mod inspect;
#[cfg(unix)]
mod jail;
mod labels;
mod level_files;
mod levels;
mod mutations;
mod no_data;
mod objects;
mod outcome;
mod parts;
mod phantom;
mod regions;
mod rescale;
mod round_trip;
mod series;
mod support;
mod tiles;
mod views;
