//! Messages between the two sides: a head and a payload; one encoder, and one decoder that trusts no length.

mod between;
mod control;
mod packed;
mod thin;

pub use control::{Hello, Ticks, class_bytes, class_of, class_words};
pub use packed::{pack, unpack};
pub use thin::{Displacements, MAX_THIN_BYTES, Rest, Thin, decode_snapshot};

use bytemuck::{Pod, Zeroable};
use num_enum::TryFromPrimitive;
use stylet_shm_schema::check::Invalid;
use stylet_shm_schema::{HapticState, SCHEMA_VERSION, SceneHeader, UploadHeader};

/// First word of every message: changes with the format of messages and with the schema.
const MAGIC: u32 = u32::from_le_bytes(*b"st7\0") ^ (SCHEMA_VERSION << 24);

/// Content of a message, by stable number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, TryFromPrimitive)]
#[repr(u32)]
pub enum Kind {
    /// A `Session`.
    Session = 1,
    /// A `HapticState`.
    State = 2,
    /// `TickRecord`s of one batch, packed, when resent.
    Records = 3,
    /// A thinned snapshot.
    Snapshot = 4,
    /// A `SceneHeader` and its words.
    Scene = 5,
    /// An `Event`.
    Event = 6,
    /// `ParametersInForce`.
    Parameters = 7,
    /// A `PlanInForce`.
    Plan = 8,
    /// A `Reply`.
    Reply = 9,
    /// A `Rehearsal`.
    Rehearsal = 10,
    /// A `Class` without the unused places of its list.
    Class = 11,
    /// Answer to a [`Kind::Hello`]: its `sent_ns`.
    Echo = 12,
    /// `Ticks` whose records are not kept any more.
    Missing = 13,
    /// A `HapticState` and the newest batch of `TickRecord`s, packed, in one message: the cost of a message at either
    /// side equals that of its bytes.
    Newest = 14,
    /// Why the server refuses a member, as text.
    Refused = 15,
    /// A member's sign of life; `number` is its process.
    Hello = 20,
    /// A `Command` of a member's host.
    Command = 21,
    /// Part of a volume: an `UploadHeader`, the number of the first cell, and the cells from there on.
    Upload = 22,
    /// `Ticks` whose records are to be resent.
    Again = 23,
    /// A member's order for the lease: a word.
    Lease = 24,
    /// Acknowledges the snapshot of that number; [`OF_USE`] if it was usable.
    Seen = 25,
}

/// Payload of [`Kind::Seen`] for a usable snapshot; any other means that it was not.
pub const OF_USE: &[u8] = &[1];

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Head {
    magic: u32,
    kind: u32,
    run: u64,
    number: u64,
    sent_ns: u64,
    heard_ns: u64,
}

/// Header of a message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stamp {
    /// Run of the sender.
    pub run: u64,
    /// Increases by one within a kind of message that has numbers.
    pub number: u64,
    /// The sender's clock.
    pub sent_ns: u64,
    /// From a member: `sent_ns` of the newest message received from the server. It shows the age of the message by the
    /// server's own clock.
    pub heard_ns: u64,
}

/// A message with a valid head; its payload is still to be read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Message<'a> {
    /// Kind of the payload.
    pub kind: Kind,
    /// Run, number and times.
    pub stamp: Stamp,
    /// The payload.
    pub body: &'a [u8],
}

/// Encodes a message whose payload is in parts.
pub fn encode(kind: Kind, stamp: Stamp, parts: &[&[u8]]) -> Vec<u8> {
    let head = Head {
        magic: MAGIC,
        kind: kind as u32,
        run: stamp.run,
        number: stamp.number,
        sent_ns: stamp.sent_ns,
        heard_ns: stamp.heard_ns,
    };
    let length = parts.iter().map(|part| part.len()).sum::<usize>();
    let mut bytes = Vec::with_capacity(size_of::<Head>() + length);
    bytes.extend_from_slice(bytemuck::bytes_of(&head));
    parts.iter().for_each(|part| bytes.extend_from_slice(part));
    bytes
}

/// Decodes the message in `bytes`.
pub fn decode(bytes: &[u8]) -> Result<Message<'_>, Invalid> {
    let (head, body) = bytes
        .split_at_checked(size_of::<Head>())
        .ok_or(Invalid("message without a head"))?;
    let head: Head = bytemuck::pod_read_unaligned(head);
    if head.magic != MAGIC {
        return Err(Invalid("message of another version"));
    }
    let kind = Kind::try_from(head.kind).map_err(|_| Invalid("kind of message"))?;
    let stamp = Stamp {
        run: head.run,
        number: head.number,
        sent_ns: head.sent_ns,
        heard_ns: head.heard_ns,
    };
    Ok(Message { kind, stamp, body })
}

/// Decodes a payload of one value.
pub fn one<T: Pod>(body: &[u8]) -> Result<T, Invalid> {
    match body.len() == size_of::<T>() {
        true => Ok(bytemuck::pod_read_unaligned(body)),
        false => Err(Invalid("length of a payload")),
    }
}

/// Decodes a payload of at most `most` values of one type.
pub fn many<T: Pod>(body: &[u8], most: usize) -> Result<Vec<T>, Invalid> {
    if !body.len().is_multiple_of(size_of::<T>()) || body.len() / size_of::<T>() > most {
        return Err(Invalid("length of a payload"));
    }
    Ok(body
        .chunks_exact(size_of::<T>())
        .map(bytemuck::pod_read_unaligned)
        .collect())
}

/// Splits a combined payload into state and records.
pub fn state_and_records(body: &[u8]) -> Result<(&[u8], &[u8]), Invalid> {
    body.split_at_checked(size_of::<HapticState>())
        .ok_or(Invalid("records without a state"))
}

fn headed<H: Pod, T: Pod>(body: &[u8], most: usize) -> Result<(H, Vec<T>), Invalid> {
    let (header, rest) = body
        .split_at_checked(size_of::<H>())
        .ok_or(Invalid("payload without its header"))?;
    Ok((bytemuck::pod_read_unaligned(header), many(rest, most)?))
}

/// Most words of a scene.
pub const MAX_SCENE_WORDS: usize = 16 << 20;
/// Most cells of an upload.
pub const MAX_UPLOAD_CELLS: usize = 64 << 20;

/// Decodes and validates a scene with its words.
pub fn scene(body: &[u8]) -> Result<(SceneHeader, Vec<u32>), Invalid> {
    let (header, words) = headed::<SceneHeader, u32>(body, MAX_SCENE_WORDS)?;
    stylet_shm_schema::check::scene(&header, &words)?;
    Ok((header, words))
}

/// Cells in a part of a volume, except the last.
pub const PART_BYTES: usize = 32 << 10;
/// Length limit of a message with a part.
pub const MAX_PART_BYTES: usize = PART_BYTES + size_of::<Head>() + size_of::<UploadHeader>() + size_of::<u64>();

/// Number of cells of a volume; the maximum if it overflows.
pub fn cells(header: &UploadHeader) -> usize {
    let count = header.dims.iter().try_fold(1_usize, |n, &d| n.checked_mul(d as usize));
    count.unwrap_or(usize::MAX)
}

/// Decodes a part of a volume: the volume, the number of its first cell, and its cells. The core validates their
/// meaning.
pub fn part(body: &[u8]) -> Result<(UploadHeader, usize, Vec<u8>), Invalid> {
    let (header, rest) = body
        .split_at_checked(size_of::<UploadHeader>())
        .ok_or(Invalid("payload without its header"))?;
    let header: UploadHeader = bytemuck::pod_read_unaligned(header);
    let (at, part) = headed::<u64, u8>(rest, PART_BYTES)?;
    let end = at.checked_add(part.len() as u64);
    let total = cells(&header);
    match total <= MAX_UPLOAD_CELLS && !part.is_empty() && end.is_some_and(|end| end <= total as u64) {
        true => Ok((header, at as usize, part)),
        false => Err(Invalid("cells of a volume")),
    }
}

/// Decodes the text of a refusal, without control sequences.
pub fn words(body: &[u8]) -> Result<String, Invalid> {
    const MOST: usize = 300;
    match std::str::from_utf8(body) {
        Ok(words) if body.len() <= MOST => Ok(words.replace(char::is_control, " ")),
        _ => Err(Invalid("words")),
    }
}

#[cfg(test)]
mod tests;
