//! Messages between the two sides: a head and a payload; one encoder, one decoder that trusts no length.

mod between;
mod control;
mod packed;
mod thin;

pub use control::{Hello, Present, Ticks, Who};
pub use packed::{pack, unpack};
pub use thin::{Displacements, MAX_THIN_BYTES, Rest, Thin, decode_snapshot};

use bytemuck::{Pod, Zeroable};
use num_enum::TryFromPrimitive;
use stylet_shm_schema::check::Invalid;
use stylet_shm_schema::{HapticState, SCHEMA_VERSION, SceneHeader, UploadHeader};

/// First word of every message: rises with the form of messages and with the schema.
const MAGIC: u32 = u32::from_le_bytes(*b"st6\0") ^ (SCHEMA_VERSION << 24);

/// What a message holds, by stable number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, TryFromPrimitive)]
#[repr(u32)]
pub enum Kind {
    /// A `Session`.
    Session = 1,
    /// A `HapticState`.
    State = 2,
    /// `TickRecord`s of one batch, packed, as they are sent again.
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
    /// Who is connected and who operates, as JSON.
    Who = 11,
    /// Answer to a [`Kind::Hello`]: its `sent_ns`.
    Echo = 12,
    /// `Ticks` whose records are not kept any more.
    Missing = 13,
    /// A `HapticState` and the newest batch of `TickRecord`s, packed, in one message: each of them costs either side as much as its bytes do.
    Newest = 14,
    /// Why the server takes nothing of a member, in words.
    Refused = 15,
    /// A member is alive; `number` is its process.
    Hello = 20,
    /// A `Command` of a member's host.
    Command = 21,
    /// An `UploadHeader`, the number of the first cell, and the cells from there on: a part of a volume.
    Upload = 22,
    /// `Ticks` whose records are to be sent again.
    Again = 23,
    /// What a member asks of the lease: a word.
    Lease = 24,
    /// A member has had the snapshot of that number; [`OF_USE`] where it could take it.
    Seen = 25,
}

/// The payload of [`Kind::Seen`] for a snapshot that a member could take; another says that it could not.
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

/// What stands before the payload of a message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stamp {
    /// Which run of the sender.
    pub run: u64,
    /// Rises by one within a kind of message that has numbers.
    pub number: u64,
    /// The sender's clock.
    pub sent_ns: u64,
    /// From a member: `sent_ns` of the newest message that it had from the server. It shows how late the message is, by the
    /// server's own clock.
    pub heard_ns: u64,
}

/// A message whose head is valid; its payload is still to be read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Message<'a> {
    /// What the payload holds.
    pub kind: Kind,
    /// Run, number and times.
    pub stamp: Stamp,
    /// The payload.
    pub body: &'a [u8],
}

/// The bytes of a message whose payload stands in parts.
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

/// The message in `bytes`.
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

/// A payload of one value.
pub fn one<T: Pod>(body: &[u8]) -> Result<T, Invalid> {
    match body.len() == size_of::<T>() {
        true => Ok(bytemuck::pod_read_unaligned(body)),
        false => Err(Invalid("length of a payload")),
    }
}

/// A payload of values of one type, `most` at most.
pub fn many<T: Pod>(body: &[u8], most: usize) -> Result<Vec<T>, Invalid> {
    if !body.len().is_multiple_of(size_of::<T>()) || body.len() / size_of::<T>() > most {
        return Err(Invalid("length of a payload"));
    }
    Ok(body
        .chunks_exact(size_of::<T>())
        .map(bytemuck::pod_read_unaligned)
        .collect())
}

/// The payloads of a state and of records in one of both.
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

/// Words of a scene at most.
pub const MAX_SCENE_WORDS: usize = 16 << 20;
/// Cells of an upload at most.
pub const MAX_UPLOAD_CELLS: usize = 64 << 20;

/// A scene with its words, checked.
pub fn scene(body: &[u8]) -> Result<(SceneHeader, Vec<u32>), Invalid> {
    let (header, words) = headed::<SceneHeader, u32>(body, MAX_SCENE_WORDS)?;
    stylet_shm_schema::check::scene(&header, &words)?;
    Ok((header, words))
}

/// Cells that a part of a volume has, but for the last.
pub const PART_BYTES: usize = 32 << 10;
/// A message with a part is no longer.
pub const MAX_PART_BYTES: usize = PART_BYTES + size_of::<Head>() + size_of::<UploadHeader>() + size_of::<u64>();

/// Cells of a volume; more than any where they cannot be counted.
pub fn cells(header: &UploadHeader) -> usize {
    let count = header.dims.iter().try_fold(1_usize, |n, &d| n.checked_mul(d as usize));
    count.unwrap_or(usize::MAX)
}

/// A part of a volume: which volume, the number of its first cell, and its cells. The core checks what they mean.
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

/// Words of a refusal, without what a terminal would take for an order.
pub fn words(body: &[u8]) -> Result<String, Invalid> {
    const MOST: usize = 300;
    match std::str::from_utf8(body) {
        Ok(words) if body.len() <= MOST => Ok(words.replace(char::is_control, " ")),
        _ => Err(Invalid("words")),
    }
}

#[cfg(test)]
mod tests;
