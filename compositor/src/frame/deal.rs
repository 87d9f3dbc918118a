//! What nobody renders goes to nodes that can.

use tokio::time::Instant;

use super::Run;
use super::error::FrameError;
use super::ledger::LedgerError;
use crate::plan::Unordered;

impl Run<'_, '_> {
    pub(super) fn can_work(&self, worker: usize) -> bool {
        let worker = &self.workers[worker];
        worker.out.is_none() && worker.client.is_some()
    }

    /// Orders what nobody renders from those that can; calls the lost again where nobody can. False where nobody ever
    /// will, and a part of the picture is there, or what is missing is what nobody has.
    pub(super) fn deal(&mut self, now: Instant) -> Result<bool, FrameError> {
        // After every event: nearly always there is nothing.
        if self.ledger.unordered().is_empty() {
            return Ok(true);
        }
        let open = self.ledger.unordered().only(|chunk| !self.nobody_has(chunk));
        if open.is_empty() {
            return Ok(!self.ledger.owes_nothing());
        }
        let takers: Vec<usize> = (0..self.workers.len()).filter(|&w| self.workers[w].ready(now).is_some()).collect();
        let is_dealt = self.deal_to(&takers, &open, now)?;
        if is_dealt {
            self.reissued += std::mem::take(&mut self.void);
            return Ok(true);
        }
        if !self.calls.is_empty() || (0..self.workers.len()).any(|w| self.can_work(w)) {
            return Ok(true);
        }
        for (position, worker) in self.workers.iter_mut().enumerate() {
            if let Some(call) = worker.call_again(self.dial) {
                self.calls.spawn(async move { (position, call.await) });
            }
        }
        if self.calls.is_empty() && self.tiles > 0 {
            return Ok(false);
        }
        if self.calls.is_empty() {
            let why = self.workers.iter().filter_map(|w| w.out.clone()).collect();
            return Err(FrameError::NoNodeLeft(why));
        }
        Ok(true)
    }

    /// In equal parts, but for what some of the takers lack: that goes to one who does not. False where none has any of
    /// it.
    fn deal_to(&mut self, takers: &[usize], open: &Unordered, now: Instant) -> Result<bool, LedgerError> {
        let all_have = |chunk| takers.iter().all(|&w| !self.lacks(w, chunk));
        let first_with = |chunk| takers.iter().find(|&&w| !self.lacks(w, chunk));
        let of_all = open.only(all_have);
        let count = takers.len().min(of_all.chunks().count());
        let mut dealt: Vec<_> = match count {
            0 => Vec::new(),
            count => takers.iter().copied().zip(self.in_view.deal(self.shown, &of_all, count)).collect(),
        };
        for worker in takers {
            let mine = open.only(|chunk| !all_have(chunk) && first_with(chunk) == Some(worker));
            if !mine.is_empty() {
                dealt.extend(self.in_view.deal(self.shown, &mine, 1).into_iter().map(|orders| (*worker, orders)));
            }
        }
        let is_dealt = !dealt.is_empty();
        for (worker, orders) in dealt {
            for layers in orders {
                self.send(worker, layers, now)?;
            }
        }
        Ok(is_dealt)
    }
}
