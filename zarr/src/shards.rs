//! Shards: files of inner chunks, with an index of where each lies.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use brickcast_volume::json_fields::Fields;
use brickcast_volume::store::{Object, Objects};
use bytes::Bytes;

use crate::error::{ChunkFault, OmeZarrError};
use crate::json::{Json, read_range};

/// Start and length of an inner chunk, little endian.
const ENTRY: u64 = 16;
const CHECKSUM: u64 = 4;
/// No index is longer, bytes.
const MOST_INDEX: u64 = 32 << 20;
/// Shards are kept open, with their indexes, up to so many of either.
const KEPT_SHARDS: usize = 64;
const KEPT_BYTES: usize = 64 << 20;

#[derive(Debug, Clone)]
pub(crate) struct Sharding {
    /// Inner chunks of a shard along each axis.
    pub(crate) inner: Vec<u64>,
    is_at_end: bool,
    has_checksum: bool,
}

impl Sharding {
    /// As a configuration says; still without its shape.
    pub(crate) fn of(json: &Json, configuration: &Fields<'_>) -> Result<Self, OmeZarrError> {
        let wrong = |error| json.wrong(error);
        let is_at_end = match configuration.get_optional::<&str>("index_location").map_err(wrong)? {
            None | Some("end") => true,
            Some("start") => false,
            Some(_) => return Err(wrong(configuration.refused("index_location", "`start` and `end` are read"))),
        };
        let codecs = configuration.objects("index_codecs").map_err(wrong)?;
        let names = codecs.iter().map(|codec| codec.get::<&str>("name")).collect::<Result<Vec<_>, _>>();
        let has_checksum = match names.map_err(wrong)?.as_slice() {
            ["bytes"] => false,
            ["bytes", "crc32c"] => true,
            _ => return Err(wrong(configuration.refused("index_codecs", "`bytes`, then `crc32c` or none, is read"))),
        };
        let order = codecs[0].object_optional("configuration").map_err(wrong)?;
        match order.map_or(Ok(None), |order| order.get_optional::<&str>("endian")).map_err(wrong)? {
            None | Some("little") => Ok(Self { inner: Vec::new(), is_at_end, has_checksum }),
            Some(_) => Err(wrong(configuration.refused("index_codecs", "an index in `little` byte order is read"))),
        }
    }

    /// Of shards of a shape that is a multiple of that of their inner chunks.
    pub(crate) fn cut(self, json: &Json, shard: &[u64], chunk: &[u64]) -> Result<Self, OmeZarrError> {
        let is_multiple = |(shard, chunk): (&u64, &u64)| *chunk > 0 && shard.is_multiple_of(*chunk);
        if chunk.len() != shard.len() || !shard.iter().zip(chunk).all(is_multiple) {
            return Err(json.problem(format!("shards of {shard:?} are no multiple of their inner chunks, {chunk:?}")));
        }
        let inner: Vec<u64> = shard.iter().zip(chunk).map(|(shard, chunk)| shard / chunk).collect();
        let index = inner.iter().try_fold(ENTRY, |bytes, n| bytes.checked_mul(*n));
        match index.is_some_and(|bytes| bytes <= MOST_INDEX) {
            true => Ok(Self { inner, ..self }),
            false => Err(json.problem(format!(
                "shards of {inner:?} inner chunks each: an index of more than {MOST_INDEX} bytes is not read"
            ))),
        }
    }

    fn index_bytes(&self) -> u64 {
        let checksum = if self.has_checksum { CHECKSUM } else { 0 };
        self.inner.iter().product::<u64>() * ENTRY + checksum
    }

    /// Opens a shard; nothing where it is not there.
    fn open(&self, objects: &dyn Objects, key: &str) -> Result<Option<Shard>, OmeZarrError> {
        let object = match objects.open(key) {
            Ok(object) => object,
            Err(error) if error.is_missing() => return Ok(None),
            Err(error) => return Err(error.into()),
        };
        let fault = |reason| OmeZarrError::Chunk { key: key.to_owned(), reason };
        let (bytes, index) = (object.size()?, self.index_bytes());
        if bytes < index {
            return Err(fault(ChunkFault::ShardLength { got: bytes, index }));
        }
        let start = if self.is_at_end { bytes - index } else { 0 };
        let mut index = read_range(object.as_ref(), start..start + index)?;
        if self.has_checksum
            && let Some((body, written)) = index.split_last_chunk::<4>()
        {
            let (got, want) = (crc32c::crc32c(body), u32::from_le_bytes(*written));
            if got != want {
                return Err(fault(ChunkFault::Checksum { got, want }));
            }
            index.truncate(index.len() - CHECKSUM as usize);
        }
        Ok(Some(Shard { object, bytes, index }))
    }
}

/// A shard that stays open.
#[derive(Debug)]
pub(crate) struct Shard {
    object: Arc<dyn Object>,
    bytes: u64,
    index: Bytes,
}

impl Shard {
    /// The encoded bytes of an inner chunk, which are no more than `most`; nothing where it is not there.
    pub(crate) fn chunk(&self, place: usize, decoded: usize, most: u64) -> Result<Option<Bytes>, InnerError> {
        let numbers = self.index.as_chunks::<8>().0;
        let number = |at: usize| numbers.get(at).map_or(u64::MAX, |bytes| u64::from_le_bytes(*bytes));
        let (start, length) = (number(2 * place), number(2 * place + 1));
        if (start, length) == (u64::MAX, u64::MAX) {
            return Ok(None);
        }
        let end = u128::from(start) + u128::from(length);
        if end > u128::from(self.bytes) {
            return Err(InnerError::Fault(ChunkFault::Beyond { start, end, bytes: self.bytes }));
        }
        if length > most {
            return Err(InnerError::Fault(ChunkFault::Encoded { got: length, decoded, most }));
        }
        let read = read_range(self.object.as_ref(), start..start + length);
        read.map(Some).map_err(|error| InnerError::Read(error.into()))
    }
}

/// Why an inner chunk did not come.
pub(crate) enum InnerError {
    Read(OmeZarrError),
    Fault(ChunkFault),
}

/// Shards that were opened last, by their keys.
#[derive(Debug, Default)]
pub(crate) struct OpenShards {
    kept: Mutex<VecDeque<(String, Option<Arc<Shard>>)>>,
}

impl OpenShards {
    pub(crate) fn get(
        &self,
        objects: &dyn Objects,
        sharding: &Sharding,
        key: &str,
    ) -> Result<Option<Arc<Shard>>, OmeZarrError> {
        let kept = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, shard)) = kept().iter().find(|(kept, _)| kept == key) {
            return Ok(shard.clone());
        }
        // Two threads may open one shard: the second is dropped.
        let shard = sharding.open(objects, key)?.map(Arc::new);
        let most = (KEPT_BYTES / (sharding.index_bytes() as usize).max(1)).clamp(1, KEPT_SHARDS);
        let mut kept = kept();
        kept.truncate(most - 1);
        kept.push_front((key.to_owned(), shard.clone()));
        Ok(shard)
    }
}
