//! The compositor: plan, order, over, ledger, outputs and the command line.

pub mod output;
