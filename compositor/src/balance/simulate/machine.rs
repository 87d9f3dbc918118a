//! A node of the model.

/// The nodes of one view: time per unit of cost (of an unthrottled node), and whether it is there.
pub(super) struct Machine {
    pub(super) throttle: f64,
    pub(super) present: bool,
}
