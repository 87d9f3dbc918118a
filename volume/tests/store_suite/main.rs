//! The brick store from outside: what goes in comes out, damage is named, bytes from the wire do no harm.

mod damage;
mod mutations;
mod outcome;
mod round_trip;
mod support;
