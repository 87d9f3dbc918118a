//! `brickcast render --dry-run`: what each node would hold and render.

use anyhow::anyhow;
use brickcast_volume::lod::Lod;
use comfy_table::Table;

use super::drawer::at_level;
use super::frames::Frames;
use super::plan::RenderPlan;
use crate::cli::failure::Failure;
use crate::cli::input::tell;
use crate::cli::say;
use crate::cli::source::Source;
use crate::cluster::{ClusterError, NodeList};
use crate::embedded::{brick_budget, planned_bytes};
use crate::plan::{Assignment, Shown, StoreFacts};
use crate::session::{Session, SessionError};
use crate::words::bytes;

/// Of a resident voxel; 4 on GPUs without normalised 16-bit textures.
const TEXEL_BYTES: u64 = 2;

/// # Errors
/// As a render up to the plan.
pub(super) async fn run(plan: &RenderPlan, source: Source) -> Result<(), Failure> {
    let nodes = &plan.nodes;
    let mut level = None;
    let (store, names, budgets): (_, Vec<String>, _) = match source {
        Source::Store(store) => {
            if let Lod::Level(asked) = plan.lod {
                let coarsest = store.level_count() - 1;
                let no_level = || Failure::usage(anyhow!("{}", SessionError::NoLevel { level: asked, coarsest }));
                level = Some(StoreFacts::of(store.level(asked).ok_or_else(no_level)?));
            }
            let names = match nodes.are_elsewhere() {
                false => (0..nodes.count).map(|i| format!("local {i}")).collect(),
                true => found(&nodes.elsewhere).await?,
            };
            let budgets = vec![brick_budget(nodes.memory_budget); names.len()];
            (StoreFacts::of(&store), names, budgets)
        }
        Source::Name(_) | Source::Hash(_) => {
            let session = Session::open_through(nodes.dial()?, &nodes.elsewhere, source.choice()).await?;
            tell(plan.source.shown(), &session.store().manifest);
            plan.source.agree(&plan.scenes, session.store().hash)?;
            if let Lod::Level(asked) = plan.lod {
                level = Some(at_level(&session, asked).await?.store().clone());
            }
            let (names, budgets) = session.members().map(|(address, d)| (address.to_owned(), d.memory_budget)).unzip();
            (session.store().clone(), names, budgets)
        }
    };
    let count = names.len();
    let frames = Frames::on(&plan.scenes, &store)?;
    let store = level.unwrap_or(store);
    let scene = frames.first();
    if let Some(outlook) = &frames.outlook {
        tracing::warn!("{}", outlook.in_words());
    }
    let geometry = &store.manifest.geometry;
    let shown = Shown::in_scene(&store, scene);
    let assignment = Assignment::contiguous(&shown, count);
    let view = scene.view_of(geometry)?;
    let orders = assignment.orders(&shown, &view).into_iter().map(|orders| orders.concat()).collect::<Vec<_>>();
    let (tree, planned) = (store.tree(), planned_bytes(&store, scene, TEXEL_BYTES));
    let grid = tree.grid();

    let mut out = Table::new();
    out.set_header(["node", "bricks", "owned voxels", "memory", "budget", "chunks in view", "layers", "tiles"]);
    for (node, layers) in orders.iter().enumerate() {
        let bricks = assignment.bricks_of(&shown, node);
        let owned: u64 = bricks.iter().map(|&b| grid.owned_box(grid.index_of(b)).voxel_count()).sum();
        let memory: u64 = bricks.iter().map(|&b| planned[b.index()]).sum();
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
    say::tell(&format!(
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

/// The addresses that `--nodes` stands for now.
async fn found(words: &[String]) -> Result<Vec<String>, Failure> {
    let (targets, problems) = NodeList::parse(words).map_err(Failure::usage)?.resolve().await;
    problems.iter().for_each(|problem| tracing::warn!("{problem}"));
    match targets.is_empty() {
        true => Err(ClusterError::NoneServes(problems.iter().map(ToString::to_string).collect()).into()),
        false => Ok(targets.into_iter().map(|t| t.address).collect()),
    }
}
