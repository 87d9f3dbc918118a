//! Decoded chunks of an array.

use std::sync::Arc;

use brickcast_volume::store::Objects;
use bytes::Bytes;

use crate::array::Array;
use crate::codec::{most_encoded, undone};
use crate::error::{ChunkFault, OmeZarrError};
use crate::json::read_range;
use crate::shards::{InnerError, OpenShards};

#[derive(Debug)]
pub(crate) struct Chunks {
    pub(crate) objects: Arc<dyn Objects>,
    pub(crate) array: Array,
    shards: OpenShards,
}

impl Chunks {
    pub(crate) fn new(objects: Arc<dyn Objects>, array: Array) -> Self {
        Self { objects, array, shards: OpenShards::default() }
    }

    /// The chunk that is the `at`th along each axis, in the byte order that it was written in; nothing where it is not
    /// there. From any number of threads.
    pub(crate) fn load(&self, at: &[u64]) -> Result<Option<Bytes>, OmeZarrError> {
        let (array, decoded) = (&self.array, self.array.chunk_bytes());
        let most = most_encoded(decoded) as u64;
        let (key, encoded) = match &array.sharding {
            None => {
                let key = array.key(at);
                let object = match self.objects.open(&key) {
                    Ok(object) => object,
                    Err(error) if error.is_missing() => return Ok(None),
                    Err(error) => return Err(error.into()),
                };
                let got = object.size()?;
                if got > most {
                    return Err(OmeZarrError::Chunk { key, reason: ChunkFault::Encoded { got, decoded, most } });
                }
                (key, read_range(object.as_ref(), 0..got)?)
            }
            Some(sharding) => {
                let shard_at: Vec<u64> = at.iter().zip(&sharding.inner).map(|(at, inner)| at / inner).collect();
                let key = array.key(&shard_at);
                let Some(shard) = self.shards.get(self.objects.as_ref(), sharding, &key)? else { return Ok(None) };
                let place = at.iter().zip(&sharding.inner).fold(0, |place, (at, inner)| place * inner + at % inner);
                match shard.chunk(place as usize, decoded, most) {
                    Ok(Some(encoded)) => (key, encoded),
                    Ok(None) => return Ok(None),
                    Err(InnerError::Read(error)) => return Err(error),
                    Err(InnerError::Fault(reason)) => {
                        return Err(OmeZarrError::Chunk { key: format!("{place} of {key}"), reason });
                    }
                }
            }
        };
        let chunk = undone(&array.codecs, encoded, decoded).map_err(|reason| {
            let inner = array.sharding.as_ref().map_or(String::new(), |_| format!(" (inner chunk {at:?})"));
            OmeZarrError::Chunk { key: key + &inner, reason }
        })?;
        Ok(Some(chunk))
    }
}
