//! Cutting chunks: strips of screen tiles go from the most loaded node to other holders until no node waits for it.

use brickcast_volume::{ChunkId, PerChunk};

use super::predict::Predictor;
use super::settings::Settings;

/// One owner's strips of a chunk, and what they will cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Own {
    pub(super) node: usize,
    pub(super) strips: [u32; 2],
    pub(super) cost: f64,
}

/// Loads of one frame as predicted.
#[derive(Debug, Clone, Default)]
pub(super) struct Plan {
    /// Nodes that are there, ascending.
    pub(super) present: Vec<usize>,
    /// Per node: load per unit of cost, load.
    pub(super) kappa: Vec<f64>,
    pub(super) load: Vec<f64>,
    /// The lower bound T of the largest load.
    pub(super) bound: f64,
    /// Who renders which strips, in their order. The first to have had them all is the primary; it keeps one at least.
    pub(super) owners: PerChunk<Vec<Own>>,
    primary: PerChunk<usize>,
    /// Per node: chunks of which it owns strips.
    chunks: Vec<Vec<ChunkId>>,
}

/// Strips of a chunk for another node.
struct Cut {
    chunk: ChunkId,
    /// Place of the giver among the owners.
    place: usize,
    to: usize,
    strips: u32,
    cost: f64,
    /// From the giver's last strips, else from its first.
    high: bool,
    joins: bool,
    /// The larger load of both afterwards, T at least.
    worst: f64,
}

impl Plan {
    /// Nobody has anything of `count` chunks; together they will cost `total`.
    pub(super) fn new(kappa: Vec<f64>, present: Vec<usize>, total: f64, count: usize) -> Self {
        let speed: f64 = present.iter().map(|&n| 1.0 / kappa[n]).sum();
        Self {
            load: vec![0.0; kappa.len()],
            chunks: vec![Vec::new(); kappa.len()],
            bound: total / speed,
            present,
            kappa,
            owners: PerChunk::filled(Vec::new(), count),
            primary: PerChunk::filled(0, count),
        }
    }

    /// Gives all strips of a chunk to its primary.
    pub(super) fn give(&mut self, chunk: ChunkId, own: Own) {
        self.load[own.node] += self.kappa[own.node] * own.cost;
        self.chunks[own.node].push(chunk);
        self.primary[chunk] = own.node;
        self.owners[chunk] = vec![own];
    }

    /// Cuts until the most loaded node is even with the others, or cannot be helped.
    pub(super) fn spread(&mut self, settings: &Settings, predictor: &Predictor, holders: &PerChunk<Vec<usize>>) {
        let mut stuck = vec![false; self.load.len()];
        let mut floor = settings.even * self.bound;
        for _ in 0..8 * self.present.len() + 64 {
            let open = self.present.iter().copied().filter(|&n| !stuck[n]);
            let Some(most) = open.reduce(|x, y| if self.load[y] > self.load[x] { y } else { x }) else { return };
            if self.load[most] <= floor {
                return;
            }
            let mine = std::mem::take(&mut self.chunks[most]);
            let cut = self.best_cut(settings, predictor, holders, most, &mine);
            self.chunks[most] = mine;
            match cut {
                Some(cut) => {
                    self.apply(&cut, predictor);
                    stuck.fill(false);
                    floor = settings.even * self.bound;
                }
                None => {
                    // Those that could take from it may be nearly as loaded: they come first. Others need no help while
                    // it waits.
                    stuck[most] = true;
                    floor = floor.max(0.9 * self.load[most]);
                }
            }
        }
    }

    /// Makes the best cut from `from` among `chunks`; false where none gains enough.
    pub(super) fn cut(
        &mut self,
        settings: &Settings,
        predictor: &Predictor,
        holders: &PerChunk<Vec<usize>>,
        from: usize,
        chunks: &[ChunkId],
    ) -> bool {
        let cut = self.best_cut(settings, predictor, holders, from, chunks);
        cut.inspect(|cut| self.apply(cut, predictor)).is_some()
    }

    fn best_cut(
        &self,
        settings: &Settings,
        predictor: &Predictor,
        holders: &PerChunk<Vec<usize>>,
        from: usize,
        chunks: &[ChunkId],
    ) -> Option<Cut> {
        let enough = self.load[from] - settings.least_gain * self.bound;
        let mut best: Option<Cut> = None;
        for &chunk in chunks {
            let owners = &self.owners[chunk];
            let Some(place) = owners.iter().position(|own| own.node == from) else { continue };
            let whole = predictor.cost[chunk];
            let many = whole * self.kappa[self.primary[chunk]] > self.bound;
            let more = many || owners.len() < settings.most_owners;
            for &to in holders[chunk].iter().filter(|to| self.load[**to] < enough) {
                let (high, joins) = match owners.iter().position(|own| own.node == to) {
                    None if more => (true, true),
                    Some(at) if at == place + 1 => (true, false),
                    Some(at) if at + 1 == place => (false, false),
                    _ => continue,
                };
                let Some(cut) = self.amount(predictor, chunk, place, to, (high, joins)) else { continue };
                let rank = |c: &Cut| (c.worst, c.joins, self.load[c.to]);
                if cut.worst <= enough && best.as_ref().is_none_or(|b| rank(&cut) < rank(b)) {
                    best = Some(cut);
                }
            }
        }
        best
    }

    /// How many strips to give so that the larger load of both becomes least; the fewest that do.
    fn amount(
        &self,
        predictor: &Predictor,
        chunk: ChunkId,
        place: usize,
        to: usize,
        (high, joins): (bool, bool),
    ) -> Option<Cut> {
        let own = self.owners[chunk][place];
        let [lo, hi] = own.strips;
        // The primary keeps one at least.
        let most = hi - lo - u32::from(self.primary[chunk] == own.node);
        let mut best: Option<Cut> = None;
        let mut cost = 0.0;
        for strips in 1..=most {
            let next = if high { hi - strips } else { lo + strips - 1 };
            cost += predictor.cost_of(chunk, [next, next + 1]);
            let (giver, taker) =
                (self.load[own.node] - self.kappa[own.node] * cost, self.load[to] + self.kappa[to] * cost);
            let worst = giver.max(taker).max(self.bound);
            if best.as_ref().is_some_and(|b| b.worst <= worst) {
                break;
            }
            best = Some(Cut { chunk, place, to, strips, cost, high, joins, worst });
        }
        best
    }

    fn apply(&mut self, cut: &Cut, predictor: &Predictor) {
        let owners = &mut self.owners[cut.chunk];
        let from = owners[cut.place].node;
        let [lo, hi] = owners[cut.place].strips;
        let (keeps, gives) = match cut.high {
            true => ([lo, hi - cut.strips], [hi - cut.strips, hi]),
            false => ([lo + cut.strips, hi], [lo, lo + cut.strips]),
        };
        let mut taker = if cut.high { cut.place + 1 } else { cut.place.saturating_sub(1) };
        if cut.joins {
            owners.insert(taker, Own { node: cut.to, strips: gives, cost: 0.0 });
            self.chunks[cut.to].push(cut.chunk);
        } else {
            let [l, h] = owners[taker].strips;
            owners[taker].strips = [l.min(gives[0]), h.max(gives[1])];
        }
        owners[cut.place].strips = keeps;
        if keeps[0] == keeps[1] {
            owners.remove(cut.place);
            taker -= usize::from(taker > cut.place);
            self.chunks[from].retain(|c| *c != cut.chunk);
        } else {
            owners[cut.place].cost = predictor.cost_of(cut.chunk, keeps);
        }
        owners[taker].cost = predictor.cost_of(cut.chunk, owners[taker].strips);
        self.load[from] -= self.kappa[from] * cut.cost;
        self.load[cut.to] += self.kappa[cut.to] * cut.cost;
    }
}
