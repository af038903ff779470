//! Reads the messages of a session from its standard input, as MCAP, and serves them to viewers that speak Foxglove's
//! protocol.
//!
//! `host-ui record --live` starts it. Channels and schemas come with the messages and are those of a recording. A slow
//! viewer loses its oldest waiting messages and delays no other.

use foxglove::{ChannelBuilder, PartialMetadata, RawChannel, Schema, WebSocketServer};
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::HashMap;
use std::error::Error;
use std::io::Read;
use std::process::ExitCode;
use std::sync::Arc;

/// Largest record of a session.
const LONGEST_RECORD_BYTES: usize = 64 << 20;
/// Messages that may wait for one viewer: four seconds.
const BACKLOG: usize = 4096;

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("stylet-live: {why}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [option, address] = words.as_slice() else {
        return Err(USAGE.into());
    };
    let (host, port) = address.rsplit_once(':').filter(|_| option == "--listen").ok_or(USAGE)?;
    let server = WebSocketServer::new()
        .name("Stylet")
        .bind(host.trim_matches(['[', ']']), port.parse()?)
        .message_backlog_size(BACKLOG)
        .start_blocking()
        .map_err(|e| format!("cannot listen on {address}: {e}"))?;
    println!(
        "open ws://{host}:{} in Foxglove's app: Open connection, Foxglove WebSocket",
        server.port()
    );
    serve(std::io::stdin().lock())
}

const USAGE: &str = "is started by 'host-ui record --live [ADDRESS:PORT]'";

/// Serves until the input ends.
fn serve(mut input: impl Read) -> Result<(), Box<dyn Error>> {
    let options = LinearReaderOptions::default()
        .with_skip_end_magic(true)
        .with_record_length_limit(LONGEST_RECORD_BYTES);
    let mut reader = LinearReader::new_with_options(options);
    let mut schemas: HashMap<u16, Schema> = HashMap::new();
    let mut channels: HashMap<u16, Arc<RawChannel>> = HashMap::new();
    while let Some(event) = reader.next_event() {
        let (opcode, data) = match event? {
            LinearReadEvent::ReadRequest(need) => {
                let count = input.read(reader.insert(need))?;
                reader.notify_read(count);
                continue;
            }
            LinearReadEvent::Record { data, opcode } => (opcode, data),
        };
        match mcap::parse_record(opcode, data)? {
            Record::Schema { header, data } => {
                let schema = Schema::new(header.name, header.encoding, data.into_owned());
                schemas.insert(header.id, schema);
            }
            Record::Channel(channel) if !channels.contains_key(&channel.id) => {
                let built = ChannelBuilder::new(channel.topic)
                    .message_encoding(channel.message_encoding)
                    .schema(schemas.get(&channel.schema_id).cloned())
                    .build_raw()?;
                channels.insert(channel.id, built);
            }
            Record::Message { header, data } => {
                if let Some(channel) = channels.get(&header.channel_id) {
                    channel.log_with_meta(&data, PartialMetadata::with_log_time(header.log_time));
                }
            }
            _ => {}
        }
    }
    Ok(())
}
