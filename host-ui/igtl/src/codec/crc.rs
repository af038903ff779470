//! The checksum of bodies: CRC-64 of ECMA-182, from 0, not reflected.

const POLYNOMIAL: u64 = 0x42f0_e1eb_a9ea_3693;
const TABLE: [u64; 256] = table();

const fn table() -> [u64; 256] {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut value = (byte as u64) << 56;
        let mut bit = 0;
        while bit < 8 {
            let carry = value >> 63 == 1;
            value <<= 1;
            if carry {
                value ^= POLYNOMIAL;
            }
            bit += 1;
        }
        table[byte] = value;
        byte += 1;
    }
    table
}

/// Computes the CRC-64 (ECMA-182) of the bytes.
pub fn crc64(bytes: &[u8]) -> u64 {
    let step = |sum: u64, byte: &u8| (sum << 8) ^ TABLE[((sum >> 56) as u8 ^ byte) as usize];
    bytes.iter().fold(0, step)
}
