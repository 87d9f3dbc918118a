//! Groups: names and where they lead, whatever lies there. The parser's own lists end at the first object that it
//! cannot read, and leave out links to other files.

use std::sync::Arc;

use brickcast_volume::format::excerpt;
use hdf5_reader::Hdf5File;
use hdf5_reader::btree_v1::collect_btree_v1_leaves_storage;
use hdf5_reader::btree_v2::{BTreeV2Header, BTreeV2Record, collect_btree_v2_records_storage};
use hdf5_reader::fractal_heap::{FractalHeap, FractalHeapDirectBlockCache};
use hdf5_reader::io::Cursor;
use hdf5_reader::local_heap::LocalHeap;
use hdf5_reader::messages::HdfMessage;
use hdf5_reader::messages::link::{LinkTarget, parse};
use hdf5_reader::messages::link_info::LinkInfoMessage;
use hdf5_reader::messages::symbol_table_msg::SymbolTableMessage;
use hdf5_reader::object_header::ObjectHeader;
use hdf5_reader::symbol_table::SymbolTableNode;

use crate::wrong::Wrong;

/// Of one group.
const MOST_LINKS: usize = 100_000;
/// On the way to one object.
const MOST_SOFT_LINKS: usize = 16;

type Parsed<T> = Result<T, hdf5_reader::error::Error>;

/// An object and the path of hard links that leads there.
#[derive(Debug, Clone)]
pub(super) struct At {
    pub(super) path: String,
    pub(super) address: u64,
}

pub(super) fn root(file: &Hdf5File) -> Result<At, Wrong> {
    let address = file.root_group().map_err(|e| Wrong::broken("root group", e))?.address();
    Ok(At { path: String::new(), address })
}

pub(super) fn header(file: &Hdf5File, at: &At) -> Result<Arc<ObjectHeader>, Wrong> {
    file.get_or_parse_header(at.address).map_err(|e| match e.to_string() {
        why if why.contains("unsupported layout class 3") => {
            let why = format!("`{}` is virtual: its voxels lie in other datasets", excerpt(&at.path));
            Wrong::new("layout", why, "copy it with h5repack, or name the dataset that has the voxels")
        }
        why => Wrong::broken("object header", format!("that of `{}/`: {why}", excerpt(&at.path))),
    })
}

/// Names in a group and where they lead; nothing where it is none.
pub(super) fn links(file: &Hdf5File, header: &ObjectHeader) -> Result<Vec<(String, LinkTarget)>, Wrong> {
    let mut links = Vec::new();
    for message in &header.messages {
        let more = match message {
            HdfMessage::Link(link) => Ok(vec![(link.name.clone(), link.target.clone())]),
            HdfMessage::LinkInfo(info) => dense(file, info),
            HdfMessage::SymbolTable(table) => old(file, table),
            _ => continue,
        };
        links.extend(more.map_err(|e| Wrong::broken("links of a group", e))?);
        if links.len() > MOST_LINKS {
            return Err(Wrong::broken("links of a group", format!("more than {MOST_LINKS}")));
        }
    }
    Ok(links)
}

fn dense(file: &Hdf5File, info: &LinkInfoMessage) -> Parsed<Vec<(String, LinkTarget)>> {
    let (storage, superblock) = (file.storage(), file.superblock());
    let (offset, length) = (superblock.offset_size, superblock.length_size);
    if Cursor::is_undefined_offset(info.fractal_heap_address, offset) {
        return Ok(Vec::new());
    }
    let heap = FractalHeap::parse_at_storage(storage, info.fractal_heap_address, offset, length)?;
    let tree = BTreeV2Header::parse_at_storage(storage, info.btree_name_index_address, offset, length)?;
    let records = collect_btree_v2_records_storage(storage, &tree, offset, length, None, &[], None)?;
    let mut cache = FractalHeapDirectBlockCache::default();
    let mut links = Vec::new();
    for record in records.iter().take(MOST_LINKS + 1) {
        if let BTreeV2Record::LinkNameHash { heap_id, .. } = record {
            let bytes = heap.get_object_storage_cached(heap_id, storage, offset, length, &mut cache)?;
            let link = parse(&mut Cursor::new(&bytes), offset, length, bytes.len())?;
            links.push((link.name, link.target));
        }
    }
    Ok(links)
}

fn old(file: &Hdf5File, table: &SymbolTableMessage) -> Parsed<Vec<(String, LinkTarget)>> {
    let (storage, superblock) = (file.storage(), file.superblock());
    let (offset, length) = (superblock.offset_size, superblock.length_size);
    let heap = LocalHeap::parse_at_storage(storage, table.heap_address, offset, length)?;
    let leaves = collect_btree_v1_leaves_storage(storage, table.btree_address, offset, length, None, &[], None)?;
    let mut links = Vec::new();
    for (_, node) in leaves {
        let head = storage.read_range(node, 8)?;
        let count = usize::from(u16::from_le_bytes([head[6], head[7]]));
        let bytes = storage.read_range(node, 8 + count * (2 * usize::from(offset) + 24))?;
        let node = SymbolTableNode::parse(&mut Cursor::new(&bytes), offset, length)?;
        for entry in node.entries {
            let name = heap.get_string_storage(entry.link_name_offset, storage)?;
            let target = match entry.cache_type {
                // Where the link's value lies in the heap.
                2 => {
                    let [a, b, c, d, ..] = entry.scratch;
                    let at = u32::from_le_bytes([a, b, c, d]);
                    LinkTarget::Soft { path: heap.get_string_storage(u64::from(at), storage)? }
                }
                _ => LinkTarget::Hard { address: entry.object_header_address },
            };
            links.push((name, target));
            if links.len() > MOST_LINKS {
                return Ok(links);
            }
        }
    }
    Ok(links)
}

/// What lies at `path`, seen from `from` where it does not begin with a slash; nothing where there is nothing.
pub(super) fn resolve(file: &Hdf5File, from: &At, path: &str) -> Result<Option<At>, Wrong> {
    let mut full = if path.starts_with('/') { path.to_owned() } else { format!("{}/{path}", from.path) };
    'links: for _ in 0..MOST_SOFT_LINKS {
        let mut at = root(file)?;
        let parts: Vec<&str> = full.split('/').filter(|part| !part.is_empty() && *part != ".").collect();
        for (i, part) in parts.iter().enumerate() {
            let header = header(file, &at)?;
            let found = links(file, &header)?.into_iter().find(|(name, _)| name == part);
            match found.map(|(_, target)| target) {
                None => return Ok(None),
                Some(LinkTarget::Hard { address }) => {
                    at = At { path: format!("{}/{part}", at.path), address };
                }
                Some(LinkTarget::Soft { path }) => {
                    let start = if path.starts_with('/') { String::new() } else { at.path };
                    full = [&[start.as_str(), path.as_str()], &parts[i + 1..]].concat().join("/");
                    continue 'links;
                }
                Some(LinkTarget::External { filename, path }) => {
                    let rest = [&[path.as_str()], &parts[i + 1..]].concat().join("/");
                    let [from, filename, rest] = [&at.path, &filename, &rest].map(|text| excerpt(text));
                    let why = format!("`{from}/{part}` leads to `{rest}` in the file `{filename}`");
                    return Err(Wrong::new("external link", why, "name that file: FILE:/path/of/dataset"));
                }
            }
        }
        return Ok(Some(at));
    }
    Err(Wrong::broken("links", format!("`{}` leads through more than {MOST_SOFT_LINKS} soft links", excerpt(path))))
}
