//! Reads the messages of an MCAP file, whatever its bytes.

use crate::error::ShowError;
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::BTreeMap;

/// Longer than any record or chunk of ours, packed or not: a damaged length must not request more memory than there is.
const LONGEST_RECORD_BYTES: usize = 64 << 20;

/// Passes on topic, time and bytes of each message. Returns why reading ended before the end of the file, if it did.
///
/// # Errors
/// If the file is not MCAP, with the reason.
pub fn each(
    bytes: &[u8],
    mut take: impl FnMut(&str, u64, &[u8]) -> Result<(), String>,
) -> Result<Option<String>, ShowError> {
    if !bytes.starts_with(mcap::MAGIC) {
        return Err(ShowError::NotMcap);
    }
    let options = LinearReaderOptions::default()
        .with_skip_end_magic(true)
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(LONGEST_RECORD_BYTES);
    let (mut reader, mut left) = (LinearReader::new_with_options(options), bytes);
    let mut topics: BTreeMap<u16, String> = BTreeMap::new();
    while let Some(event) = reader.next_event() {
        let (opcode, data) = match event {
            Err(why) => return Ok(Some(why.to_string())),
            Ok(LinearReadEvent::ReadRequest(need)) => {
                let (now, later) = left.split_at(need.min(left.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                left = later;
                continue;
            }
            Ok(LinearReadEvent::Record { data, opcode }) => (opcode, data),
        };
        match mcap::parse_record(opcode, data) {
            Ok(Record::Channel(channel)) => drop(topics.insert(channel.id, channel.topic)),
            Ok(Record::Message { header, data }) => {
                let topic = topics.get(&header.channel_id).map_or("", String::as_str);
                if let Err(why) = take(topic, header.log_time, &data) {
                    return Ok(Some(why));
                }
            }
            Ok(_) => {}
            Err(why) => return Ok(Some(why.to_string())),
        }
    }
    Ok(None)
}
