//! Lossless packing of a batch of records: the first unchanged, then the difference of each from the one before, bytes
//! grouped by their offset, and LZ4 over all of it. A batch at rest fits into one packet instead of six, and each
//! packet costs both ends time.

use bytemuck::Zeroable;
use lz4_flex::block;
use stylet_shm_schema::MAX_BATCH;
use stylet_shm_schema::TickRecord;
use stylet_shm_schema::check::Invalid;

const RECORD: usize = size_of::<TickRecord>();

/// Index of a byte of record `n` of `count`.
fn index(count: usize, n: usize, place: usize) -> usize {
    match n {
        0 => place,
        _ => RECORD + place * (count - 1) + n - 1,
    }
}

/// Packs the first [`MAX_BATCH`] records, preceded by their number.
pub fn pack(records: &[TickRecord]) -> Vec<u8> {
    let records = &records[..records.len().min(MAX_BATCH)];
    let count = records.len();
    let mut beside = vec![0; count * RECORD];
    let mut before = [0; RECORD];
    for (n, record) in records.iter().enumerate() {
        let bytes = bytemuck::bytes_of(record);
        for (place, (byte, before)) in bytes.iter().zip(&mut before).enumerate() {
            beside[index(count, n, place)] = byte ^ *before;
            *before = *byte;
        }
    }
    let mut packed = (count as u32).to_le_bytes().to_vec();
    packed.resize(4 + block::get_maximum_output_size(beside.len()), 0);
    // There is room for any input.
    let length = block::compress_into(&beside, &mut packed[4..]).unwrap_or(0);
    packed.truncate(4 + length);
    packed
}

/// Unpacks the records of [`pack`], bit by bit; `check` validates them.
pub fn unpack(packed: &[u8]) -> Result<Vec<TickRecord>, Invalid> {
    let (count, packed) = packed
        .split_first_chunk()
        .ok_or(Invalid("records without their number"))?;
    let count = u32::from_le_bytes(*count) as usize;
    if count > MAX_BATCH {
        return Err(Invalid("number of records"));
    }
    let mut beside = vec![0; count * RECORD];
    let length = block::decompress_into(packed, &mut beside).map_err(|_| Invalid("packed records"))?;
    if length != beside.len() {
        return Err(Invalid("length of packed records"));
    }
    let mut records = vec![TickRecord::zeroed(); count];
    let mut before = [0; RECORD];
    for (n, record) in records.iter_mut().enumerate() {
        for (place, (byte, before)) in bytemuck::bytes_of_mut(record).iter_mut().zip(&mut before).enumerate() {
            *before ^= beside[index(count, n, place)];
            *byte = *before;
        }
    }
    Ok(records)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn batch(count: usize, mut value: impl FnMut(usize, usize) -> u8) -> Vec<TickRecord> {
        let mut records = vec![TickRecord::zeroed(); count];
        for (n, record) in records.iter_mut().enumerate() {
            for (place, byte) in bytemuck::bytes_of_mut(record).iter_mut().enumerate() {
                *byte = value(n, place);
            }
        }
        records
    }

    #[test]
    fn records_come_out_as_they_went_in() {
        let mut generator = stylet_random::Random(1);
        let mut random = |_: usize, _: usize| generator.draw() as u8;
        for count in [0, 1, 20, MAX_BATCH] {
            for records in [batch(count, |_, place| place as u8), batch(count, &mut random)] {
                let again = unpack(&pack(&records)).expect("packed");
                assert_eq!(
                    bytemuck::cast_slice::<_, u8>(&records),
                    bytemuck::cast_slice::<_, u8>(&again)
                );
            }
        }
    }

    #[test]
    fn records_at_rest_fit_into_a_packet() {
        let records = batch(20, |n, place| if place < 8 { (n >> place) as u8 } else { place as u8 });
        let length = pack(&records).len();
        assert!(length < 600, "{length} of {}", 20 * RECORD);
    }

    #[test]
    fn what_is_cut_off_or_claims_too_many_is_refused() {
        let packed = pack(&batch(20, |n, place| (n * place) as u8));
        for length in 0..packed.len() {
            assert!(unpack(&packed[..length]).is_err(), "{length}");
        }
        let mut many = packed.clone();
        many[..4].copy_from_slice(&(MAX_BATCH as u32 + 1).to_le_bytes());
        assert!(unpack(&many).is_err());
        let mut fewer = packed;
        fewer[..4].copy_from_slice(&19_u32.to_le_bytes());
        assert!(unpack(&fewer).is_err());
    }
}
