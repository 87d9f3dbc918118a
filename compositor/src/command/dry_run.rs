//! `brickcast render --dry-run`: what each node would hold and render.

use brickcast_volume::View;
use brickcast_volume::brick::GHOST_SAMPLED;
use brickcast_volume::store::Store;
use comfy_table::Table;

use super::{access, bytes, print};
use crate::cli::RenderArgs;
use crate::failure::Failure;
use crate::plan::{Assignment, Shown, StoreFacts};
use crate::session::Session;
use crate::source::Source;

/// # Errors
/// As a render up to the plan.
pub async fn run(args: &RenderArgs, source: Source, memory_budget: u64) -> Result<(), Failure> {
    let count = if args.nodes.nodes.is_empty() { args.nodes.local.unwrap_or(1) } else { args.nodes.nodes.len() };
    let names: Vec<String> = match args.nodes.nodes.is_empty() {
        true => (0..count).map(|i| format!("local {i}")).collect(),
        false => args.nodes.nodes.clone(),
    };
    let (store, budgets) = match source {
        Source::Store(store) => (local_facts(&store), vec![memory_budget; count]),
        Source::Name(_) => {
            let session =
                Session::open_through(access(&args.nodes.access)?, &args.nodes.nodes, source.choice()).await?;
            let budgets = session.descriptions().map(|d| d.memory_budget).collect();
            (session.store().clone(), budgets)
        }
    };
    let choice = args.scene.scene(&store.manifest)?;
    let scene = &choice.scene;
    let geometry = &store.manifest.geometry;
    let shown = Shown::in_scene(&store, scene);
    let assignment = Assignment::contiguous(&shown, count);
    let view = View::new(geometry, &scene.camera, scene.size, scene.step)?;
    let orders = assignment.orders(&shown, &view);
    let tree = store.tree();
    let grid = tree.grid();

    let mut out = Table::new();
    out.set_header(["node", "bricks", "owned voxels", "memory", "budget", "chunks in view", "layers", "tiles"]);
    for (node, layers) in orders.iter().enumerate() {
        let bricks = assignment.bricks_of(&shown, node);
        let boxes = bricks.iter().map(|&b| grid.owned_box(grid.brick_at(b as usize)));
        let (owned, stored) =
            boxes.fold((0, 0), |(o, s), b| (o + b.voxel_count(), s + b.stored(GHOST_SAMPLED).voxel_count()));
        let memory = stored * 2;
        let over = if memory > budgets[node] { " (over)" } else { "" };
        out.add_row([
            names[node].clone(),
            bricks.len().to_string(),
            bytes(owned * 2),
            bytes(memory),
            format!("{}{over}", bytes(budgets[node])),
            layers.iter().map(|l| l.chunks.len()).sum::<usize>().to_string(),
            layers.len().to_string(),
            layers.iter().map(|l| l.tiles.count()).sum::<u32>().to_string(),
        ]);
    }
    let d = geometry.dims();
    print(&format!(
        "{} x {} x {} voxels in {} bricks of {}^3; {} of them are shown by the transfer function\n\
         {} chunks of {}^3 bricks\n{out}\n",
        d.x,
        d.y,
        d.z,
        grid.brick_count(),
        grid.brick_size(),
        shown.brick_count(),
        tree.chunk_count(),
        tree.chunk_bricks(),
    ))
}

fn local_facts(store: &Store) -> StoreFacts {
    StoreFacts {
        hash: store.hash(),
        manifest: store.manifest().clone(),
        ranges: store.brick_ranges().clone(),
        facts: store.brick_facts().map(<[_]>::to_vec),
    }
}
