//! CRC-32C (Castagnoli polynomial, RFC 3720 appendix B.4), and the mask of TFRecord, a rotation and
//! an offset, that keeps checksums of checksums apart. A table per byte of eight is fast enough for
//! a disk.

const POLYNOMIAL: u32 = 0x82f6_3b78;
const MASK_OFFSET: u32 = 0xa282_ead8;

/// `TABLES[k][b]`: the register after byte b and k zero bytes.
const TABLES: [[u32; 256]; 8] = tables();

const fn tables() -> [[u32; 256]; 8] {
    let mut tables = [[0; 256]; 8];
    let mut byte = 0;
    while byte < 256 {
        let mut register = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            let carry = register & 1;
            register >>= 1;
            if carry == 1 {
                register ^= POLYNOMIAL;
            }
            bit += 1;
        }
        tables[0][byte] = register;
        byte += 1;
    }
    let mut zeros = 1;
    while zeros < 8 {
        let mut byte = 0;
        while byte < 256 {
            let before = tables[zeros - 1][byte];
            tables[zeros][byte] = (before >> 8) ^ tables[0][(before & 0xff) as usize];
            byte += 1;
        }
        zeros += 1;
    }
    tables
}

/// CRC-32C of `bytes`.
pub(super) fn crc32c(bytes: &[u8]) -> u32 {
    let (eights, rest) = bytes.as_chunks::<8>();
    let mut register = u32::MAX;
    for eight in eights {
        let word = u64::from_le_bytes(*eight) ^ u64::from(register);
        register = 0;
        for (place, table) in TABLES.iter().rev().enumerate() {
            register ^= table[(word >> (8 * place)) as usize & 0xff];
        }
    }
    for byte in rest {
        let low = (register as u8 ^ byte) as usize;
        register = (register >> 8) ^ TABLES[0][low];
    }
    !register
}

/// CRC-32C as TFRecord stores it.
pub(super) fn masked_crc32c(bytes: &[u8]) -> u32 {
    crc32c(bytes).rotate_right(15).wrapping_add(MASK_OFFSET)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_vectors_of_the_standard_hold() {
        // RFC 3720, appendix B.4, and the check value of the catalogue of CRCs.
        let rising: Vec<u8> = (0..32).collect();
        let falling: Vec<u8> = (0..32).rev().collect();
        let cases: [(&[u8], u32); 5] = [
            (&[0; 32], 0x8a91_36aa),
            (&[0xff; 32], 0x62a8_ab43),
            (&rising, 0x46dd_794e),
            (&falling, 0x113f_db5c),
            (b"123456789", 0xe306_9283),
        ];
        for (bytes, expected) in cases {
            assert_eq!(crc32c(bytes), expected);
        }
        assert_eq!(crc32c(b""), 0);
    }
}
