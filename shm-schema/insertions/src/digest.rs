//! One digest for all results, independent of how they are split into files.

use crate::columns::{MEASURED, TEXTS, WHOLES, seed_values};
use crate::{Insertion, Table};
use sha2::{Digest, Sha256};

/// Returns the SHA-256 of every bit of every row in the order of their ids, in hexadecimal: the same however a study
/// was divided.
pub fn digest(table: &Table) -> String {
    let mut rows: Vec<&Insertion> = table.rows.iter().collect();
    rows.sort_by(|a, b| a.id.cmp(&b.id));
    let mut sum = Sha256::new();
    let text = |sum: &mut Sha256, text: &str| {
        sum.update((text.len() as u64).to_le_bytes());
        sum.update(text);
    };
    text(&mut sum, &table.about.fingerprint);
    text(&mut sum, &table.quantities.join(","));
    for row in rows {
        TEXTS.iter().for_each(|(_, of)| text(&mut sum, of(row)));
        WHOLES.iter().for_each(|(_, of)| sum.update(of(row).to_le_bytes()));
        for value in [row.prescription_gy].iter().chain(&row.drawn) {
            sum.update(value.to_bits().to_le_bytes());
        }
        match &row.outcome {
            Ok(motion) => MEASURED
                .iter()
                .for_each(|(_, of)| sum.update(of(motion).to_bits().to_le_bytes())),
            Err(why) => text(&mut sum, why),
        }
        sum.update((row.seeds.len() as u64).to_le_bytes());
        for value in row.seeds.iter().flat_map(seed_values) {
            sum.update([u8::from(value.is_some())]);
            sum.update(value.unwrap_or(0.0).to_bits().to_le_bytes());
        }
    }
    sum.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}
